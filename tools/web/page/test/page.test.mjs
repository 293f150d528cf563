// The playground in a real browser: `cargo xtask web --test`.
import assert from "node:assert/strict";
import { createReadStream, existsSync } from "node:fs";
import { readFile } from "node:fs/promises";
import { createServer } from "node:http";
import { extname, join, normalize } from "node:path";
import { after, afterEach, before, test } from "node:test";
import { deflateSync } from "node:zlib";
import { chromium } from "playwright-core";

const FOLDER = process.env.TAKT_PAGE;
const TYPES = { ".html": "text/html", ".js": "text/javascript", ".css": "text/css" };
const PROGRAMS = join(import.meta.dirname, "../../../../programs");
/** A browser on a busy machine; ms. */
const PATIENCE = 120_000;

let server, browser, address, requests = [];

before(async () => {
  assert.ok(FOLDER, "TAKT_PAGE says where the page is: `cargo xtask web --test` sets it");
  // A file server and nothing else, which knows neither WebAssembly nor compression.
  server = createServer((request, response) => {
    const path = normalize(new URL(request.url, "http://x").pathname).replace(/^\/$/, "/index.html");
    const file = join(FOLDER, path);
    requests.push(path);
    if (!existsSync(file)) return response.writeHead(404).end();
    response.writeHead(200, { "content-type": TYPES[extname(file)] ?? "application/octet-stream" });
    createReadStream(file).pipe(response);
  });
  await new Promise((resolve) => server.listen(0, "127.0.0.1", resolve));
  address = `http://127.0.0.1:${server.address().port}/`;
  browser = await chromium.launch({ executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", args: ["--no-sandbox"] });
}, { timeout: PATIENCE });

after(async () => {
  await browser?.close();
  server?.close();
});

// What one page computes would slow the next one down.
const contexts = [];
afterEach(async () => {
  for (const context of contexts.splice(0)) await context.close();
});

/** A fresh page at an address behind `#`; it fails if the page's code does. */
async function open(fragment = "", options = {}) {
  const context = await browser.newContext({ viewport: { width: 1400, height: 900 }, acceptDownloads: true, ...options });
  contexts.push(context);
  const page = await context.newPage();
  page.setDefaultTimeout(PATIENCE);
  const errors = [];
  page.on("pageerror", (error) => errors.push(error.message));
  page.on("request", (request) => request.url().startsWith("blob:") || request.url().startsWith("data:") || assert.ok(request.url().startsWith(address), `it asks for ${request.url()}`));
  await page.goto(address + fragment);
  await page.waitForSelector("body[data-ready]");
  return { page, context, errors };
}

const done = (page) => page.waitForFunction(() => !document.getElementById("assemble").disabled);
const cycles = (page) => page.textContent("#cycles");
const link = (program) => "#p1=" + deflateSync(JSON.stringify(program)).toString("base64url");
const example = (name) => readFile(join(PROGRAMS, "examples", name), "utf8");

/** Types a text in place of the one there. */
async function write(page, text) {
  await page.click(".cm-content");
  await page.keyboard.press("Control+a");
  await page.keyboard.insertText(text);
}

async function shot(page, name) {
  const folder = process.env.TAKT_SCREENSHOTS;
  if (folder) await page.screenshot({ path: join(folder, `${name}.png`) });
}

const limit = { timeout: 2 * PATIENCE };

test("the integrator assembles and runs when the page opens, coloured by the language server", limit, async () => {
  const { page, errors } = await open();
  await done(page);
  assert.match(await cycles(page), /pi\.s on t3: 38 cycles a period, in \d+ periods · no schedule takes fewer than 38/);
  // Whatever colours there are come from the server; a second lexer in the page would be found here.
  await page.waitForSelector(".tok-function");
  const instruction = await page.textContent(".tok-function");
  assert.match(instruction, /^[a-z]\w*$/);
  await page.waitForSelector(".hint");
  await page.waitForSelector(".lens");
  assert.match((await page.locator(".lens").allTextContents()).join("\n"), /38 cycles/);
  await page.click("#tab-plot");
  await page.waitForSelector("#charts canvas");
  // The curve is there, not only its axes: pixels of its colour.
  await page.waitForFunction(() => {
    const canvas = document.querySelector("#charts canvas");
    const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    let count = 0;
    for (let i = 0; i < data.length; i += 4) count += data[i] === 0x2f && data[i + 1] === 0x6f && data[i + 2] === 0xbf;
    return count > 50;
  });
  await shot(page, "plot-light-wide");
  assert.deepEqual(errors, []);
});

test("diagnostics, a fix, hover and completion are the language server's", limit, async () => {
  const { page, errors } = await open(link({ name: "a.s", machine: "t3", source: ".input x\n.output y\n.period\nstart:\n    fmull y, x, x\n    wait start\n" }));
  await done(page);
  assert.match(await cycles(page), /does not assemble/);
  assert.match(await page.textContent("#text"), /fmull/);
  await page.waitForSelector(".cm-lintRange-error");
  await page.hover(".cm-lintRange-error");
  await page.waitForSelector(".cm-diagnosticAction");
  await shot(page, "diagnostic");
  await page.click(".cm-diagnosticAction");
  assert.match(await page.evaluate(() => takt.text), /^ {4}fmul /m);
  await page.keyboard.press("Escape");
  await page.click("#assemble");
  await page.waitForFunction(() => /cycles a period/.test(document.getElementById("cycles").textContent));
  await page.waitForSelector(".tok-function");
  // As a hand does that does not get an answer at once: over a text that was just read again there is none.
  while (!(await page.locator(".cm-tooltip-hover").count())) {
    await page.mouse.move(0, 0);
    await page.hover(".tok-function");
    await page.waitForTimeout(800);
  }
  assert.match(await page.locator(".cm-tooltip-hover").innerText(), /latency/);
  await page.mouse.move(0, 0);
  await page.waitForSelector(".cm-tooltip-hover", { state: "detached" });
  await write(page, ".input x\n.output y\n.period\nstart:\n    fad");
  await page.keyboard.press("Control+Space");
  await page.waitForSelector(".cm-tooltip-autocomplete");
  assert.match(await page.locator(".cm-tooltip-autocomplete").innerText(), /fadd/);
  assert.deepEqual(errors, []);
});

test("keyboard only: step on and back, and a command", limit, async () => {
  const { page, errors } = await open();
  await done(page);
  const head = () => page.textContent("#head");
  const start = await head();
  assert.match(start, /^cycle 0, period 0/);
  const seen = [start];
  for (let i = 0; i < 5; i++) {
    await page.keyboard.press("F10");
    await page.waitForFunction((old) => document.getElementById("head").textContent !== old, seen.at(-1));
    await done(page);
    seen.push(await head());
  }
  assert.equal(await page.locator(".cm-next").count(), 1);
  await shot(page, "step");
  for (let i = 4; i >= 0; i--) {
    await page.keyboard.press("Shift+F10");
    await page.waitForFunction((old) => document.getElementById("head").textContent !== old, seen[i + 1]);
    await done(page);
    assert.equal(await head(), seen[i], "back is exactly where it was");
  }
  // From the commands by Tab to the panel, by arrows between tabs.
  await page.keyboard.press("Control+Alt+c");
  await page.keyboard.type("goto period 3");
  await page.keyboard.press("Enter");
  await page.waitForFunction(() => /period 3:/.test(document.getElementById("head").textContent));
  await page.focus("#tab-step");
  await page.keyboard.press("ArrowRight");
  assert.equal(await page.getAttribute("#tab-plot", "aria-selected"), "true");
  assert.equal(await page.evaluate(() => document.activeElement.id), "tab-plot");
  await page.keyboard.press("Control+Alt+e");
  assert.ok(await page.evaluate(() => document.activeElement.classList.contains("cm-content")));
  await page.keyboard.press("Control+a");
  await page.keyboard.insertText(".output y\n.period\nstart:\n    fmov y, one\n.const one = 1\n    wait start\n");
  await page.keyboard.press("Control+Enter");
  await page.waitForFunction(() => takt.state.program && !takt.state.stale);
  assert.deepEqual(errors, []);
});

test("breakpoints are set by a click and by F9, stay where they are written, and stop", limit, async () => {
  const { page, errors } = await open();
  await done(page);
  const stops = () => page.evaluate(() => takt.stops);
  // In the gutter, beside the line that issues first.
  await page.locator(".cm-arrow .cm-gutterElement:visible", { hasText: "▶" }).click();
  await page.waitForFunction(() => takt.stops.length === 1);
  const [first] = await stops();
  await page.click(".cm-content");
  await page.keyboard.press("Control+Home");
  // The first line is a comment: no code, and a message that says so.
  await page.keyboard.press("F9");
  await page.waitForSelector("#notice:visible");
  assert.match(await page.textContent("#notice"), /line 1 of pi\.s has no instruction; the next line with one is \d+/);
  await page.keyboard.type("\n\n");
  await page.keyboard.press("Control+Enter");
  await done(page);
  assert.deepEqual(await stops(), [first + 2], "it moved with its line, and is there in the new run");
  await page.keyboard.press("F8");
  await done(page);
  assert.equal(await page.locator(".cm-arrow .stop").count(), 1);
  assert.match(await page.textContent("#head"), new RegExp(`pi\\.s:${first + 2}`));
  await shot(page, "breakpoint");
  await page.evaluate((line) => takt.goTo(line), first + 2);
  await page.keyboard.press("F9");
  await page.waitForFunction(() => takt.stops.length === 0);
  assert.deepEqual(errors, []);
});

test("sections fold, and a name leads to the file that declares it", limit, async () => {
  const { page, errors } = await open("#example=tracking.s");
  await done(page);
  await page.waitForSelector(".tok-function");
  await page.waitForSelector(".cm-foldGutter span[title='Fold line']");
  const lines = () => page.locator(".cm-line").count();
  const before = await lines();
  await page.locator(".cm-foldGutter span[title='Fold line']").first().click();
  await page.waitForSelector(".cm-foldPlaceholder");
  assert.ok((await lines()) < before + 1);
  // `ms` is declared in robot.s.
  await page.evaluate(() => takt.goTo(10, 20));
  await page.keyboard.press("F12");
  await page.waitForSelector("#file-shown[open] .cm-content");
  assert.equal(await page.textContent("#file-name"), "robot.s");
  assert.match(await page.locator("#file-text .cm-activeLine").textContent(), /\.const/);
  await shot(page, "file");
  await page.keyboard.press("Escape");
  await page.waitForSelector("#file-shown", { state: "hidden" });
  assert.deepEqual(errors, []);
});

test("a name of the library leads to the library's file, and so does its include", limit, async () => {
  const source = ".include <math.s>\n.input x\n.output y\n.reg a\n.period\nperiod: fmul a, x, math.inf\n    mov y, a\n    wait period\n";
  const { page, errors } = await open(link({ name: "pi.s", machine: "t3", source }));
  await done(page);
  await page.waitForSelector(".tok-function");
  for (const [line, column, shows] of [[6, 22, /math\.inf/], [1, 13, /^/]]) {
    await page.evaluate(([line, column]) => takt.goTo(line, column), [line, column]);
    await page.keyboard.press("F12");
    await page.waitForSelector("#file-shown[open] .cm-content");
    assert.equal(await page.textContent("#file-name"), "<math.s>");
    assert.match(await page.locator("#file-text .cm-activeLine").textContent(), shows);
    if (line > 1) await shot(page, "library");
    await page.keyboard.press("Escape");
    await page.waitForSelector("#file-shown", { state: "hidden" });
  }
  assert.deepEqual(errors, []);
});

test("a loop without end stops at a named limit, and the page answers meanwhile", limit, async () => {
  const { page, errors } = await open(link({ name: "loop.s", machine: "t3", source: "start:\n    jmp start\n" }));
  await done(page);
  await page.waitForFunction(() => document.getElementById("fault").textContent !== "");
  assert.match(await page.textContent("#fault"), /20000000|20,000,000/);
  await page.evaluate(() => document.querySelector("[data-step=continue]").click());
  assert.equal(await page.evaluate(() => 1 + 1), 2);
  await done(page);
  // Stopping loses nothing of the text.
  await page.evaluate(() => document.querySelector("[data-step=continue]").click());
  await page.waitForSelector("#stop:visible");
  await page.evaluate(() => document.getElementById("stop").click());
  await page.waitForSelector("#notice:visible");
  assert.match(await page.textContent("#notice"), /Stopped/);
  assert.match(await page.evaluate(() => takt.text), /jmp start/);
  await page.click("#assemble");
  await page.waitForFunction(() => document.getElementById("fault").textContent !== "");
  assert.deepEqual(errors, []);
});

test("a link carries source, inputs and machine; a damaged one says so and loses no text", limit, async () => {
  const { page, context, errors } = await open();
  await done(page);
  const source = await example("foc.s"), inputs = await example("foc.csv");
  await write(page, source);
  await page.click("#tab-inputs");
  await page.fill("#table", inputs);
  await page.selectOption("#machine", "t1");
  await done(page);
  await page.click("#link");
  await page.waitForFunction(() => location.hash.startsWith("#p1="));
  const hash = await page.evaluate(() => location.hash);
  const other = await context.newPage();
  other.setDefaultTimeout(PATIENCE);
  await other.goto(address + hash);
  await other.waitForSelector("body[data-ready]");
  await done(other);
  assert.equal(await other.evaluate(() => takt.text), source);
  assert.equal(await other.inputValue("#table"), inputs);
  assert.match(await cycles(other), /on t1: 223 cycles/);
  for (const [damaged, why] of [
    [hash.slice(0, -9), /missing or was changed/],
    [hash.slice(0, 60) + (hash[60] === "A" ? "B" : "A") + hash.slice(61), /missing or was changed|holds no source/],
    ["#p1=%%%", /no link has/],
    ["#hello", /begin with `p1=`/],
    ["#example=none.s", /no example `none\.s`/],
  ]) {
    await other.evaluate((hash) => (location.hash = hash), damaged);
    await other.waitForSelector("#notice:visible");
    assert.match(await other.textContent("#notice"), why);
    assert.equal(await other.evaluate(() => takt.text), source, "the text is as it was");
    await other.evaluate(() => (document.getElementById("notice").hidden = true));
  }
  assert.deepEqual(errors, []);
});

test("wrong inputs are told with line and column", limit, async () => {
  const { page } = await open(link({ name: "a.s", machine: "t3", inputs: "x\n1\ntwo\n", source: ".input x\n.output y\n.period\nstart:\n    fadd y, x, x\n    wait start\n" }));
  await done(page);
  assert.match(await page.textContent("#text"), /inputs:3: column x: `two` is no number/);
  await page.click("#tab-inputs");
  await page.fill("#table", "x\n1\n2\n");
  await page.click("#assemble");
  await page.waitForFunction(() => takt.state.run?.cycles.length === 2);
  assert.deepEqual(await page.evaluate(() => takt.state.run.outputs.y), [2, 4]);
});

test("the picture of the pipeline is that of `takt analyse --html`", limit, async () => {
  const { page, errors } = await open();
  await done(page);
  await page.click("#tab-pipeline");
  const frame = page.frameLocator("#picture");
  await frame.locator("#title").waitFor();
  assert.match(await frame.locator("#title").textContent(), /pi\.s on t3, period 2: 38 cycles/);
  assert.ok((await frame.locator("#svg rect").count()) > 10);
  await shot(page, "pipeline");
  assert.deepEqual(errors, []);
});

test("image, Verilog and header can be taken away", limit, async () => {
  const { page, errors } = await open();
  await done(page);
  const take = async (what) => {
    await page.click("#export summary");
    const [download] = await Promise.all([page.waitForEvent("download"), page.click(`[data-export=${what}]`)]);
    return { name: download.suggestedFilename(), bytes: await readFile(await download.path()) };
  };
  const image = await take("image");
  assert.equal(image.name, "pi.takt");
  assert.deepEqual([...image.bytes.subarray(0, 4)], [0x7f, 0x45, 0x4c, 0x46], "an ELF file");
  const zip = await take("verilog");
  assert.equal(zip.name, "takt_t3.zip");
  assert.ok(zip.bytes.includes("takt_t3/takt_t3_bench.v"));
  const header = await take("c");
  assert.equal(header.name, "pi.h");
  assert.match(header.bytes.toString(), /#define|#ifndef/);
  assert.deepEqual(errors, []);
});

test("the tracking program drives the robot", limit, async () => {
  const { page, errors } = await open("#example=tracking.s");
  await done(page);
  assert.match(await cycles(page), /tracking\.s on t3: 112 .*cycles a period.* no schedule takes fewer than 108/);
  await page.click("#tab-robot");
  await page.click("#drive");
  await page.waitForFunction(() => /^[1-9]/.test(document.getElementById("drove").textContent));
  const before = await page.inputValue("#time");
  await page.waitForFunction((old) => document.getElementById("time").value !== old, before);
  if (process.env.TAKT_BENCH || process.env.TAKT_SCREENSHOTS) {
    await page.waitForFunction(() => document.querySelector("#error-chart canvas"), null, { timeout: 10 * PATIENCE });
    assert.match(await page.textContent("#drove"), /7\.8\d µm cutting/);
    await page.evaluate(() => { const time = document.getElementById("time"); time.value = time.max * 0.8; time.dispatchEvent(new Event("input")); });
    await shot(page, "robot-light-wide");
  }
  assert.deepEqual(errors, []);
});

test("light and dark, wide and narrow", { ...limit, skip: process.env.TAKT_SCREENSHOTS ? false : "no folder for pictures" }, async () => {
  for (const colorScheme of ["light", "dark"]) {
    for (const [name, viewport] of [["wide", { width: 1400, height: 900 }], ["narrow", { width: 390, height: 844 }]]) {
      const { page, context } = await open("#example=foc.s", { colorScheme, viewport });
      await done(page);
      await page.waitForSelector(".hint");
      await shot(page, `${name}-${colorScheme}`);
      assert.equal(await page.evaluate(() => document.documentElement.scrollWidth > innerWidth), false, `${name}: nothing sticks out`);
      if (name === "narrow") {
        await page.locator("#side").scrollIntoViewIfNeeded();
        await page.click("#tab-plot");
        await page.locator("#charts canvas").first().scrollIntoViewIfNeeded();
        await shot(page, `${name}-${colorScheme}-plot`);
      }
      await context.close();
    }
  }
  for (const [colorScheme, viewport] of [["dark", { width: 1400, height: 900 }], ["light", { width: 390, height: 844 }]]) {
    const { page } = await open("#example=tracking.s", { colorScheme, viewport });
    await done(page);
    await page.click("#tab-robot");
    await page.click("#drive");
    await page.waitForFunction(() => /^[3-9]\./.test(document.getElementById("drove").textContent));
    await page.evaluate(() => { const time = document.getElementById("time"); time.value = time.max; time.dispatchEvent(new Event("input")); });
    await page.locator("#scene").scrollIntoViewIfNeeded();
    await shot(page, `robot-${colorScheme}`);
  }
});

test("speed of the closed loop", { timeout: 10 * PATIENCE, skip: process.env.TAKT_BENCH ? false : "TAKT_BENCH is not set" }, async () => {
  const { page } = await open("#example=tracking.s");
  await done(page);
  await page.evaluate(() => takt.bench(20_000));
  const result = await page.evaluate(() => takt.bench(200_000));
  console.log(`tracking on t3: ${result.periods} periods, ${result.operations} operations in ${result.seconds.toFixed(2)} s: ${(result.rate / 1e6).toFixed(1)} million operations/s`);
  assert.ok(result.operations > 0);
});

test("nothing comes from elsewhere, and it is small", limit, async () => {
  requests = [];
  const { page } = await open();
  await done(page);
  assert.deepEqual([...new Set(requests)].sort(), ["/index.html", "/main.css", "/main.js", "/takt.wasm.gz", "/worker.js"]);
});
