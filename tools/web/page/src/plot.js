// Plots of port values over periods, one chart below another, with synchronised cursors.
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";

const COLOURS = ["#2f6fbf", "#d9534f", "#5aa469", "#b07cd8", "#d98a1f", "#26a0a8", "#a3156b", "#8d6e63"];
/** Number of curves that are shown initially. */
const SHOWN = 4;
/** Minimum and maximum height of a chart in pixels. */
const LOW = 96, HIGH = 420;
/** A limit is drawn if a value reaches this fraction of it. */
const NEAR = 0.4;
/** Tick distances of an integer axis. */
const WHOLE = [...Array(10).keys()].flatMap((power) => [1, 2, 5].map((step) => step * 10 ** power));

const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const plural = (count, noun) => `${count.toLocaleString("en")} ${noun}${count === 1 ? "" : "s"}`;
const isNumber = (value) => typeof value === "number";

/** Longest runs of indices for which `holds` is true: first and last index of each. */
function runs(length, holds) {
  const found = [];
  for (let i = 0; i < length; i++) {
    if (!holds(i)) continue;
    if (found.length && found.at(-1)[1] === i - 1) found.at(-1)[1] = i;
    else found.push([i, i]);
  }
  return found;
}

/** Indices of isolated numbers, which a line would not show. */
const alone = (values) => values.flatMap((value, i) => (isNumber(value) && !isNumber(values[i - 1]) && !isNumber(values[i + 1]) ? [i] : []));

/**
 * Creates a chart in a parent element.
 * `x`: abscissa values with `name`, `unit`, and optional `label` of the axis. `curves`: each with `name`, `unit`, `values` and optional `limit`;
 * the values `"NaN"`, `"inf"` and `"-inf"` are marked. `lines`: levels with a text. `sync`: key of charts with synchronised cursors.
 * `picked` is called with the index of a clicked point.
 */
export function chart(parent, { x, name: across, label, unit, curves, lines = [], height = () => 190, sync, picked }) {
  const axis = { stroke: style("--dim"), grid: { stroke: style("--edge"), width: 0.5 }, ticks: { stroke: style("--edge"), width: 0.5 }, labelSize: 17, labelGap: 0, labelFont: "12px system-ui, sans-serif", font: "11px system-ui, sans-serif" };
  const [{ limit, unit: of }] = curves, name = curves.map((curve) => curve.name).join(", ");
  const whole = curves.every((curve) => curve.stepped);
  const numbers = curves.flatMap((curve) => curve.values.filter(isNumber));
  const most = numbers.reduce((a, b) => Math.max(a, Math.abs(b)), 0);
  const limits = isNumber(limit) && most >= NEAR * limit ? [{ at: limit, text: `limit ${limit}${of ? ` ${of}` : ""}`, signed: true }, { at: -limit, text: `limit −${limit}${of ? ` ${of}` : ""}`, signed: true }] : [];
  // Of a symmetric limit, draw the sign that the values approach.
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

/** Draws levels as lines, and marks periods with saturated or non-finite values. */
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
    // Labels of nearby levels are placed side by side.
    const before = levels.slice(0, i).filter((other) => Math.abs(plot.valToPos(other.at, "y", true) - y) < 13 * ratio);
    const inset = before.reduce((sum, other) => sum + ctx.measureText(other.text).width + 14 * ratio, 0);
    ctx.textAlign = "right";
    ctx.textBaseline = "alphabetic";
    ctx.setLineDash([]);
    // Keep the label readable on a curve.
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

  /** Shows a run: columns of inputs and outputs by name, and cycles. Units and limits come from the program. Without a run, shows `why`. */
  show(run, program, why = "") {
    Object.assign(this, { run, program, why });
    // In declaration order.
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

  /** Height of a chart: the charts fill the panel, unless there are too many. */
  height(count) {
    const panel = this.parent.parentElement, above = this.parent.offsetTop - panel.offsetTop;
    // Space for a chart's title, and the gap below it.
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

  /** Horizontal lines in the chart of cycles: bound and deadline. */
  levels() {
    const { program, run } = this;
    const periods = program?.bounds?.filter((section) => !section.once) ?? [];
    const worst = periods.reduce((most, section) => Math.max(most, section.cycles.worst), 0);
    const lines = worst ? [{ at: worst, text: `at most ${worst}, whatever the inputs` }] : [];
    // A deadline far above the curve would flatten it.
    const tick = program?.tick;
    if (tick && tick <= 4 * run.longest) lines.push({ at: tick, text: `deadline ${tick}` });
    return lines;
  }
}
