// Picture of the machine, made from its row in the specification: front end, banks, slots with their units as pipelines. It lights up with
// the debugger's steps: the bundle that issues next, the operations in flight, and whether an operand comes from a bank or is forwarded.

import { UNITS } from "../../../../emu/analysis/src/pipeline.js";
import { node, styled } from "./parts.js";
import sheet from "./machine.css" with { type: "text" };

styled(sheet);

const NS = "http://www.w3.org/2000/svg";
/** Height of a unit's row, of a slot's title, between slots; least height of a bank, height of the front end. */
const ROW = 19, TITLE = 21, GAP = 14, FRONT = 44;
/** Widths: banks, the wires between banks and slots, the names of units; and those on a narrow screen, below so many pixels. */
const WIDE = { bank: 118, wires: 64, name: 82 }, SMALL = { bank: 78, wires: 30, name: 66 }, NARROW = 520;
/** Largest width of a pipeline stage. */
const STAGE = 30;
/** Characters that fit into so many pixels in the two sizes of type. */
const fits = (text, width, size = 11) => {
  const most = Math.max(3, Math.floor(width / (0.58 * size)));
  return text.length > most ? `${text.slice(0, most - 1)}…` : text;
};

function shape(name, attributes, text) {
  const made = document.createElementNS(NS, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (text !== undefined) made.textContent = text;
  return made;
}
const count = (value, noun) => `${value.toLocaleString("en")} ${noun}${value === 1 ? "" : "s"}`;
const colour = (unit) => `var(--u${UNITS[unit] ?? 3})`;

export class MachinePicture {
  constructor(parent) {
    this.svg = shape("svg", { class: "machine", role: "img" });
    this.told = node("p", { className: "machine-text" });
    this.legend = node("p", { className: "machine-legend" });
    parent.classList.add("tp");
    parent.replaceChildren(this.svg, this.legend, this.told);
    this.parent = parent;
    new ResizeObserver(() => this.draw()).observe(parent);
  }

  /** Shows a machine (its row) and what it does (the answer of `activity`). */
  show(machine, activity) {
    Object.assign(this, { machine, activity });
    this.draw();
  }

  put(name, attributes, text) {
    const made = shape(name, attributes, text);
    this.svg.append(made);
    return made;
  }

  title(element, text) {
    element.append(shape("title", {}, text));
    return element;
  }

  draw() {
    const { machine, activity, parent, svg } = this, width = parent.clientWidth;
    if (!machine || !width) return;
    const at = width < NARROW ? SMALL : WIDE, size = width < NARROW ? 10 : 11;
    const left = at.bank + at.wires, right = width - 10;
    const longest = Math.max(...machine.slots.flatMap(({ units }) => units.map(({ latency }) => latency)), 1);
    const stage = Math.min(STAGE, (right - left - at.name - 16) / longest);
    // A band for each slot, with its bank at the left; the inputs' bank below.
    let y = FRONT + GAP;
    const bands = machine.slots.map((slot) => {
      const height = Math.max(TITLE + slot.units.length * ROW + 6, 3 * ROW), top = y;
      y += height + GAP;
      return { slot, top, height };
    });
    const inputs = { top: y, height: 2 * ROW + 4 };
    const height = y + inputs.height + 4;
    svg.replaceChildren();
    svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    svg.setAttribute("height", height);
    svg.style.setProperty("--type", `${size}px`);
    svg.setAttribute("aria-label", `The machine ${machine.name}: ${machine.slots.length} slots`);
    this.front(width, size);
    const banks = [...bands.map(({ slot, top, height }) => ({ bank: slot.bank, top, height })), { bank: machine.inputs, top: inputs.top, height: inputs.height }];
    this.wires(bands, banks, at, left);
    for (const [i, one] of banks.entries()) this.bank(i, one, at.bank, size, i === machine.slots.length);
    for (const [i, band] of bands.entries()) this.band(i, band, { left, right, stage, name: at.name, size });
    this.say();
  }

  front(width, size) {
    const { machine, activity } = this, { cause } = activity;
    const box = this.put("rect", { class: `mp-box${cause ? "" : " mp-on"}`, x: 1, y: 1, width: width - 2, height: FRONT - 4, rx: 4 });
    this.title(box, `program memory: ${count(machine.code_depth, "bundle")}; after a jump, a call or the tick, nothing issues for ${count(machine.refill, "cycle")}, after a branch that is not taken for ${machine.resolve}; ${count(machine.loop_depth, "nested loop")} without cost, ${count(machine.stack_depth, "return address")}`);
    this.put("text", { class: "mp-name", x: 9, y: 17 }, "front end");
    this.put("text", { class: "mp-dim", x: width - 9, y: 17, "text-anchor": "end" }, fits(`${count(machine.code_depth, "bundle")}, refill ${machine.refill}`, width / 2, size));
    const next = activity.waits ? "waits for the tick" : cause ? `${activity.place} waits: ${cause}` : `${activity.place} issues`;
    this.put("text", { class: cause ? "mp-stall" : "mp-text", x: 9, y: 34 }, fits(`cycle ${activity.cycle}: ${next}`, width - 18, size));
  }

  /** Paths from each bank to each slot, and from each slot back to its bank. */
  wires(bands, banks, at, left) {
    const { activity } = this;
    const from = ({ top, height }) => top + Math.min(height - 8, TITLE + 5), into = ({ top }) => top + TITLE / 2 + 1;
    const lit = [];
    for (const [s, band] of bands.entries()) {
      const reads = activity.operations[s]?.reads ?? [];
      for (const [b, bank] of banks.entries()) {
        const read = reads.filter((one) => one.bank === b), d = `M${at.bank} ${from(bank)} C${at.bank + at.wires / 2} ${from(bank)} ${left - at.wires / 2} ${into(band)} ${left} ${into(band)}`;
        this.put("path", { class: "mp-wire", d });
        for (const forwarded of [false, true]) if (read.some((one) => one.forwarded === forwarded)) lit.push([forwarded, b, s, band]);
      }
    }
    // Results return below the units, into the bank.
    for (const [s, { slot, top, height }] of bands.entries()) {
      const y = top + height + 4, writes = activity.flight.some((one) => one.slot === s && one.writes && one.left <= 0);
      const path = this.put("path", { class: `mp-return${writes ? " mp-on" : ""}`, d: `M${left + 40} ${top + height} V${y} H${at.bank / 2} V${top + height}` });
      this.title(path, `results of slot ${slot.name} go to bank ${slot.bank.name}, and past it to operands that wait for them`);
    }
    for (const [forwarded, b, s, band] of lit) {
      const bank = banks[b], y = forwarded ? bank.top + bank.height + 4 : from(bank), x = forwarded ? at.bank / 2 + 10 : at.bank;
      this.put("path", { class: forwarded ? "mp-forward" : "mp-read", d: `M${x} ${y} C${at.bank + at.wires / 2} ${y} ${left - at.wires / 2} ${into(band)} ${left} ${into(band)}` });
    }
  }

  bank(b, { bank, top, height }, width, size, isInputs) {
    const { activity } = this, reads = activity.operations.flatMap((one) => one?.reads ?? []).filter((one) => one.bank === b);
    const names = [...new Set(reads.map(({ text }) => text))], written = activity.flight.filter((one) => one.bank === b && one.left <= 0).map(({ writes }) => writes);
    const box = this.put("rect", { class: `mp-box${names.length ? " mp-on" : ""}`, x: 1, y: top, width: width - 1, height, rx: 4 });
    this.title(box, `bank ${bank.name}: ${count(bank.depth, "register")}${isInputs ? ", the input ports; its last is zero" : ""}\nread by every slot${names.length ? `\nread now: ${names.join(", ")}` : ""}${written.length ? `\nwritten now: ${written.join(", ")}` : ""}`);
    this.put("text", { class: "mp-name", x: 8, y: top + 15 }, isInputs ? "inputs" : `bank ${bank.name}`);
    if (width > 90) this.put("text", { class: "mp-dim", x: width - 6, y: top + 15, "text-anchor": "end" }, bank.depth);
    const lines = Math.max(1, Math.floor((height - TITLE) / 14)), shown = names.length > lines ? [...names.slice(0, lines - 1), `+ ${names.length - lines + 1} more`] : names;
    for (const [i, name] of shown.entries()) this.put("text", { class: "mp-text", x: 8, y: top + 31 + 14 * i }, fits(name, width - 14, size));
  }

  band(s, { slot, top, height }, { left, right, stage, name, size }) {
    const { activity } = this, issues = activity.operations[s], active = issues && !activity.cause;
    this.put("rect", { class: `mp-box${active ? " mp-on" : ""}`, x: left, y: top, width: right - left, height, rx: 4 });
    this.put("text", { class: "mp-name", x: left + 8, y: top + 15 }, slot.name);
    this.put("text", { class: active ? "mp-text" : "mp-dim", x: left + 8 + 7 * Math.max(4, slot.name.length + 1), y: top + 15 }, fits(issues?.text ?? "–", right - left - 50, size));
    for (const [u, unit] of slot.units.entries()) {
      const y = top + TITLE + u * ROW, x = left + name, stages = Math.max(1, unit.latency);
      const flying = activity.flight.filter((one) => one.slot === s && one.unit === u);
      const here = active && issues.unit === u;
      this.put("text", { class: here || flying.length ? "mp-text" : "mp-dim", x: left + 8, y: y + 13 }, fits(unit.name, name - 10, size));
      const text = `${unit.name}: ${unit.text}\n${unit.latency ? `result after ${count(unit.latency, "cycle")}` : "no result"}, an operation every ${unit.interval === 1 ? "cycle" : `${unit.interval} cycles`}`;
      for (let i = 0; i < stages; i++) {
        const one = i === 0 && here ? { text: issues.text, writes: issues.writes } : flying.find(({ stage }) => stage === i);
        const cell = this.put("rect", { class: `mp-stage${one ? " mp-full" : ""}`, x: x + i * stage, y: y + 2, width: Math.max(2, stage - 2), height: ROW - 5, rx: 2, style: `--fill:${colour(unit.name)}` });
        const cut = i === 0 ? "issue" : unit.cuts[i - 1] ?? "";
        this.title(cell, `${text}\ncycle ${i + 1} of ${stages}${cut ? `, ${cut}` : ""}${one ? `\n${one.text}` : ""}`);
      }
      const results = [...(here && issues.writes ? [issues.writes] : []), ...flying.filter((one) => one.writes).map((one) => one.writes)];
      const note = results.length ? `→ ${results.join(", ")}` : unit.name === "memory" ? `data: ${count(this.machine.data_depth, "word")}` : "", end = x + stages * stage + 5;
      if (note && right - end > 50) this.put("text", { class: results.length ? "mp-text" : "mp-dim", x: end, y: y + 13 }, fits(note, right - end, size));
    }
  }

  /** The same in words. */
  say() {
    const { activity } = this, reads = activity.operations.flatMap((one) => one?.reads ?? []);
    const forwarded = [...new Set(reads.filter((one) => one.forwarded).map(({ text }) => text))];
    const flying = activity.flight.filter(({ left }) => left > 0);
    this.told.textContent = [
      flying.length ? `In flight: ${flying.map((one) => `${one.text} (${count(one.left, "cycle")})`).join(", ")}` : "Nothing is in flight",
      forwarded.length ? `forwarded in the cycle of issue: ${forwarded.join(", ")}` : "",
    ].filter(Boolean).join("; ") + ".";
    const key = (className, text) => node("span", {}, node("i", { className }), text);
    this.legend.replaceChildren(key("mp-key-read", "operand from a bank"), key("mp-key-forward", "operand forwarded: the result of this very cycle"), key("mp-key-return", "result on its way to its bank"), key("mp-key-full", "operation in flight, in the colour of its unit"));
  }
}
