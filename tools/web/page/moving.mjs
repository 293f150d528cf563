// Moving pictures of the README, beside one another: `node moving.mjs TAKT.WASM FOLDER/loop.svg`. The example's equations, its cycles, and
// the loop with its motor while a gain moves; every curve is a run of the module. They last ten seconds, and stand complete where nothing
// moves.
import { readFileSync, writeFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { asking } from "./ask.mjs";
import { collect, shipped } from "./src/collect.js";

/**
 * Layouts in pixels: as wide as a telephone's screen, so that the type keeps its size there; as wide as GitHub's column, with the curve
 * beside the text. Size; left, right, top and bottom edge of the curves; place of the curves' title; width of the text.
 */
const LAYOUTS = {
  "loop.svg": { WIDTH: 440, HEIGHT: 440, LEFT: 40, RIGHT: 12, TOP: 232, BOTTOM: 34, title: [16, 214], column: 440 },
  "loop-wide.svg": { WIDTH: 846, HEIGHT: 240, LEFT: 474, RIGHT: 16, TOP: 46, BOTTOM: 32, title: [440, 26], column: 424 },
};
/** Seconds of the whole, and in which the slider moves. */
const [WHOLE, MOVES, RESTS] = [10, 2.5, 7];
/** The gain that moves, its values, and the periods that are shown, of which every second is drawn. */
const [GAIN, VALUES, PERIODS] = ["ki", [4, 7, 12, 18, 25, 19, 13, 9, 6.5], 200];
const CLOCK = 125;

const [wasm, out] = process.argv.slice(2);
const call = await asking(readFileSync(wasm));
const example = call("about").examples.find(({ name }) => name === "gains.s");
const runs = [];
let program;
for (const value of VALUES) {
  // Without a table, the reference and the load are those of the plant's file.
  const asked = { ...shipped(example, PERIODS), inputs: "", periods: PERIODS, parameters: { [GAIN]: value } };
  program = call("assemble", asked);
  if (program.plant_error || program.parameter_error) throw new Error(program.plant_error ?? program.parameter_error);
  runs.push(await collect(call, PERIODS));
}
const [cycles] = new Set(runs.flatMap((run) => run.cycles));
if (runs.some((run) => run.shortest !== cycles || run.longest !== cycles)) throw new Error("periods take different times");

const escape = (text) => text.replace(/[&<>]/g, (one) => `&#${one.charCodeAt(0)};`);
const put = (name, set, content = "") => `<${name}${Object.entries(set).map(([key, value]) => ` ${key}="${value}"`).join("")}>${content}</${name}>`;
const text = (x, y, content, set = {}) => put("text", { x, y, ...set }, escape(content));
const most = Math.max(...runs.flatMap((run) => run.inputs.w)) * 1.05;

for (const [name, { WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM, title, column }] of Object.entries(LAYOUTS)) {
  const x = (i) => LEFT + ((WIDTH - LEFT - RIGHT) * i) / (PERIODS - 1), y = (value) => HEIGHT - BOTTOM - ((HEIGHT - TOP - BOTTOM) * value) / most;
  const path = (values) => values.flatMap((value, i) => (i % 2 ? [] : [`${x(i).toFixed(1)} ${y(value).toFixed(1)}`])).join("L").replace(/^/, "M");
  const at = (seconds) => (seconds / WHOLE).toFixed(3);
  const animate = (attribute, times, values, more = {}) => put("animate", { attributeName: attribute, dur: `${WHOLE}s`, repeatCount: "indefinite", keyTimes: times.map(at).join(";"), values: values.join(";"), ...more });
  /** Times of the slider's values, before them the first, and after them the last. */
  const steps = [0, ...VALUES.map((_, i) => MOVES + ((RESTS - MOVES) * i) / (VALUES.length - 1)), WHOLE], along = (of) => [of(0), ...VALUES.map((_, i) => of(i)), of(VALUES.length - 1)];

  const equations = example.source.split("\n").filter((line) => /^ {8}\w+ = /.test(line)).slice(2).map((line) => line.trim());
  if (equations.length !== 4) throw new Error(`there are ${equations.length} equations`);
  const { high, unit } = program.parameters.find(({ name }) => name === GAIN), knob = (i) => 70 + (220 * VALUES[i]) / high;
  const curves = runs.map((run) => path(run.inputs.w)), reference = path(runs[0].inputs.w_ref);
  const parts = [
    put("rect", { x: 0.5, y: 0.5, width: WIDTH - 1, height: HEIGHT - 1, rx: 8, fill: "#fff", stroke: "#cfd6e0", class: "g" }),
    text(16, 26, "A motor's speed controller", { class: "b" }), text(column - 16, 26, "programs/examples/gains.s", { class: "d", "text-anchor": "end" }),
    put("rect", { x: 12, y: 38, width: column - 24, height: 88, rx: 4, fill: "#f5f7fa", class: "p" }),
    ...equations.map((line, i) => text(24, 58 + 19 * i, line, { class: "m" })),
    text(16, 150, `${cycles} cycles a period`, { class: "b" }), text(142, 150, `${(cycles / CLOCK).toFixed(2)} µs at ${CLOCK} MHz, known before it runs`, { class: "d" }),
    text(16, 180, GAIN, { class: "m" }), put("rect", { x: 70, y: 173, width: 220, height: 4, rx: 2, fill: "#cfd6e0", class: "t" }),
    put("circle", { cx: knob(0), cy: 175, r: 7, fill: "#1f5fae" }, animate("cx", steps, along(knob))),
    ...VALUES.map((value, i) => {
      const shown = along((j) => (j === i ? "visible" : "hidden"));
      return put("text", { x: 304, y: 180, class: "m", visibility: i ? "hidden" : "visible" }, `${value} ${unit}${animate("visibility", steps, shown, { calcMode: "discrete" })}`);
    }),
    text(...title, "w, rad/s", { class: "b" }), text(title[0] + 62, title[1], "from a motor that is loaded after 0.1 s; dotted: w_ref", { class: "d" }),
    ...[0, 25, 50, 75, 100].flatMap((level) => [put("path", { d: `M${LEFT} ${y(level).toFixed(1)}H${WIDTH - RIGHT}`, stroke: "#e3e8ef", class: "l" }), text(LEFT - 6, (y(level) + 4).toFixed(1), String(level), { class: "d", "text-anchor": "end" })]),
    ...[0, 50, 100, 150, 200].map((period) => text(x(Math.min(period, PERIODS - 1)).toFixed(1), HEIGHT - 12, period === 200 ? "0.2 s" : `${period / 1000}`, { class: "d", "text-anchor": period === 200 ? "end" : "middle" })),
    put("path", { d: reference, class: "c", stroke: "#2f6fbf", "stroke-dasharray": "2 3" }),
    put("path", { d: curves[0], class: "c", stroke: "#2f6fbf", "stroke-opacity": 0.4 }, animate("visibility", [0, MOVES, WHOLE], ["hidden", "visible", "visible"], { calcMode: "discrete" })),
    put("path", { d: curves[0], class: "c", stroke: "#2f6fbf", "stroke-width": 2 }, animate("d", steps, along((i) => curves[i]))),
  ];
  const style = "text{font:12px system-ui,sans-serif;fill:#1c2330}.b{font-weight:600}.d{fill:#5d687b}.m{font:12.5px ui-monospace,'DejaVu Sans Mono',monospace}.c{fill:none}"
    + "@media (prefers-color-scheme:dark){text{fill:#dfe5ee}.d{fill:#98a3b5}.g{fill:#14181f;stroke:#39414e}.p{fill:#1a1f28}.t{fill:#39414e}.l{stroke:#2a3240}.c{stroke:#6fa8ee}}";
  writeFileSync(join(dirname(out), name), `<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 ${WIDTH} ${HEIGHT}" width="${WIDTH}" height="${HEIGHT}"><desc>Written by \`cargo xtask web --pictures\`</desc><style>${style}</style>\n${parts.join("\n")}\n</svg>\n`);
}
