// Curves over a common axis, in one lane for each unit: drawn on a canvas, with a cursor, and zoomed by dragging.
import { COLOURS, node } from "./parts.js";

/** Height of a lane in pixels: fewest and most. */
const LOW = 96, HIGH = 190;
/** Space for the values of the axes, and for those of the abscissa. */
const LEFT = 58, BOTTOM = 34, TOP = 8, RIGHT = 10;
const FONT = "11px system-ui, sans-serif";

const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
export const text = (value) => (typeof value === "number" ? String(+value.toPrecision(6)) : value ?? "no value");

/** Round distance of ticks, so that about `count` lie in the range. */
function distance(range, count) {
  const raw = range / Math.max(1, count), power = 10 ** Math.floor(Math.log10(raw)), part = raw / power;
  return power * (part < 1.5 ? 1 : part < 3.5 ? 2 : part < 7.5 ? 5 : 10);
}

function ticks(low, high, count) {
  const step = distance(high - low, count), found = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + step * 1e-9; i++) found.push(i * step);
  return { found, digits: Math.max(0, -Math.floor(Math.log10(step) + 1e-9)) };
}

const tickText = (value, digits) => (Math.abs(value) >= 1e6 || (digits > 6 && value !== 0) ? value.toExponential(1) : value.toFixed(Math.min(digits, 8)));

/** Curves of one unit share a lane; without a unit, a reference `x_ref` shares that of `x`. */
function lanesOf(curves) {
  const lanes = new Map();
  for (const curve of curves) {
    const key = curve.unit ? `unit ${curve.unit}` : `name ${curve.name.replace(/_ref$/, "")}`;
    if (!lanes.has(key)) lanes.set(key, []);
    lanes.get(key).push(curve);
  }
  return [...lanes.values()];
}

export class Chart {
  /** @param box element that the chart fills */
  constructor(box) {
    this.box = box;
    this.legend = node("p", { className: "legend" });
    this.canvas = node("canvas", { tabIndex: 0, ariaLabel: "Curves: drag to zoom, a double click or 0 shows all, arrows move the cursor" });
    this.canvas.setAttribute("role", "img");
    box.append(this.legend, this.canvas);
    this.data = { x: [], curves: [] };
    this.zoom = null;
    this.at = null;
    new ResizeObserver(() => this.draw()).observe(box);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw());
    this.canvas.addEventListener("pointermove", (event) => this.moved(event));
    this.canvas.addEventListener("pointerleave", () => ((this.at = null), this.draw()));
    this.canvas.addEventListener("pointerdown", (event) => {
      if (event.pointerType === "touch") return this.moved(event);
      this.from = this.xOf(event);
      this.canvas.setPointerCapture(event.pointerId);
    });
    this.canvas.addEventListener("pointerup", (event) => this.released(event));
    this.canvas.addEventListener("dblclick", () => ((this.zoom = null), this.draw()));
    this.canvas.addEventListener("keydown", (event) => this.key(event));
  }

  /**
   * Shows curves. `x`: ascending numbers; `label`: of the axis; `curves`: each with `name`, `unit`, `values` (numbers, null, or words such as
   * "NaN") and `stepped`; `marks`: places on the axis; `range`: ends of the axis, if not those of `x`;
   * `dots`: mark samples where they are few.
   */
  show(data) {
    if (data.curves.map(({ name }) => name).join() !== this.data.curves.map(({ name }) => name).join()) this.zoom = null;
    this.data = data;
    this.lanes = lanesOf(data.curves);
    this.draw();
  }

  get span() {
    const { x, range } = this.data;
    const [low, high] = this.zoom ?? range ?? [x[0] ?? 0, x.at(-1) ?? 1];
    return high > low ? [low, high] : [low - 0.5, low + 0.5];
  }

  xOf(event) {
    const box = this.canvas.getBoundingClientRect(), [low, high] = this.span;
    const part = (event.clientX - box.left - LEFT) / Math.max(1, box.width - LEFT - RIGHT);
    return low + Math.min(1, Math.max(0, part)) * (high - low);
  }

  /** Index of the sample next to a place on the axis. */
  near(place) {
    const { x } = this.data;
    let [a, b] = [0, x.length - 1];
    while (b - a > 1) {
      const middle = (a + b) >> 1;
      if (x[middle] < place) a = middle;
      else b = middle;
    }
    return Math.abs(x[a] - place) <= Math.abs((x[b] ?? Infinity) - place) ? a : b;
  }

  moved(event) {
    if (!this.data.x.length) return;
    this.at = this.near(this.xOf(event));
    this.to = this.from === undefined ? undefined : this.xOf(event);
    this.draw();
  }

  released(event) {
    const { from } = this, to = this.xOf(event);
    this.from = this.to = undefined;
    if (from === undefined) return;
    const [low, high] = this.span;
    if (Math.abs(to - from) > (high - low) * 0.02) this.zoom = [Math.min(from, to), Math.max(from, to)];
    this.draw();
  }

  key(event) {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (event.key === "0") this.zoom = null;
    else if (step && this.data.x.length) this.at = Math.min(this.data.x.length - 1, Math.max(0, (this.at ?? this.data.x.length) + step));
    else return;
    event.preventDefault();
    this.draw();
  }

  draw() {
    const { x, curves, label, marks = [] } = this.data, { canvas } = this;
    this.box.classList.toggle("empty", !curves.length);
    if (!curves.length) return;
    this.describe();
    const lanes = this.lanes, width = this.box.clientWidth;
    const lane = Math.round(Math.min(HIGH, Math.max(LOW, 420 / lanes.length))), height = lane * lanes.length + BOTTOM;
    const scale = devicePixelRatio;
    canvas.style.height = `${height}px`;
    if (canvas.width !== Math.round(width * scale) || canvas.height !== Math.round(height * scale)) Object.assign(canvas, { width: Math.round(width * scale), height: Math.round(height * scale) });
    const pen = canvas.getContext("2d");
    pen.setTransform(scale, 0, 0, scale, 0, 0);
    pen.clearRect(0, 0, width, height);
    pen.font = FONT;
    const [low, high] = this.span, inner = width - LEFT - RIGHT;
    const across = (value) => LEFT + ((value - low) / (high - low)) * inner;
    const colours = { edge: style("--edge"), dim: style("--dim"), select: style("--select"), mark: style("--limit") };

    const bottom = lane * lanes.length, grid = ticks(low, high, inner / 90);
    pen.textAlign = "center";
    pen.textBaseline = "top";
    pen.lineWidth = 0.5;
    pen.fillStyle = colours.dim;
    for (const at of grid.found) {
      pen.strokeStyle = colours.edge;
      pen.beginPath();
      pen.moveTo(across(at), TOP);
      pen.lineTo(across(at), bottom);
      pen.stroke();
      pen.fillText(tickText(at, grid.digits), across(at), bottom + 4);
    }
    pen.textAlign = "right";
    pen.fillText(label, width - RIGHT, bottom + 19);

    lanes.forEach((own, i) => this.lane(pen, own, i * lane + TOP, (i + 1) * lane - 6, { across, colours, width }));

    for (const mark of marks) this.line(pen, across(mark), bottom, colours.mark, [4, 3]);
    if (this.at !== null && x[this.at] !== undefined) this.line(pen, across(x[this.at]), bottom, colours.dim, []);
    if (this.from !== undefined && this.to !== undefined) {
      pen.globalAlpha = 0.4;
      pen.fillStyle = colours.select;
      pen.fillRect(across(Math.min(this.from, this.to)), TOP, Math.abs(across(this.to) - across(this.from)), bottom - TOP);
      pen.globalAlpha = 1;
    }
  }

  line(pen, at, bottom, colour, dash) {
    if (at < LEFT - 1 || at > this.box.clientWidth) return;
    pen.save();
    pen.setLineDash(dash);
    Object.assign(pen, { strokeStyle: colour, lineWidth: 1 });
    pen.beginPath();
    pen.moveTo(at, TOP);
    pen.lineTo(at, bottom);
    pen.stroke();
    pen.restore();
  }

  lane(pen, curves, top, bottom, { across, colours, width }) {
    const { x } = this.data, [from, to] = this.span;
    // A sample on either side, so that lines reach the edges.
    const first = Math.max(0, this.near(from) - 1), last = Math.min(x.length - 1, this.near(to) + 1);
    let [low, high] = [Infinity, -Infinity];
    for (const { values } of curves) {
      for (let i = first; i <= last; i++) {
        if (typeof values[i] !== "number") continue;
        low = Math.min(low, values[i]);
        high = Math.max(high, values[i]);
      }
    }
    if (!Number.isFinite(low)) [low, high] = [0, 1];
    const gap = (high - low || Math.abs(high) || 1) * (high > low ? 0.08 : 0.5);
    [low, high] = [low - gap, high + gap];
    const up = (value) => bottom - ((value - low) / (high - low)) * (bottom - top);
    const grid = ticks(low, high, (bottom - top) / 34);
    pen.textBaseline = "middle";
    pen.textAlign = "right";
    for (const at of grid.found) {
      pen.strokeStyle = colours.edge;
      pen.lineWidth = 0.5;
      pen.beginPath();
      pen.moveTo(LEFT, up(at));
      pen.lineTo(width - RIGHT, up(at));
      pen.stroke();
      pen.fillStyle = colours.dim;
      pen.fillText(tickText(at, grid.digits), LEFT - 6, up(at));
    }
    pen.save();
    pen.beginPath();
    pen.rect(LEFT, top - 2, width - LEFT - RIGHT, bottom - top + 4);
    pen.clip();
    for (const { values, stepped, colour } of curves) {
      Object.assign(pen, { strokeStyle: colour, fillStyle: colour, lineWidth: 1.5, lineJoin: "round" });
      pen.beginPath();
      let before = null;
      for (let i = first; i <= last; i++) {
        const value = values[i];
        if (typeof value !== "number") {
          before = null;
          continue;
        }
        const [h, v] = [across(x[i]), up(value)];
        if (before === null) pen.moveTo(h, v);
        else {
          if (stepped) pen.lineTo(h, before);
          pen.lineTo(h, v);
        }
        before = v;
      }
      pen.stroke();
      // Few samples are drawn as such.
      if (this.data.dots && last - first < (width - LEFT) / 14) for (let i = first; i <= last; i++) if (typeof values[i] === "number") pen.fillRect(across(x[i]) - 2, up(values[i]) - 2, 4, 4);
    }
    pen.restore();
  }

  /** Names, colours, and the values under the cursor, or the last ones. */
  describe() {
    const { x, curves, place = String } = this.data, at = this.at ?? x.length - 1;
    this.legend.replaceChildren(...curves.map(({ name, unit, values, colour }) => {
      const swatch = node("i");
      swatch.style.borderTop = `2px solid ${colour}`;
      return node("span", {}, swatch, node("b", { textContent: name }), ` ${text(values[at])}${unit ? ` ${unit}` : ""}`);
    }), node("span", { className: "where", textContent: this.at !== null && x[at] !== undefined ? place(at) : "" }));
  }
}

/** Colours of curves by name: a name keeps the place among the colours that it had first. */
export class Colours {
  known = new Map();

  of(name) {
    if (!this.known.has(name)) this.known.set(name, this.known.size);
    return colour(this.known.get(name));
  }
}
