// Bundles the page, and that of a board at a serial port: `node build.mjs TAKT.WASM LIVE.WASM OUT`.
import zopfli from "@gfx/zopfli";
import { build } from "esbuild";
import { cpSync, mkdirSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { basename, join, relative, resolve } from "node:path";
import { promisify } from "node:util";
import { gzipSync } from "node:zlib";
import { asking } from "./ask.mjs";
import { PERIODS, WHICH, collect, shipped } from "./src/collect.js";

const [wasm, live, out] = process.argv.slice(2).map((path) => resolve(path));
const page = import.meta.dirname;
/** Periods of a drive in a call, and digits of a pose that is drawn. */
const SLICE = 20_000, DIGITS = 7;
mkdirSync(out, { recursive: true });
rmSync(join(out, "parts"), { recursive: true, force: true });
const { metafile } = await build({
  entryPoints: [join(page, "src/main.js"), join(page, "src/worker.js")],
  outdir: out, bundle: true, minify: true, format: "esm", target: "es2022", legalComments: "eof", logLevel: "warning",
  // Panels are imported when they are asked for; what they share with the first screen is a file of its own.
  splitting: true, chunkNames: "parts/[name]-[hash]", metafile: true,
});
/** Files of the bundle by their names, and those of the first screen. */
const outputs = new Map(Object.entries(metafile.outputs).map(([path, about]) => [relative(out, resolve(path)), about]));
const first = new Set(["index.html", "main.css", "main.js", "worker.js", "takt.wasm.gz"]);
for (const name of first) for (const { path, kind } of outputs.get(name)?.imports ?? []) if (kind === "import-statement") first.add(relative(out, resolve(path)));
cpSync(join(page, "index.html"), join(out, "index.html")); // weighed here, completed below
// Five percent smaller than gzip's best, for ten seconds; more iterations gain next to nothing.
writeFileSync(join(out, "takt.wasm.gz"), await promisify(zopfli.gzip)(bare(readFileSync(wasm)), { numiterations: 3 }));
const weigh = (name) => {
  const bytes = readFileSync(join(out, name)), size = name.endsWith(".gz") ? bytes.length : gzipSync(bytes).length;
  console.log(`${name.padEnd(26)} ${String(bytes.length).padStart(9)} bytes, ${String(size).padStart(9)} compressed`);
  return size;
};
let total = [...first].reduce((sum, name) => sum + weigh(name), 0), screen = total;
console.log(`${"first screen".padEnd(26)} ${" ".repeat(16)} ${String(total).padStart(9)} compressed`);
/** Bytes of the first screen, and of all that is loaded when asked for. */
const LIMIT = 2_000_000, ALL = 4_000_000;
if (total >= LIMIT) fail(`the page has ${total} bytes compressed; it may have ${LIMIT}`);
total += [...outputs.keys()].filter((name) => !first.has(name)).reduce((sum, name) => sum + weigh(name), 0);
// The page of a board: that of `takt live serve`, whose server has all files in one folder, with a line of its own to the port.
const files = { "line.js": "live/serial.js", "parts.js": "src/parts.js" };
const serial = { name: "serial", setup: (made) => made.onResolve({ filter: /\/(line|parts)\.js$/ }, ({ path }) => ({ path: join(page, files[basename(path)]) })) };
await build({
  entryPoints: [join(page, "live/live.js"), join(page, "live/serial-worker.js")],
  outdir: join(out, "live"), bundle: true, minify: true, format: "esm", target: "es2022", legalComments: "eof", logLevel: "warning", plugins: [serial],
});
for (const name of ["live/index.html", "live/live.css", "src/style.css"]) cpSync(join(page, name), join(out, "live", basename(name)));
writeFileSync(join(out, "live/live.wasm.gz"), await promisify(zopfli.gzip)(bare(readFileSync(live)), { numiterations: 1 }));
total += ["live.js", "serial-worker.js", "live.css", "style.css", "index.html", "live.wasm.gz"].reduce((sum, name) => sum + weigh(`live/${name}`), 0);
// Results of the examples, and a drive of the robot, so that no panel waits for the machine in the browser.
mkdirSync(join(out, "ahead"), { recursive: true });
const call = await asking(readFileSync(wasm));
const { examples, machines } = call("about");
// What the menus show first, before a script has filled them.
const { name: usual } = machines.find(({ name }) => name === shipped(examples[0], PERIODS).machine), html = readFileSync(join(page, "index.html"), "utf8");
const menus = Object.entries({ example: `${examples[0].name}: ${examples[0].short}`, machine: usual });
writeFileSync(join(out, "index.html"), menus.reduce((text, [id, first]) => text.replace(`<select id="${id}"></select>`, `<select id="${id}"><option>${first}</option></select>`), html));
const ahead = (name, data) => {
  const bytes = gzipSync(JSON.stringify(data), { level: 9 });
  writeFileSync(join(out, `ahead/${name}.json.gz`), bytes);
  total += bytes.length;
  if (name === examples[0].name && (screen += bytes.length) >= LIMIT) fail(`the page has ${screen} bytes compressed with its first example; it may have ${LIMIT}`);
  console.log(`${`ahead/${name}.json.gz`.padEnd(26)} ${" ".repeat(16)} ${String(bytes.length).padStart(9)} compressed`);
};
for (const example of examples) {
  const asked = shipped(example, PERIODS), program = call("assemble", asked), run = await collect(call, asked.periods);
  ahead(example.name, { program, run, bundles: call("bundles"), picture: call("picture", { period: Math.min(WHICH, run.cycles.length) }) });
  if (!example.track) continue;
  const poses = [];
  let part = call("track", { begin: true, periods: SLICE });
  for (; ; part = call("track", { periods: SLICE })) {
    poses.push(...part.poses.map((pose) => pose.map((value) => Number(value.toPrecision(DIGITS)))));
    if (part.over) break;
  }
  ahead("drive", { ...part, poses });
}
if (total >= ALL) fail(`the page and all that it loads have ${total} bytes compressed; they may have ${ALL}`);

function fail(message) {
  console.error(message);
  process.exit(1);
}

/** Removes custom sections (number 0) from WebAssembly: they contain names for debuggers. */
function bare(bytes) {
  const parts = [bytes.subarray(0, 8)];
  for (let at = 8; at < bytes.length; ) {
    const start = at, id = bytes[at++];
    let length = 0;
    for (let shift = 0, more = true; more; shift += 7) {
      length += (bytes[at] & 0x7f) * 2 ** shift;
      more = bytes[at++] >= 0x80;
    }
    at += length;
    if (id !== 0) parts.push(bytes.subarray(start, at));
  }
  return Buffer.concat(parts);
}
