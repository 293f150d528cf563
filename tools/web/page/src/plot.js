// Plots of port values over periods, one chart below another, with synchronised cursors.
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { COLOURS, colour, short, signed } from "./parts.js";
import { Pen, drawing } from "./svg.js";

/** Dashes of the curves in a chart, so that many differ in more than colour, and those of a reference. */
const DASHES = [[], [], [14, 3], [9, 3, 2, 3]], REFERENCE = [2, 3];
/** Maximum number of curves over one axis. */
const TOGETHER = COLOURS;
/** Ports beyond this number are offered when they are asked for. */
const OFFERED = 16;
/** Number of outputs that are shown initially, and most inputs that are. */
const SHOWN = 4, FEW = 3;
/** Time axis in ms up to this duration in s. */
const BRIEF = 2;
/** Height of a folded chart in pixels. */
const FOLDED = 27;
/** Minimum and maximum height of a chart in pixels. */
const LOW = 120, HIGH = 420;
/** Maximum height of a chart as a fraction of its width: on a telephone, sliders are to be seen below the charts. */
const TALL = 0.6, TALL_NARROW = 0.46, NARROW = 480;
/** A limit is drawn if a value reaches this fraction of it. */
const NEAR = 0.4;
/** Below this magnitude, an axis has numbers such as `5e-6`: uPlot's own have three decimal places. */
const TINY = 0.01;
/** Time in which a second click makes a double click; ms. */
const DOUBLE = 300;
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

/** The values are one number throughout. */
const flat = (values) => values.length > 0 && values.every((value) => isNumber(value) && value === values[0]);
/** A chart of the curves would be horizontal lines only. */
const isFlat = (curves) => curves.every(({ values, before }) => flat(values) && (!before || before.every((value) => value === values[0])));

const number = (value, unit) => `${isNumber(value) ? +value.toPrecision(7) : value ?? "not written"}${unit ? ` ${unit}` : ""}`;

/** Returns the texts of an axis' numbers; uPlot's filter leaves null where there is no room. */
const ticks = (isTiny) => (_, splits) => splits.map((value) => (value === null ? "" : signed(isTiny ? short(value) : uPlot.fmtNum(value))));

let measuring;
/** Width of a text on an axis in pixels. */
function widthOf(text) {
  measuring ??= document.createElement("canvas").getContext("2d");
  measuring.font = "11px system-ui, sans-serif";
  return measuring.measureText(text).width;
}

/** Limits that a chart shows as lines: of each symmetric limit, the signs that the values approach. */
function limitsOf(curves) {
  const found = new Map();
  for (const { limit, unit, values } of curves) {
    if (!isNumber(limit)) continue;
    for (const at of [limit, -limit]) {
      if (values.some((value) => isNumber(value) && Math.sign(value) === Math.sign(at) && Math.abs(value) >= NEAR * limit)) found.set(at, { at, text: `limit ${at < 0 ? "−" : ""}${limit}${unit ? ` ${unit}` : ""}` });
    }
  }
  return [...found.values()];
}

const isReference = (name) => name.endsWith("_ref");

/** Colours and dashes of curves: a reference has the colour of what follows it, dotted. */
function looks(curves) {
  const bases = [...new Set(curves.map(({ name }) => name.replace(/_ref$/, "")))];
  return curves.map(({ name }) => {
    const i = bases.indexOf(name.replace(/_ref$/, "")), alone = !curves.some((other) => `${other.name}_ref` === name);
    const dash = isReference(name) && !alone ? REFERENCE : DASHES[i % DASHES.length];
    return { colour: colour(i), dash, line: { 0: "solid", 2: dash === REFERENCE ? "dotted" : "dashed" }[dash.length] ?? "dashed" };
  });
}

/** Creates a chart's heading: names with their colours, unit, remarks. Returns the element and a function that adds a remark. */
function heading(curves, look) {
  const head = document.createElement("p"), of = curves[0].unit;
  head.className = "chart-head";
  for (const [i, { name }] of curves.entries()) {
    if (i) head.append(", ");
    if (curves.length > 1) {
      const swatch = document.createElement("i");
      swatch.style.borderTop = `${curves[i].points ? "6px dotted" : `2px ${look[i].line}`} ${look[i].colour}`;
      if (curves[i].points) swatch.style.width = "6px";
      head.append(swatch);
    }
    head.append(Object.assign(document.createElement("b"), { textContent: name }));
  }
  if (of) head.append(`, ${of}`);
  return { head, remark: (text, kind) => head.append(" ", Object.assign(document.createElement("span"), { textContent: text, className: kind })) };
}

/**
 * Creates a chart in a parent element.
 * `x`: abscissa values with `name`, `unit`, and optional `label` of the axis. `curves`: each with `name`, `unit`, `values`, optional `limit`
 * and optional values `before`, which are drawn pale; the values `"NaN"`, `"inf"` and `"-inf"` are marked. `lines`: levels with a text.
 * `sync`: key of charts with synchronised cursors. `place` names a point by its index. `picked` is called with the index of a clicked point.
 * `points` of a curve: its values have nothing to do with one another, so that no line joins them. `moments`: indices of vertical lines. With `folds`, a chart of horizontal lines is its heading only.
 */
export function chart(parent, { x, name: across, label, unit, curves, lines = [], height = () => 190, sync, picked, moments = [], place, folds }) {
  const axis = { stroke: style("--dim"), grid: { stroke: style("--edge"), width: 0.5 }, ticks: { stroke: style("--edge"), width: 0.5 }, labelSize: 17, labelGap: 0, labelFont: "12px system-ui, sans-serif", font: "11px system-ui, sans-serif" };
  const of = curves[0].unit, whole = curves.every((curve) => curve.stepped || curve.whole);
  const levels = [...lines, ...limitsOf(curves)];
  const lost = runs(x.length, (i) => curves.some(({ values }) => values[i] !== null && !isNumber(values[i])));
  const saturated = runs(x.length, (i) => curves.some(({ values, limit }) => isNumber(limit) && isNumber(values[i]) && Math.abs(values[i]) >= limit));
  const count = (list) => list.reduce((sum, [a, b]) => sum + b - a + 1, 0);

  const element = document.createElement("div");
  element.className = "chart";
  const look = looks(curves), { head, remark } = heading(curves, look);
  if (saturated.length) remark(`at its limit in ${plural(count(saturated), "period")}`, "saturated");
  if (lost.length) remark(`no number in ${plural(count(lost), "period")}: ${[...new Set(curves.flatMap(({ values }) => values.filter((value) => value !== null && !isNumber(value))))].join(", ")}`, "lost");
  element.append(head);
  parent.append(element);
  const fixed = { destroy: () => element.remove(), size() {}, cursor() {}, draw() {}, height: FOLDED, head };
  if (!curves.some(({ values }) => values.some(isNumber))) {
    remark(lost.length ? "" : "it was written in no period", "lost");
    return fixed;
  }
  if (folds && isFlat(curves)) {
    element.classList.add("folded");
    remark(`${curves.map(({ name, values }) => `${curves.length > 1 ? `${name} ` : ""}${number(values[0], of)}`).join(", ")} in ${x.length === 1 ? "the period" : "every period"}${lines.map(({ text }) => `; ${text}`).join("")}`);
    return fixed;
  }
  const at = Object.assign(document.createElement("output"), { className: "at" });
  head.append(" ", at);
  place ??= (i) => `${across} ${number(x[i], unit)}`;
  const said = (i) => `${place(i)}: ${curves.map((curve) => `${curves.length > 1 ? `${curve.name} ` : ""}${number(curve.values[i], curve.unit)}`).join(", ")}`;
  const width = () => Math.max(220, parent.clientWidth - 8);
  const range = (_, low, high) => {
    const [a, b] = levels.reduce(([a, b], { at }) => [Math.min(a, at), Math.max(b, at)], [low, high]);
    const gap = (b - a || Math.abs(a) || 1) * 0.06;
    return [a - gap, b + gap];
  };
  // Axes of one width, where the values permit it: the times of all charts stand below one another.
  const size = (_, values) => Math.ceil(Math.max(30, ...(values ?? []).map(widthOf))) + 12;
  const isTiny = curves.every(({ values }) => values.every((value) => !isNumber(value) || Math.abs(value) < TINY));
  // The first curve on top: an output over the inputs and references that follow it.
  const drawn = curves.map((curve, i) => ({ ...curve, i })).reverse(), ghosts = drawn.filter(({ before }) => before);
  const stepped = uPlot.paths.stepped({ align: 1 });
  const column = (values) => x.map((_, i) => (isNumber(values[i]) ? values[i] : null));
  const plot = new uPlot({
    width: width(), height: height(), padding: [6, 18, 0, 0], scales: { x: { time: false, range: (_, from, to) => [from, unit && x.length > 1 ? to + x[1] - x[0] : to] }, y: { range } },
    axes: [{ ...axis, values: ticks(false), ...(label && { label: unit ? `${label}, ${unit}` : label }), size: 26 }, { ...axis, label: of ?? " ", size, space: 22, ...(whole && { incrs: WHOLE }), values: ticks(isTiny) }],
    legend: { show: false }, cursor: { y: false, ...(sync && { sync: { key: sync } }), points: { size: 7 }, drag: { x: true, y: false } },
    series: [{}, ...ghosts.map(({ i, ...curve }) => ({ stroke: `${look[i].colour}${style("--pale")}`, width: 1.6, points: { show: false }, pxAlign: 0, ...(curve.stepped && { paths: stepped, stepped: true }) })), ...drawn.map(({ i, ...curve }) => ({
      label: curve.name, stroke: look[i].colour, width: curve.given && !curves.every((one) => one.given) ? 1.1 : 1.6, dash: look[i].dash, pxAlign: 0, points: { show: true, filter: () => x.length < 40 || curve.points ? null : alone(curve.values), size: curve.points ? 6 : 4, fill: look[i].colour },
      ...(curve.points && { paths: () => null, single: true }), ...(curve.stepped && { paths: stepped, stepped: true }),
    }))],
    hooks: { setCursor: [({ cursor: { idx } }) => (at.textContent = idx === null || idx === undefined ? "" : said(idx))], draw: [(plot) => mark(plot.ctx, plot, { x, levels, lost, saturated, moments })] },
  }, [x, ...ghosts.map(({ before }) => column(before)), ...drawn.map(({ values }) => column(values))], element);
  let down = 0;
  plot.over.addEventListener("mousedown", (event) => (down = event.clientX));
  // A finger has no pointer above the chart: where it touches or moves, the values are told.
  for (const kind of ["pointerdown", "pointermove"]) plot.over.addEventListener(kind, (event) => event.pointerType === "touch" && plot.setCursor({ left: event.clientX - plot.over.getBoundingClientRect().left, top: plot.over.clientHeight / 2 }, true, true));
  // A click or a tap, not the end of a drag, which zooms.
  if (picked) {
    let waits;
    plot.over.addEventListener("dblclick", () => clearTimeout(waits));
    plot.over.addEventListener("click", ({ clientX, detail }) => {
      const { idx } = plot.cursor;
      clearTimeout(waits);
      if (detail > 1 || Math.abs(clientX - down) >= 3 || idx === null || idx === undefined) return;
      // A second click would end the zoom.
      waits = setTimeout(() => picked(idx), DOUBLE);
    });
  }
  const resize = () => parent.clientWidth && plot.setSize({ width: width(), height: height() });
  const observer = new ResizeObserver(resize);
  observer.observe(parent);
  return {
    destroy: () => (observer.disconnect(), plot.destroy(), element.remove()), size: resize, head,
    cursor: (index) => plot.setCursor({ left: plot.valToPos(x[index], "x"), top: plot.bbox.height / devicePixelRatio / 2 }),
    get height() {
      return FOLDED + plot.height;
    },
    /** Draws the chart with a pen, for a file. */
    draw(pen) {
      pen.axes(plot, axis);
      pen.curves(plot);
      mark(pen, plot, { x, levels, lost, saturated, moments });
    },
  };
}

/** Draws levels and moments as lines, and marks periods with saturated or non-finite values. */
function mark(ctx, plot, { x, levels, lost, saturated, moments }) {
  const { left, top, width, height } = plot.bbox, ratio = devicePixelRatio || 1;
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
  for (const index of moments) {
    if (!(index < x.length)) continue;
    const at = plot.valToPos(x[index] - half, "x", true);
    if (at < left || at > left + width) continue;
    ctx.lineWidth = 1.2 * ratio;
    ctx.strokeStyle = style("--accent");
    ctx.setLineDash([2 * ratio, 3 * ratio]);
    ctx.beginPath();
    ctx.moveTo(at, top);
    ctx.lineTo(at, top + height);
    ctx.stroke();
  }
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

/** Ports that are chosen together, as names and keys: the elements of an array (`y[3]`, `A{i}{j}`), or a port alone. */
function arrays(facts) {
  const found = new Map();
  for (const [key, { name, together }] of facts) {
    const base = /^([^,[{]+)[[{][^,]*$/.exec(together ?? "")?.[1].trim(), array = base && name.startsWith(base) ? base : name;
    found.set(array, [...(found.get(array) ?? []), key]);
  }
  return [...found].map(([array, keys]) => [keys.length > 1 ? array : facts.get(keys[0]).name, keys]);
}

/** Largest component of `A·x - b` in each period; `null` where the program says that there is no solution. `ports`: names of `A`, `x`, `b`, and of that output. */
function residual({ inputs, outputs, cycles }, [matrix, solution, right, none]) {
  const size = Object.keys(outputs).filter((name) => name.startsWith(solution)).length, all = Array.from({ length: size }, (_, i) => i + 1);
  const row = (period) => (i) => Math.abs(all.reduce((sum, j) => sum + inputs[`${matrix}${i}${j}`][period] * outputs[`${solution}${j}`][period], 0) - inputs[`${right}${i}`][period]);
  return cycles.map((_, period) => (outputs[none][period] ? null : Math.max(...all.map(row(period)))));
}

/** Values of input ports that nobody gives. */
const rest = ({ resting }) => ["0", ...Object.entries(resting).map(([name, value]) => `${name} ${short(value)} (of its .range nearest to 0)`)].join(", but ");

export class Plots {
  /** `mark`: parameters that change during the run (`changes`), the period from which their sliders act (`from`), and what hears of another (`picked`).
   * @param lead where the first chart goes on a telephone, beside the sliders
   * @param tools controls: `axis` (periods, ms or s), `length` (of a period, in ms), `together` (curves over one axis: by unit, or each alone) */
  constructor(parent, choice, lead, tools) {
    Object.assign(this, { parent, choice, lead, tools, charts: [], chosen: new Map(), choices: new Map() });
    tools.axis.addEventListener("change", () => (this.axis = tools.axis.value));
    tools.length.addEventListener("change", () => (this.length = Number(tools.length.value) / 1e3));
    for (const one of Object.values(tools)) one.addEventListener("change", () => this.draw());
    this.narrow = matchMedia(`(max-width: ${NARROW}px)`);
    this.narrow.addEventListener("change", () => this.draw());
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw());
    new ResizeObserver(() => this.size()).observe(parent.parentElement);
  }

  /** Forgets everything about the text before, and shows `why`. `of`: key of the text, whose choice of ports comes back. */
  clear(why, of) {
    this.chosen = this.choices.get(of) ?? new Map();
    this.choices.set(of, this.chosen);
    Object.assign(this, { before: null, axis: undefined, length: undefined, asked: false });
    this.show(null, null, why);
  }

  /** Keeps the run for comparison: it is drawn pale behind the next. `with`: what differs. */
  keep(differs) {
    if (this.run) this.before = { ...this.run, differs };
  }

  /** Shows a run: columns of inputs and outputs by name, and cycles. Units and limits come from the program. Without a run, shows `why`: a text, or a function that gives the nodes. */
  show(run, program, why = "") {
    Object.assign(this, { run, program, why });
    // In declaration order.
    const list = (kind, ports) => (ports ?? []).map((port) => [`${kind} ${port.name}`, port]);
    this.facts = new Map(run ? [...list("out", program?.outputs), ...list("in", program?.inputs)] : []);
    const first = this.initial();
    for (const key of this.facts.keys()) this.chosen.set(key, this.chosen.get(key) ?? first.has(key));
    const offers = arrays(this.facts).map(([name, keys]) => {
      const label = document.createElement("label"), box = document.createElement("input"), shown = keys.filter((key) => this.chosen.get(key)).length;
      box.type = "checkbox";
      box.checked = shown === keys.length;
      box.indeterminate = shown > 0 && !box.checked;
      box.addEventListener("change", () => {
        for (const key of keys) this.chosen.set(key, box.checked);
        this.draw();
      });
      const notes = [...(keys[0].startsWith("in ") ? ["in"] : []), ...(keys.length > 1 ? [keys.length] : [])];
      label.append(box, ` ${name}${notes.length ? ` (${notes.join(", ")})` : ""}`);
      return { label, shown };
    });
    const rest = offers.length > OFFERED && !this.asked ? offers.filter(({ shown }) => !shown) : [];
    const more = Object.assign(document.createElement("button"), { type: "button", textContent: `${plural(rest.length, "more port")}`, onclick: () => {
      this.asked = true;
      for (const { label } of rest) label.hidden = false;
      more.remove();
    } });
    for (const { label } of rest) label.hidden = true;
    this.choice.replaceChildren(...offers.map(({ label }) => label), ...(rest.length ? [more] : []));
    this.draw();
  }

  /** Curves that are shown initially: some outputs, every port with its reference (`w` and `w_ref`), what a plant gives first, and inputs that are few. */
  initial() {
    const { plants, plant, plotted } = this.program ?? {};
    const keys = [...this.facts.keys()], outputs = keys.filter((key) => key.startsWith("out "));
    const paired = keys.filter((key) => {
      const name = this.facts.get(key).name, is = (other) => keys.some((key) => this.facts.get(key).name === other);
      return isReference(name) ? is(name.slice(0, -4)) : is(`${name}_ref`);
    });
    if (plotted) return new Set(keys.filter((key) => plotted.includes(this.facts.get(key).name)));
    const gives = plants?.find(({ name }) => name === plant?.name)?.gives ?? [];
    const shown = new Set([...outputs.slice(0, SHOWN), ...paired]);
    for (const key of keys.filter((key) => key.startsWith("in ") && gives.includes(this.facts.get(key).name))) if (shown.size < SHOWN) shown.add(key);
    const inputs = keys.filter((key) => key.startsWith("in "));
    if (inputs.length <= FEW) for (const key of inputs) shown.add(key);
    return shown;
  }

  /** Height of a chart: the charts fill the panel, unless there are too many. */
  height(count, folded) {
    // A telephone's panel is as tall as its content: the charts do not follow it.
    if (this.narrow.matches) return Math.round(TALL_NARROW * this.parent.parentElement.clientWidth);
    const panel = this.parent.parentElement, above = this.parent.offsetTop - panel.offsetTop;
    // Space for a chart's title, and the gap below it.
    const room = (panel.clientHeight - above - 16 - folded * FOLDED) / Math.max(1, count) - 32;
    return Math.round(Math.min(HIGH, TALL * panel.clientWidth, Math.max(LOW, room)));
  }

  size() {
    for (const one of this.charts) one.size();
  }

  /** Time of a period in seconds, if it is known. */
  get seconds() {
    const known = this.length ?? this.program?.sampling_period;
    return known > 0 ? known : undefined;
  }

  /** Abscissa: periods, or the times at which they begin. */
  abscissa() {
    const { run, seconds, tools } = this, length = run.cycles.length;
    const unit = !seconds ? "periods" : this.axis ?? (seconds * length <= BRIEF ? "ms" : "s");
    tools.axis.value = unit;
    for (const option of tools.axis.options) option.disabled = !seconds && option.value !== "periods";
    tools.length.value = seconds ? Number((seconds * 1e3).toPrecision(6)) : "";
    if (unit === "periods") return { x: run.cycles.map((_, i) => i + 1), name: "period", label: "period" };
    const step = unit === "ms" ? seconds * 1e3 : seconds, x = run.cycles.map((_, i) => i * step);
    return { x, name: "time", label: "time", unit, place: (i) => `period ${i + 1}, ${number(x[i], unit)}` };
  }

  /** The chosen curves, those of each chart together. */
  groups() {
    const { run, before, tools } = this, groups = new Map();
    for (const [key, { name, unit, limit, together, type }] of this.facts) {
      if (!this.chosen.get(key)) continue;
      const kind = key.startsWith("out ") ? "outputs" : "inputs", old = before?.[kind][name];
      const curve = { name, unit, limit, whole: type === "int", given: kind === "inputs", points: this.program.points, values: run[kind][name] ?? [], ...(old && { before: old }) };
      // Ports with a unit share the axis with others of that unit; those without, with what is declared beside them.
      let group = tools.together.value === "each" ? key : unit ?? `${kind}: ${together}`;
      while (groups.get(group)?.length >= TOGETHER) group += " more";
      groups.set(group, [...(groups.get(group) ?? []), curve]);
    }
    for (const curves of groups.values()) curves.sort((a, b) => isReference(a.name) - isReference(b.name));
    // First what follows a reference: whether it does is what one looks for.
    const follows = (curves) => curves.some(({ name }) => isReference(name));
    return [...groups.values()].sort((a, b) => follows(b) - follows(a));
  }

  draw() {
    // The page keeps its height meanwhile, or it would scroll away from under a finger on a slider.
    for (const box of [this.parent, this.lead]) {
      box.style.minHeight = `${box.offsetHeight}px`;
      requestAnimationFrame(() => (box.style.minHeight = ""));
    }
    for (const one of this.charts) one.destroy();
    this.charts = [];
    this.parent.replaceChildren();
    this.lead.replaceChildren();
    const { run, program, before, tools } = this;
    const say = (why) => {
      if (!why) return;
      const box = Object.assign(document.createElement("p"), { className: "why" });
      box.append(...(typeof why === "function" ? why() : [why]));
      this.parent.append(box);
    };
    tools.axis.closest(".tools").hidden = !run?.cycles.length;
    if (!run) return say(this.why);
    if (!this.parent.clientWidth) return;
    if (!run.cycles.length) return say("There is nothing to plot over periods: the program has run through no period.");
    say(this.silence());
    const ghost = Object.assign(document.createElement(this.narrow.matches ? "p" : "span"), { className: "ghost", textContent: before ? `pale: before, with ${before.differs}` : "" });
    if (before && this.narrow.matches) this.parent.append(ghost);
    const cycles = [{ name: "cycles", values: run.cycles, stepped: true, ...(before && { before: before.cycles }) }];
    const checks = program.residual && run.inputs[`${program.residual[0]}11`] ? [{ curves: [{ name: "largest |A·x − b|", points: true, values: residual(run, program.residual) }] }] : [];
    const all = [...checks, ...this.groups().map((curves) => ({ curves })), { curves: cycles, lines: this.levels() }];
    const { label, ...common } = this.abscissa(), open = all.filter(({ curves }) => !isFlat(curves)), last = open.at(-1);
    const height = () => this.height(open.length, all.length - open.length);
    const { from, changes, picked } = this.mark ?? { changes: [] }, moments = [...new Set([...changes.map(({ period }) => period), ...(from > 1 ? [from] : [])])].map((period) => period - 1);
    for (const one of all) this.charts.push(chart(this.narrow.matches && one === open[0] ? this.lead : this.parent, { ...one, ...common, ...(one === last && { label }), height, sync: "ports", folds: true, moments, picked: picked && ((index) => picked(index + 1)) }));
    // Beside a heading it moves no curve.
    if (before && !this.narrow.matches) this.charts[0].head.append(" ", ghost);
  }

  /** What to say if inputs are 0 because nobody gives them. */
  silence() {
    const { plants, plant, plant_error: broken, inputs, rows, blank, inputs_of_others: others } = this.program;
    if (broken) return `The loop is open, and its inputs are 0: ${broken}.`;
    const here = plants.find(({ name }) => name === plant?.name), driven = [...(here?.gives ?? []), ...(here?.states ?? [])], silent = inputs.filter(({ name }) => !driven.includes(name));
    if (!silent.length || (rows && !blank && !others)) return "";
    const count = silent.length, those = driven.length ? silent.map(({ name }) => name).join(", ") : count === 1 ? "the input port" : `all ${count} input ports`;
    return `There are no inputs${driven.length ? " but the plant's" : ""}: ${those} ${count === 1 ? "is" : "are"} ${driven.length ? 0 : rest(this.program)} in every period. The tab Inputs takes a table.`;
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

  /** The run as a table: all ports and the cycles, a row for each period. The input table of the same program can be taken from it. */
  csv() {
    const { run, seconds } = this;
    const columns = [...this.facts].map(([key, { name }]) => [name, run[key.startsWith("out ") ? "outputs" : "inputs"][name] ?? []]);
    const head = ["period", ...(seconds ? ["time_s"] : []), ...columns.map(([name]) => name), "cycles"];
    const row = (cycles, i) => [i + 1, ...(seconds ? [Number((i * seconds).toPrecision(12))] : []), ...columns.map(([, values]) => values[i] ?? ""), cycles];
    return `${[head, ...run.cycles.map(row)].map((cells) => cells.join(",")).join("\n")}\n`;
  }

  /** The charts as a drawing. */
  svg() {
    return drawing(this.charts, { width: this.parent.clientWidth, ground: style("--bg"), text: style("--fg"), pen: () => new Pen() });
  }
}
