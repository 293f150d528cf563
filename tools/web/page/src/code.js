// Panel of the code: the bundles of the program, a column for each slot, coloured by source line as the lines of the editor are.

import { node, styled } from "./parts.js";
import sheet from "./code.css" with { type: "text" };

styled(sheet);

/** Golden angle in degrees: the hues of neighbouring lines lie far apart. */
const ANGLE = 137.508;

/** Splits a place such as `pi.s:12:3-9` into file and line. */
const place = (text) => {
  const [, file, line] = /^(?:.* → )?(.*?):(\d+)/.exec(text ?? "") ?? [];
  return file ? { file, line: Number(line), key: `${file}:${line}` } : null;
};

export class Code {
  /**
   * @param parent where it goes
   * @param reveal called with the place of a clicked operation
   * @param paint called with a map from lines of the editor's text to colours
   */
  constructor(parent, { reveal, paint }) {
    Object.assign(this, { parent, paint, cells: [], rows: [] });
    this.head = node("p", { className: "code-head" });
    this.table = node("table", { className: "code" });
    parent.replaceChildren(this.head, node("div", { className: "code-scroll" }, this.table));
    const cell = (event) => event.target.closest("[data-key]");
    this.table.addEventListener("click", (event) => cell(event) && reveal({ place: cell(event).dataset.place }));
    this.table.addEventListener("keydown", (event) => {
      if (event.key !== "Enter" || !cell(event)) return;
      event.preventDefault();
      reveal({ place: cell(event).dataset.place });
    });
    this.table.addEventListener("mouseover", (event) => this.light(cell(event)?.dataset.key));
    this.table.addEventListener("mouseleave", () => this.light(this.line));
  }

  /** Shows bundles (the answer of `bundles`); `file`: name of the editor's text. */
  show({ slots, once, published, bundles }, file) {
    const at = bundles.flatMap(({ operations }) => operations.map((one) => place(one?.place)).filter(Boolean));
    const keys = [...new Map(at.map((one) => [one.key, one])).values()].sort((a, b) => (a.file === b.file ? a.line - b.line : a.file < b.file ? -1 : 1));
    // The lines of the text come first, so that a change of an included file moves none of their colours.
    keys.sort((a, b) => (b.file === file) - (a.file === file));
    const hues = new Map(keys.map(({ key }, i) => [key, Math.round((i * ANGLE) % 360)]));
    Object.assign(this, { cells: [], rows: [], file });
    const operation = (one) => {
      if (!one) return node("td", { className: "empty", textContent: "·" });
      const from = place(one.place), made = node("td", {}, one.text);
      if (!from) return made;
      Object.assign(made, { tabIndex: 0, title: `${one.text}\n${one.place}: ${one.unit}` });
      Object.assign(made.dataset, { key: from.key, place: one.place });
      made.style.setProperty("--hue", hues.get(from.key));
      made.prepend(node("small", { textContent: from.file === file ? from.line : from.key }));
      this.cells.push(made);
      return made;
    };
    const across = (className, ...content) => node("tr", { className }, node("td", { colSpan: slots.length + 1 }, ...content));
    const row = ({ address, labels, operations }) => {
      const made = node("tr", {}, node("th", { textContent: address, scope: "row" }), ...operations.map(operation));
      this.rows[address] = made;
      return [...labels.map((label) => across("label", `${label}:`)), made, ...(published.includes(address) ? [across("published", "the outputs are out; the rest is for the next period")] : [])];
    };
    // Of a program with periods, they are to be seen: what runs before them is folded.
    const [from, end] = once ?? [0, 0], isBefore = ({ address }) => address >= from && address < end;
    const parts = [bundles.filter(isBefore), bundles.filter((bundle) => !isBefore(bundle))].filter((part) => part.length);
    const body = (part) => {
      const made = node("tbody", {}, ...part.flatMap(row));
      if (!isBefore(part[0]) || parts.length === 1) return [made];
      const button = node("button", { type: "button", onclick: () => fold(!made.hidden) });
      const fold = (on) => {
        made.hidden = on;
        Object.assign(button, { textContent: `${on ? "▸" : "▾"} before the first period: ${part.length} bundle${part.length === 1 ? "" : "s"}`, ariaExpanded: String(!on) });
      };
      made.addEventListener("reveal", () => fold(false), true);
      fold(true);
      return [node("tbody", {}, across("fold", button)), made];
    };
    this.table.style.setProperty("--slots", slots.length);
    this.table.replaceChildren(node("thead", {}, node("tr", {}, node("th"), ...slots.map((slot) => node("th", { textContent: slot, scope: "col" })))), ...parts.flatMap(body));
    const count = bundles.reduce((sum, { operations }) => sum + operations.filter(Boolean).length, 0);
    this.head.textContent = `${bundles.length} bundles with ${count} operations in ${slots.length === 1 ? "one slot" : `${slots.length} slots`}; each has the colour of its line. ${matchMedia("(pointer: coarse)").matches ? "A tap" : "A click"} goes to the line.`;
    this.hues = new Map(keys.filter((one) => one.file === file).map(({ key, line }) => [line, hues.get(key)]));
    this.colour();
    this.light(this.line);
  }

  /** Gives the lines of the text the colours of the bundles. */
  colour() {
    this.paint(this.hues);
  }

  /** Marks the operations of a line of the text, and brings the first into sight with `show`. */
  mark(line, show) {
    this.line = `${this.file}:${line}`;
    this.light(this.line);
    const first = show && this.table.querySelector(".on");
    if (!first) return;
    first.dispatchEvent(new Event("reveal"));
    first.scrollIntoView({ block: "nearest" });
  }

  light(key) {
    for (const cell of this.cells) cell.classList.toggle("on", cell.dataset.key === key);
  }

  /** Marks the bundle that issues next in the debugger. */
  stand(address) {
    for (const row of this.table.querySelectorAll(".next")) row.classList.remove("next");
    this.rows[address]?.classList.add("next");
    // Whoever steps through what runs first wants to see it.
    if (address > 0) this.rows[address]?.dispatchEvent(new Event("reveal"));
  }
}
