// Comparison of a period of two programs: both pipelines, and the differences by source line.

import { diffArrays } from "diff";
import { KINDS, Pipeline } from "../../../../emu/analysis/src/pipeline.js";
import { node, styled } from "./parts.js";
import sheet from "./compare.css" with { type: "text" };

styled(sheet);

/** Largest height of a pipeline, height of an operation, and of everything else in it; pixels. */
const TALL = 320, ROW = 18, CHROME = 66;

const whole = (value) => value.toLocaleString("en", { maximumFractionDigits: 1 });
const signed = (value) => (Math.abs(value) < 0.05 ? "=" : `${value > 0 ? "+" : "−"}${whole(Math.abs(value))}`);

/** Splits a place such as `pi.s:12:3-9` into file and line. */
const place = (text) => /^(?:.* → )?(.*?):(\d+)/.exec(text ?? "")?.slice(1, 3) ?? [null, 0];

/**
 * Costs of the source lines in a picture, by `file:line`: operations, and the cycles between the issue of the bundle before and of theirs.
 * Operations of one bundle share its cycles in equal parts, so that all lines together have the cycles of the period.
 */
export function costs(picture) {
  const found = new Map();
  let last = 0;
  for (const { cycle, operations, place: from } of picture.bundles) {
    const passed = cycle - last;
    last = cycle;
    const all = operations.length ? operations : [{ place: from, idle: true }];
    for (const { place: at, idle } of all) {
      const [file, line] = place(at ?? from), key = `${file ?? "?"}:${line}`;
      const cost = found.get(key) ?? { file, line: Number(line), operations: 0, cycles: 0 };
      cost.operations += idle ? 0 : 1;
      cost.cycles += passed / all.length;
      found.set(key, cost);
    }
  }
  return found;
}

/** Lines of two texts in pairs: numbers from 1, 0 where the other text has none. */
export function pairs(before, after) {
  const found = [];
  let [a, b] = [0, 0];
  const parts = diffArrays(before.split("\n"), after.split("\n"));
  for (const [i, { count, added, removed }] of parts.entries()) {
    // A line that was changed stands beside the line that it was.
    if (added && parts[i - 1]?.removed) {
      const start = found.length - parts[i - 1].count;
      for (let k = 0; k < count; k++) found[start + k] = k < parts[i - 1].count ? [found[start + k][0], ++b] : [0, ++b];
    } else for (let k = 0; k < count; k++) found.push([added ? 0 : ++a, removed ? 0 : ++b]);
  }
  return found;
}

/** Rows of the table of differences: both lines, the text, and the costs on both sides. */
export function differences(before, after) {
  const [a, b] = [costs(before.picture), costs(after.picture)], none = { operations: 0, cycles: 0 };
  const own = (side) => (key) => key.startsWith(`${side.name}:`);
  const [old, now] = [before, after].map(({ source }) => source.split("\n"));
  const rows = pairs(before.source, after.source).map(([from, to]) => ({
    from, to, text: to ? now[to - 1] : old[from - 1], was: from && to && old[from - 1] !== now[to - 1] ? old[from - 1] : undefined,
    a: a.get(`${before.name}:${from}`) ?? none, b: b.get(`${after.name}:${to}`) ?? none,
  }));
  const rest = [...new Set([...[...a.keys()].filter((key) => !own(before)(key)), ...[...b.keys()].filter((key) => !own(after)(key))])];
  for (const key of rest) rows.push({ from: key, to: key, text: "", a: a.get(key) ?? none, b: b.get(key) ?? none });
  return rows.filter(({ a, b }) => a !== none || b !== none);
}

export class Comparison {
  /**
   * @param parent where it goes
   * @param reveal called with an operation of the page's own program
   * @param goTo called with a line of the page's own text
   */
  constructor(parent, { reveal, goTo }) {
    Object.assign(this, { parent, goTo });
    const side = () => {
      const [title, box] = [node("h3"), node("div", { className: "compare-pipeline" })];
      return { title, box, element: node("section", { className: "compare-side" }, title, box) };
    };
    this.sides = [side(), side()];
    this.pipelines = [new Pipeline(this.sides[0].box, (operation) => this.before.source === this.after.source && reveal(operation)), new Pipeline(this.sides[1].box, reveal)];
    this.legend = node("div", { className: "tp-legend compare-legend" });
    this.all = node("input", { type: "checkbox" });
    this.all.addEventListener("change", () => this.rows());
    this.total = node("p", { className: "compare-total" });
    this.table = node("table", { className: "compare-lines" });
    const head = node("p", {}, "Cycles by line ", node("label", {}, this.all, " equal lines, too"));
    parent.replaceChildren(this.total, node("div", { className: "tp" }, this.legend), node("div", { className: "compare-sides" }, ...this.sides.map(({ element }) => element)), head, node("div", { className: "compare-scroll" }, this.table));
  }

  /** Shows two sides: `title`, `name` and `source` of the text, `picture`. */
  show(before, after) {
    Object.assign(this, { before, after });
    for (const [i, side] of [before, after].entries()) {
      const { cycles, bundles } = side.picture, stalled = bundles.reduce((sum, one) => sum + one.stalls.reduce((sum, { cause, cycles }) => sum + (cause === "wait" ? 0 : cycles), 0), 0);
      this.sides[i].title.replaceChildren(node("b", { textContent: side.title }), ` ${cycles} cycles, ${bundles.length} bundles, ${stalled} stalled`);
      const rows = bundles.reduce((sum, { operations }) => sum + Math.max(1, operations.length), 0);
      this.sides[i].box.style.height = `${Math.min(TALL, CHROME + ROW * rows)}px`;
      this.pipelines[i].show(side.picture);
    }
    // One legend for both: counts differ, colours do not.
    const named = (entry) => entry.textContent.replace(/ (\d+|\([^)]*\))$/, "");
    const entries = new Map(this.pipelines.flatMap(({ legend }) => [...legend.children].map((entry) => [named(entry), entry])));
    this.legend.replaceChildren(...[...entries].map(([name, entry]) => node("span", {}, entry.querySelector("i").cloneNode(), name)));
    // One scale for both, at which the longer is in sight: equal lengths are equal times. Names of one width, so that both begin below one another.
    const longest = Math.max(...this.pipelines.map((one) => one.longest));
    for (const one of this.pipelines) one.longest = longest;
    for (const one of this.pipelines) one.fit();
    const width = Math.min(...this.pipelines.map((one) => one.width || Infinity)), isNamed = this.pipelines.every(({ labelWidth }) => labelWidth > 0);
    for (const one of this.pipelines) one.fit({ width, named: isNamed });
    const [a, b] = [before.picture.cycles, after.picture.cycles];
    this.total.replaceChildren(`${before.title}: `, node("b", { textContent: a }), ` → ${after.title}: `, node("b", { textContent: b }), ` cycles in the period (${a === b ? "the same" : signed(b - a)}${a && a !== b ? `, ${signed((100 * (b - a)) / a)} %` : ""})`);
    const causes = Object.keys(KINDS).map((kind) => [kind, ...[before, after].map(({ picture }) => picture.bundles.flatMap(({ stalls }) => stalls).reduce((sum, one) => sum + (one.cause === kind && kind !== "wait" ? one.cycles : 0), 0))]);
    const moved = causes.filter(([, a, b]) => a !== b).map(([kind, a, b]) => `${kind} ${a} → ${b}`);
    if (moved.length) this.total.append(node("br"), node("span", { textContent: `stalled by ${moved.join(", ")}` }));
    this.rows();
  }

  rows() {
    const all = differences(this.before, this.after), isOther = ({ a, b, was }) => was !== undefined || a.operations !== b.operations || Math.abs(a.cycles - b.cycles) > 0.05;
    const list = all.filter((row) => this.all.checked || isOther(row)).sort((x, y) => (this.all.checked ? 0 : Math.abs(y.b.cycles - y.a.cycles) - Math.abs(x.b.cycles - x.a.cycles)));
    const number = (text, className) => node("td", { textContent: text, className: className ?? "" });
    const kind = (by) => (Math.abs(by) < 0.05 ? "" : by > 0 ? "more" : "less");
    const row = ({ from, to, text, was, a, b }) => {
      const by = b.cycles - a.cycles, name = from === to ? to : from && to ? `${from} → ${to}` : from ? `${from} → –` : `– → ${to}`;
      const line = node("button", { type: "button", textContent: name, disabled: !Number(to) });
      line.addEventListener("click", () => this.goTo(Number(to)));
      return node("tr", {}, node("td", {}, line), node("td", { className: was === undefined ? "text" : "text was", title: was === undefined ? text.trim() : `before: ${was.trim()}` }, node("code", { textContent: text.trim() })),
        number(a.operations === b.operations ? a.operations : `${a.operations} → ${b.operations}`), number(whole(a.cycles)), number(whole(b.cycles)), number(signed(by), kind(by)));
    };
    const sum = (side) => all.reduce((sum, row) => sum + row[side].cycles, 0), [a, b] = [sum("a"), sum("b")];
    this.table.replaceChildren(
      node("thead", {}, node("tr", {}, ...["line", "", "operations", this.before.title, this.after.title, "cycles"].map((text) => node("th", { textContent: text })))),
      node("tbody", {}, ...list.map(row)),
      node("tfoot", {}, node("tr", {}, number(list.length < all.length ? `${all.length - list.length} equal` : ""), number(""), number(""), number(whole(a)), number(whole(b)), number(signed(b - a), kind(b - a)))),
    );
  }

  /** Marks the operations of a line of the page's own text, on the other side those of the line that stands beside it. */
  mark(line) {
    if (!this.after) return;
    const [from] = pairs(this.before.source, this.after.source).find(([, to]) => to === line) ?? [0];
    for (const [i, [side, at]] of [[this.before, from], [this.after, line]].entries()) {
      this.pipelines[i].mark((operation) => {
        const [file, number] = place(operation.place);
        return file === side.name && Number(number) === at;
      }, true);
    }
  }
}
