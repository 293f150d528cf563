// Bundles the page: `node build.mjs FOLDER-OF-WASM OUT`. The first holds takt.js and takt_bg.wasm, as takt-bindgen writes them.
import { build } from "esbuild";
import { cpSync, mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { join, resolve } from "node:path";
import { gzipSync } from "node:zlib";

const [wasm, out] = process.argv.slice(2).map((path) => resolve(path));
const page = import.meta.dirname;
mkdirSync(out, { recursive: true });
await build({
  entryPoints: [join(page, "src/main.js"), join(page, "src/worker.js")],
  outdir: out, bundle: true, minify: true, format: "esm", target: "es2022", legalComments: "eof", logLevel: "warning",
  alias: { "takt-wasm": join(wasm, "takt.js") },
  // The glue can fetch its own WebAssembly beside itself; here the page hands it over.
  define: { "import.meta.url": '""' },
});
cpSync(join(page, "index.html"), join(out, "index.html"));
writeFileSync(join(out, "takt.wasm.gz"), gzipSync(readFileSync(join(wasm, "takt_bg.wasm")), { level: 9 }));
let total = 0;
for (const name of ["index.html", "main.css", "main.js", "worker.js", "takt.wasm.gz"]) {
  const bytes = readFileSync(join(out, name)), size = name.endsWith(".gz") ? bytes.length : gzipSync(bytes).length;
  total += size;
  console.log(`${name.padEnd(14)} ${String(bytes.length).padStart(9)} bytes, ${String(size).padStart(9)} compressed`);
}
console.log(`${"all".padEnd(14)} ${" ".repeat(16)} ${String(total).padStart(9)} compressed`);
const LIMIT = 2_000_000;
if (total >= LIMIT) {
  console.error(`the page has ${total} bytes compressed; it may have ${LIMIT}`);
  process.exit(1);
}
