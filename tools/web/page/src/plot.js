// Values of ports over the periods, one chart below the other, with cursors that move in step.
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";

const COLOURS = ["#2f6fbf", "#d9534f", "#5aa469", "#b07cd8", "#d98a1f", "#26a0a8", "#a3156b", "#8d6e63"];
/** Curves that are shown at first. */
const SHOWN = 4;
/** Pixels of a chart, at least and at most. */
const LOW = 96, HIGH = 420;
/** A limit is drawn where the values come as near to it as this share of it. */
const NEAR = 0.4;
/** Steps of an axis of counts. */
const WHOLE = [...Array(10).keys()].flatMap((power) => [1, 2, 5].map((step) => step * 10 ** power));

const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const plural = (count, noun) => `${count.toLocaleString("en")} ${noun}${count === 1 ? "" : "s"}`;
const isNumber = (value) => typeof value === "number";

/** Runs of indices for which something holds: first and last of each. */
function runs(length, holds) {
  const found = [];
  for (let i = 0; i < length; i++) {
    if (!holds(i)) continue;
    if (found.length && found.at(-1)[1] === i - 1) found.at(-1)[1] = i;
    else found.push([i, i]);
  }
  return found;
}

/** Indices of numbers with none beside them, which no line shows. */
const alone = (values) => values.flatMap((value, i) => (isNumber(value) && !isNumber(values[i - 1]) && !isNumber(values[i + 1]) ? [i] : []));

/**
 * A chart in a parent.
 * `x` are the values across, with a `name`, a `unit`, and a `label` if the axis is to have one; `curves` have `name`, `unit`, `values` and perhaps `limit`: values may be
 * `"NaN"`, `"inf"` and `"-inf"`, which are marked. `lines` are levels with a text. `sync` names charts whose cursors move together;
 * `picked` is called with the index where it is clicked.
 */
export function chart(parent, { x, name: across, label, unit, curves, lines = [], height = () => 190, sync, picked }) {
  const axis = { stroke: style("--dim"), grid: { stroke: style("--edge"), width: 0.5 }, ticks: { stroke: style("--edge"), width: 0.5 }, labelSize: 17, labelGap: 0, labelFont: "12px system-ui, sans-serif", font: "11px system-ui, sans-serif" };
  const [{ limit, unit: of }] = curves, name = curves.map((curve) => curve.name).join(", ");
  const whole = curves.every((curve) => curve.stepped);
  const numbers = curves.flatMap((curve) => curve.values.filter(isNumber));
  const most = numbers.reduce((a, b) => Math.max(a, Math.abs(b)), 0);
  const limits = isNumber(limit) && most >= NEAR * limit ? [{ at: limit, text: `limit ${limit}${of ? ` ${of}` : ""}`, signed: true }, { at: -limit, text: `limit −${limit}${of ? ` ${of}` : ""}`, signed: true }] : [];
  // Of the two signs of a limit those that the values come near.
  const near = ({ at, signed }) => !signed || numbers.some((value) => Math.sign(value) === Math.sign(at) && Math.abs(value) >= NEAR * Math.abs(at));
  const levels = [...lines, ...limits].filter(near);
  const lost = runs(x.length, (i) => curves.some(({ values }) => values[i] !== null && !isNumber(values[i])));
  const saturated = isNumber(limit) ? runs(x.length, (i) => curves.some(({ values }) => isNumber(values[i]) && Math.abs(values[i]) >= limit)) : [];
  const count = (list) => list.reduce((sum, [a, b]) => sum + b - a + 1, 0);

  const element = document.createElement("div");
  element.className = "chart";
  const head = document.createElement("p");
  head.className = "chart-head";
  head.append(Object.assign(document.createElement("b"), { textContent: name }), of ? `, ${of}` : "");
  const remark = (text, kind) => head.append(Object.assign(document.createElement("span"), { textContent: text, className: kind }));
  if (saturated.length) remark(`at its limit in ${plural(count(saturated), "period")}`, "saturated");
  if (lost.length) remark(`no number in ${plural(count(lost), "period")}: ${[...new Set(curves.flatMap(({ values }) => values.filter((value) => value !== null && !isNumber(value))))].join(", ")}`, "lost");
  element.append(head);
  const at = Object.assign(document.createElement("output"), { className: "at" });
  head.append(at);
  parent.append(element);
  if (!numbers.length) {
    remark(lost.length ? "" : "it was written in no period", "lost");
    return { destroy: () => element.remove(), size() {}, cursor() {} };
  }
  const number = (value, unit) => `${isNumber(value) ? +value.toPrecision(7) : value ?? "not written"}${unit ? ` ${unit}` : ""}`;
  const said = (i) => `${across} ${number(x[i], unit)}: ${curves.map((curve) => number(curve.values[i], curve.unit)).join(", ")}`;
  const width = () => Math.max(220, parent.clientWidth - 8);
  const range = (_, low, high) => {
    const [a, b] = levels.reduce(([a, b], { at }) => [Math.min(a, at), Math.max(b, at)], [low, high]);
    const gap = (b - a || Math.abs(a) || 1) * 0.06;
    return [a - gap, b + gap];
  };
  const plot = new uPlot({
    width: width(), height: height(), padding: [6, 10, 0, 0], scales: { x: { time: false }, y: { range } },
    axes: [{ ...axis, ...(label && { label: unit ? `${label}, ${unit}` : label }), size: 26 }, { ...axis, label: of ? `${name}, ${of}` : name, size: 58, space: 22, ...(whole && { incrs: WHOLE }) }],
    legend: { show: false }, cursor: { ...(sync && { sync: { key: sync } }), points: { size: 7 }, drag: { x: true, y: false } },
    series: [{}, ...curves.map(({ name, stepped }, i) => ({
      label: name, stroke: COLOURS[i % COLOURS.length], width: 1.6, points: { show: true, filter: () => x.length < 40 ? null : alone(curves[i].values), size: 4 },
      ...(stepped && { paths: uPlot.paths.stepped({ align: 1 }) }),
    }))],
    hooks: { setCursor: [({ cursor: { idx } }) => (at.textContent = idx === null || idx === undefined ? "" : said(idx))], draw: [(plot) => mark(plot, { x, levels, lost, saturated })] },
  }, [x, ...curves.map((curve) => curve.values.map((value) => (isNumber(value) ? value : null)))], element);
  if (picked) plot.over.addEventListener("click", () => plot.cursor.idx !== null && plot.cursor.idx !== undefined && picked(plot.cursor.idx));
  const size = () => parent.clientWidth && plot.setSize({ width: width(), height: height() });
  const observer = new ResizeObserver(size);
  observer.observe(parent);
  return {
    destroy: () => (observer.disconnect(), plot.destroy(), element.remove()), size,
    cursor: (index) => plot.setCursor({ left: plot.valToPos(x[index], "x"), top: plot.bbox.height / devicePixelRatio / 2 }),
  };
}

/** Levels as lines, and the periods in which a value is at its limit or is no number. */
function mark(plot, { x, levels, lost, saturated }) {
  const { ctx, bbox: { left, top, width, height } } = plot, ratio = devicePixelRatio || 1;
  const half = x.length > 1 ? (x[1] - x[0]) / 2 : 0.5;
  const bands = (list, colour, alpha, tall) => {
    ctx.fillStyle = colour;
    ctx.globalAlpha = alpha;
    for (const [a, b] of list) {
      const [from, to] = [plot.valToPos(x[a] - half, "x", true), plot.valToPos(x[b] + half, "x", true)];
      const begin = Math.max(from, left), end = Math.min(Math.max(to, from + 2 * ratio), left + width);
      if (end > begin) ctx.fillRect(begin, top, end - begin, tall ?? height);
    }
  };
  ctx.save();
  bands(saturated, style("--warn"), 0.16);
  bands(saturated, style("--warn"), 0.9, 3 * ratio);
  bands(lost, style("--bad"), 0.22);
  bands(lost, style("--bad"), 1, 4 * ratio);
  ctx.globalAlpha = 1;
  ctx.font = `${11 * ratio}px system-ui, sans-serif`;
  for (const [i, { at, text }] of levels.entries()) {
    const y = plot.valToPos(at, "y", true);
    if (y < top - 1 || y > top + height + 1) continue;
    ctx.lineWidth = 1.2 * ratio;
    ctx.strokeStyle = ctx.fillStyle = style("--limit");
    ctx.setLineDash([6 * ratio, 4 * ratio]);
    ctx.beginPath();
    ctx.moveTo(left, y);
    ctx.lineTo(left + width, y);
    ctx.stroke();
    // Texts of levels that are near each other stand side by side.
    const before = levels.slice(0, i).filter((other) => Math.abs(plot.valToPos(other.at, "y", true) - y) < 13 * ratio);
    const inset = before.reduce((sum, other) => sum + ctx.measureText(other.text).width + 14 * ratio, 0);
    ctx.textAlign = "right";
    ctx.textBaseline = "alphabetic";
    ctx.setLineDash([]);
    // Readable where a curve runs through it.
    ctx.strokeStyle = style("--bg");
    ctx.lineWidth = 3 * ratio;
    ctx.lineJoin = "round";
    const below = y - top < 16 * ratio, place = [left + width - 4 * ratio - inset, below ? y + 13 * ratio : y - 5 * ratio];
    ctx.strokeText(text, ...place);
    ctx.fillText(text, ...place);
  }
  ctx.restore();
}

export class Plots {
  constructor(parent, choice) {
    Object.assign(this, { parent, choice, charts: [], chosen: new Map(), units: new Map() });
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw());
    new ResizeObserver(() => this.size()).observe(parent.parentElement);
  }

  /** Shows a run: columns of inputs and outputs by name, and cycles; the program has their units and limits. Without a run it says `why`. */
  show(run, program, why = "") {
    Object.assign(this, { run, program, why });
    // In the order of their declaration.
    const ports = run ? [...(program?.outputs ?? []).map(({ name }) => ["out", name]), ...(program?.inputs ?? []).map(({ name }) => ["in", name])] : [];
    this.facts = new Map([...(program?.outputs ?? []).map((port) => [`out ${port.name}`, port]), ...(program?.inputs ?? []).map((port) => [`in ${port.name}`, port])]);
    this.choice.replaceChildren(...ports.map(([kind, name], i) => {
      const key = `${kind} ${name}`, label = document.createElement("label"), box = document.createElement("input");
      box.type = "checkbox";
      box.checked = this.chosen.get(key) ?? (kind === "out" && i < SHOWN);
      this.chosen.set(key, box.checked);
      box.addEventListener("change", () => (this.chosen.set(key, box.checked), this.draw()));
      label.append(box, ` ${name}${kind === "in" ? " (in)" : ""}`);
      return label;
    }));
    this.draw();
  }

  /** The height of a chart: together they fill the panel, unless there are many. */
  height(count) {
    const panel = this.parent.parentElement, above = this.parent.offsetTop - panel.offsetTop;
    // A chart's title, and the gap below it.
    const room = (panel.clientHeight - above - 16) / Math.max(1, count) - 32;
    return Math.round(Math.min(HIGH, Math.max(LOW, room)));
  }

  size() {
    for (const one of this.charts) one.size();
  }

  draw() {
    for (const one of this.charts) one.destroy();
    this.charts = [];
    this.parent.replaceChildren();
    const { run, program } = this;
    const say = (why) => why && this.parent.append(Object.assign(document.createElement("p"), { className: "why", textContent: why }));
    if (!run) return say(this.why);
    if (!this.parent.clientWidth) return;
    if (!run.cycles.length) return say("There is nothing to plot over periods: the program has run through no period.");
    const ports = program?.inputs?.length ?? 0;
    if (ports && !program.rows) say(`There are no inputs: ${ports === 1 ? "the input port is" : `all ${ports} input ports are`} 0 in every period. The tab Inputs takes a table.`);
    const x = run.cycles.map((_, i) => i + 1);
    const chosen = [...this.facts].filter(([key]) => this.chosen.get(key));
    const curves = chosen.map(([key, { name, unit, limit }]) => ({ name, unit, limit, values: (key.startsWith("out ") ? run.outputs : run.inputs)[name] ?? [] }));
    const height = () => this.height(curves.length + 1);
    for (const curve of curves) this.charts.push(chart(this.parent, { x, name: "period", curves: [curve], height, sync: "ports" }));
    this.charts.push(chart(this.parent, { x, name: "period", label: "period", curves: [{ name: "cycles", values: run.cycles, stepped: true }], lines: this.levels(), height, sync: "ports" }));
  }

  /** Lines beside the cycles: the bound, the deadline. */
  levels() {
    const { program, run } = this;
    const periods = program?.bounds?.filter((section) => !section.once) ?? [];
    const worst = periods.reduce((most, section) => Math.max(most, section.cycles.worst), 0);
    const lines = worst ? [{ at: worst, text: `at most ${worst}, whatever the inputs` }] : [];
    // A deadline far above would flatten the curve.
    const tick = program?.tick;
    if (tick && tick <= 4 * run.longest) lines.push({ at: tick, text: `deadline ${tick}` });
    return lines;
  }
}
