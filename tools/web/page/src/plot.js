// Values of ports over the periods.
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";

const COLOURS = ["#2f6fbf", "#d9534f", "#5aa469", "#b07cd8", "#f2a33a", "#26a0a8", "#a3156b", "#8d6e63"];
/** Curves that are shown at first. */
const SHOWN = 4;

const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

export function chart(parent, { title, x, label, curves, height = 190 }) {
  const axis = { stroke: style("--dim"), grid: { stroke: style("--edge"), width: 0.5 }, ticks: { stroke: style("--edge"), width: 0.5 } };
  const element = document.createElement("div");
  element.className = "chart";
  parent.append(element);
  const width = () => Math.max(240, parent.clientWidth - 8);
  const plot = new uPlot({
    title, width: width(), height, scales: { x: { time: false } }, axes: [axis, { ...axis, size: 64, space: 24 }],
    series: [{ label }, ...curves.map(({ name, values, stepped }, i) => ({
      label: name, stroke: COLOURS[i % COLOURS.length], width: 1.4, points: { show: values.length < 40 },
      ...(stepped && { paths: uPlot.paths.stepped({ align: 1 }) }),
    }))],
  }, [x, ...curves.map((curve) => curve.values)], element);
  const observer = new ResizeObserver(() => parent.clientWidth && plot.setSize({ width: width(), height }));
  observer.observe(parent);
  return { destroy: () => (observer.disconnect(), plot.destroy(), element.remove()) };
}

export class Plots {
  constructor(parent, choice) {
    Object.assign(this, { parent, choice, charts: [], chosen: new Map() });
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw());
  }

  /** Shows a run: columns of inputs and outputs by name, and cycles. */
  show(run) {
    this.run = run;
    const ports = [...Object.keys(run.outputs).map((name) => ["out", name]), ...Object.keys(run.inputs).map((name) => ["in", name])];
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

  draw() {
    for (const one of this.charts) one.destroy();
    this.charts = [];
    const { run } = this;
    if (!run?.cycles.length || !this.parent.clientWidth) return;
    const x = run.cycles.map((_, i) => i + 1);
    const of = (kind, columns) => Object.entries(columns).filter(([name]) => this.chosen.get(`${kind} ${name}`)).map(([name, values]) => ({ name, values }));
    for (const curve of [...of("out", run.outputs), ...of("in", run.inputs)]) {
      this.charts.push(chart(this.parent, { x, label: "period", curves: [curve], height: 140 }));
    }
    this.charts.push(chart(this.parent, { x, label: "period", curves: [{ name: "cycles", values: run.cycles, stepped: true }], height: 120 }));
  }
}
