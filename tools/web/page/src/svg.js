// Charts as SVG: the scales and ticks of uPlot's canvas, drawn as shapes.

const escape = (text) => String(text).replace(/[&<>"]/g, (one) => `&#${one.charCodeAt(0)};`);
const round = (value) => Math.round(value * 100) / 100;
const attributes = (set) => Object.entries(set).map(([name, value]) => ` ${name}="${escape(value)}"`).join("");

/** Collects shapes, with the part of a canvas' interface that charts use; lengths are in the canvas' pixels. */
export class Pen {
  constructor() {
    Object.assign(this, { parts: [], path: "", dash: [], globalAlpha: 1, lineWidth: 1 });
  }

  save() {}

  restore() {}

  put(name, set, content) {
    this.parts.push(content === undefined ? `<${name}${attributes(set)}/>` : `<${name}${attributes(set)}>${escape(content)}</${name}>`);
  }

  fillRect(x, y, width, height) {
    this.put("rect", { x: round(x), y: round(y), width: round(width), height: round(height), fill: this.fillStyle, "fill-opacity": this.globalAlpha });
  }

  beginPath() {
    this.path = "";
  }

  moveTo(x, y) {
    this.path += `M${round(x)} ${round(y)}`;
  }

  lineTo(x, y) {
    this.path += `L${round(x)} ${round(y)}`;
  }

  setLineDash(dash) {
    this.dash = dash;
  }

  stroke() {
    if (this.path) this.put("path", { d: this.path, fill: "none", stroke: this.strokeStyle, "stroke-width": this.lineWidth, ...(this.dash.length && { "stroke-dasharray": this.dash.join(" ") }) });
  }

  measureText(text) {
    this.measuring ??= document.createElement("canvas").getContext("2d");
    this.measuring.font = this.font;
    return this.measuring.measureText(text);
  }

  text(text, x, y, set) {
    this.put("text", { x: round(x), y: round(y), "font-size": parseFloat(this.font), "text-anchor": { right: "end", center: "middle" }[this.textAlign] ?? "start", ...set }, text);
  }

  strokeText(text, x, y) {
    this.text(text, x, y, { fill: "none", stroke: this.strokeStyle, "stroke-width": this.lineWidth, "stroke-linejoin": "round" });
  }

  fillText(text, x, y) {
    this.text(text, x, y, { fill: this.fillStyle });
  }

  /** Grid, ticks and labels of a plot. */
  axes(plot, { stroke, grid, font }) {
    const { left, top, width, height } = plot.bbox, ratio = devicePixelRatio || 1, size = parseFloat(font) * ratio;
    Object.assign(this, { font: `${size}px`, fillStyle: stroke, strokeStyle: grid.stroke, lineWidth: grid.width * ratio, textAlign: "center" });
    const line = (...points) => (this.beginPath(), points.forEach(([x, y], i) => (i ? this.lineTo(x, y) : this.moveTo(x, y))), this.stroke());
    const [across, up] = plot.axes;
    across._splits.forEach((value, i) => {
      const x = plot.valToPos(value, "x", true);
      line([x, top], [x, top + height + 4 * ratio]);
      this.fillText(across._values[i] ?? "", x, top + height + 6 * ratio + size);
    });
    if (across.label) this.fillText(across.label, left + width / 2, plot.height * ratio - 4 * ratio);
    this.textAlign = "right";
    up._splits.forEach((value, i) => {
      const y = plot.valToPos(value, "y", true);
      line([left - 4 * ratio, y], [left + width, y]);
      this.fillText(up._values[i] ?? "", left - 7 * ratio, y + 0.35 * size);
    });
    this.textAlign = "center";
    if (up.label) this.text(up.label, 0, 0, { fill: stroke, transform: `translate(${size},${round(top + height / 2)}) rotate(-90)` });
  }

  /** Curves of a plot, with gaps where there is no number. */
  curves(plot) {
    const ratio = devicePixelRatio || 1;
    plot.series.slice(1).forEach((series, i) => {
      const values = plot.data[i + 1], { stepped, single } = series;
      Object.assign(this, { strokeStyle: series.stroke(), fillStyle: series.stroke(), lineWidth: series.width * ratio });
      this.setLineDash((series.dash ?? []).map((one) => one * ratio));
      this.beginPath();
      let last = null;
      plot.data[0].forEach((value, j) => {
        if (values[j] === null) return (last = null);
        const x = plot.valToPos(value, "x", true), y = plot.valToPos(values[j], "y", true);
        if (last === null || single) this.moveTo(x, y);
        else {
          if (stepped) this.lineTo(x, last);
          this.lineTo(x, y);
        }
        if (single || (last === null && (values[j + 1] ?? null) === null)) this.fillRect(x - 2 * ratio, y - 2 * ratio, 4 * ratio, 4 * ratio);
        last = y;
      });
      this.stroke();
      this.setLineDash([]);
    });
  }
}

/** Short lines as text, by the style of a curve. */
const LINES = { solid: "—", dashed: "╌", dotted: "┈" };

/** A chart's heading: its texts in their colours, and a line in the style of each curve before the name. */
function heading(head) {
  const line = ({ borderTopStyle, borderTopColor }) => `<tspan fill="${escape(borderTopColor)}">${LINES[borderTopStyle] ?? "—"} </tspan>`;
  const part = (node) => ({ I: node.style && line(node.style), SPAN: node.nodeType === 1 && `<tspan fill="${escape(getComputedStyle(node).color)}">${escape(node.textContent)}</tspan>`, B: `<tspan font-weight="600">${escape(node.textContent)}</tspan>`, OUTPUT: "" })[node.nodeName] ?? escape(node.textContent);
  return [...head.childNodes].map(part).join("");
}

/** An SVG file of charts, one below another, each with its heading. */
export function drawing(charts, { width, ground, text, pen }) {
  const title = 22, parts = [];
  let y = 6;
  for (const chart of charts) {
    const drawn = pen();
    chart.draw(drawn);
    parts.push(`<text x="8" y="${y + 13}" font-size="12" fill="${text}">${heading(chart.head)}</text>`);
    parts.push(`<g transform="translate(0,${y + title}) scale(${1 / (devicePixelRatio || 1)})">${drawn.parts.join("")}</g>`);
    y += chart.height;
  }
  return `<svg xmlns="http://www.w3.org/2000/svg" width="${width}" height="${y}" viewBox="0 0 ${width} ${y}" font-family="system-ui, sans-serif"><rect width="100%" height="100%" fill="${ground}"/>${parts.join("")}</svg>\n`;
}
