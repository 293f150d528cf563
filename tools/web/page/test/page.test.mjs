// The playground in a real browser: `cargo xtask web --test`.
import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { join } from "node:path";
import { after, afterEach, before, test } from "node:test";
import { deflateSync } from "node:zlib";
import { chromium } from "playwright-core";
import { serve } from "../serve.mjs";
import { binary32 } from "../src/parts.js";
import { VISIONS, ciede2000, distance } from "./colours.mjs";

const FOLDER = process.env.TAKT_PAGE;
const PROGRAMS = join(import.meta.dirname, "../../../../programs");
/** Time limit in a browser on a busy machine; ms. */
const PATIENCE = 120_000;

let server, browser, address, requests = [];

before(async () => {
  assert.ok(FOLDER, "TAKT_PAGE says where the page is: `cargo xtask web --test` sets it");
  ({ server, address } = await serve(FOLDER, (path) => requests.push(path)));
  browser = await chromium.launch({ executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", args: ["--no-sandbox"] });
}, { timeout: PATIENCE });

after(async () => {
  await browser?.close();
  server?.close();
});

// Close pages after each test: a page that still works would slow down the next.
const contexts = [];
afterEach(async () => {
  for (const context of contexts.splice(0)) await context.close();
});

/** Opens a new page with a URL fragment; "" is the page as a stranger opens it. Errors in the page's code fail the test. */
async function open(fragment = "#example=pi.s", { script, ...options } = {}) {
  const context = await browser.newContext({ viewport: { width: 1400, height: 900 }, acceptDownloads: true, ...options });
  contexts.push(context);
  const page = await context.newPage();
  if (script) await page.addInitScript(script);
  page.setDefaultTimeout(PATIENCE);
  const errors = [];
  page.on("pageerror", (error) => errors.push(error.message));
  page.on("request", (request) => request.url().startsWith("blob:") || request.url().startsWith("data:") || assert.ok(request.url().startsWith(address), `it asks for ${request.url()}`));
  await page.goto(address + fragment);
  await page.waitForSelector("body[data-ready]");
  return { page, context, errors };
}

/** Waits until a page rests. On a busy machine, a run may take so long that the page would not repeat it unasked: it forgets that. */
const done = (page) => page.waitForFunction(() => {
  if (document.getElementById("assemble").disabled) return false;
  takt.state.took = 0;
  return true;
});
const cycles = (page) => page.textContent("#cycles");
const link = (program) => "#p1=" + deflateSync(JSON.stringify(program)).toString("base64url");
const example = (name) => readFile(join(PROGRAMS, "examples", name), "utf8");

/** Replaces the text in the editor by typing. */
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
  assert.match(await cycles(page), /pi\.s on t3: 38 cycles a period, 0\.304 µs at 125 MHz · proved: at most 43, whatever the inputs \(deadlines kept\)$/);
  assert.match(await page.textContent("#more-text"), /^measured in 400 periods · no schedule takes fewer than 38 cycles · period takes 38 to 43 whatever the inputs, 44 after a missed deadline · before the first period 9$/);
  await page.click("#more summary");
  assert.ok((await page.locator("#more summary").boundingBox()).width < 80, "a button, not a bar");
  await page.keyboard.press("Escape");
  assert.equal(await page.locator("#more").evaluate((box) => box.open), false, "it goes by Escape");
  // All colours come from the server: if the page had a lexer of its own, this would fail.
  await page.waitForSelector(".tok-function");
  const instruction = await page.textContent(".tok-function");
  assert.match(instruction, /^[a-z]\w*$/);
  await page.waitForSelector(".hint");
  await page.waitForSelector(".lens");
  assert.match((await page.locator(".lens").allTextContents()).join("\n"), /38 cycles/);
  await page.click("#tab-plot");
  await page.waitForSelector("#charts canvas");
  // The curve itself is drawn, not only the axes: look for pixels of its colour.
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
  // Move the pointer repeatedly until an answer comes: just after a text was read, there is none.
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
  // Tab moves from the commands to the panel, arrows move between tabs.
  await page.keyboard.press("Control+Alt+c");
  await page.keyboard.type("goto period 3");
  await page.keyboard.press("Enter");
  await page.waitForFunction(() => /period 3:/.test(document.getElementById("head").textContent));
  assert.equal(await page.getAttribute("#tab-step", "aria-selected"), "true", "who steps sees where");
  await page.focus("#tab-step");
  await page.keyboard.press("ArrowLeft");
  assert.equal(await page.getAttribute("#tab-code", "aria-selected"), "true");
  assert.equal(await page.evaluate(() => document.activeElement.id), "tab-code");
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
  // Click in the gutter, beside the line that issues first.
  await page.locator(".cm-arrow .cm-gutterElement:visible", { hasText: "▶" }).click();
  await page.waitForFunction(() => takt.stops.length === 1);
  const [first] = await stops();
  await page.click(".cm-content");
  await page.keyboard.press("Control+Home");
  // The first line is a comment without code, so there is a message.
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
  // robot.s declares `ms`.
  await page.evaluate(() => takt.goTo(12, 20));
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
  // Stopping preserves the text.
  // Run inside the page: otherwise, on a busy machine, the work could end before the test stops it.
  assert.equal(await page.evaluate(async () => {
    document.querySelector("[data-step=continue]").click();
    await new Promise((resolve) => setTimeout(resolve, 30));
    const { hidden } = document.getElementById("stop");
    document.getElementById("stop").click();
    return hidden;
  }), false);
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
  assert.match(await cycles(other), /on t1: 222 cycles/);
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
    await other.click("#notice .close");
    assert.equal(await other.locator("#notice:visible").count(), 0);
  }
  assert.deepEqual(errors, []);
});

test("wrong inputs are told with line and column", limit, async () => {
  const { page } = await open(link({ name: "a.s", machine: "t3", inputs: "x\n1\ntwo\n", source: ".input x\n.output y\n.period\nstart:\n    fadd y, x, x\n    wait start\n" }));
  await done(page);
  assert.match(await page.textContent("#text"), /inputs:3: column x: `two` is not a number/);
  await page.click("#tab-inputs");
  await page.fill("#table", "x\n1\n2\n");
  await page.click("#assemble");
  await page.waitForFunction(() => takt.state.run?.cycles.length === 2);
  assert.deepEqual(await page.evaluate(() => takt.state.run.outputs.y), [2, 4]);
});

test("the pipeline is drawn for the machine that is chosen; a click leads to the line, and the line back", limit, async () => {
  const { page, errors } = await open();
  await done(page);
  await page.click("#tab-pipeline");
  await page.waitForFunction(() => /pi\.s on t3, period 2: 38 cycles/.test(document.getElementById("drawn").textContent));
  assert.ok((await page.locator(".tp-issue").count()) > 10);
  // The longest chain consists of operations, not of whole bundles: other operations of its bundles are not on it.
  const [critical, all] = [await page.locator(".tp-on-chain").count(), await page.locator(".tp-label").count()];
  assert.ok(critical > 3 && critical < all, `${critical} of ${all}`);
  assert.match((await page.locator(".tp-legend span").allTextContents()).join("; "), /multiply \d+; .*longest chain/);
  await shot(page, "pipeline");
  await page.locator(".tp-label", { hasText: "fsat sat" }).click();
  const line = (await example("pi.s")).split("\n").findIndex((line) => /fsat/.test(line)) + 1;
  assert.equal(await page.locator(".cm-activeLineGutter").first().textContent(), String(line));
  await page.evaluate((line) => takt.goTo(line), line - 1);
  await page.waitForFunction(() => /fadd v, p, s/.test(document.querySelector(".tp-marked")?.textContent ?? ""));
  // Tab stops at a single row, and arrows move from there.
  const stops = () => page.locator(".tp-label[tabindex='0']").evaluateAll((rows) => rows.map((row) => Number(row.dataset.row)));
  assert.equal((await stops()).length, 1);
  await page.locator(".tp-label[tabindex='0']").focus();
  const [at] = await stops();
  await page.keyboard.press("ArrowDown");
  assert.deepEqual(await stops(), [at + 1]);
  assert.equal(await page.evaluate(() => Number(document.activeElement.dataset.row)), at + 1);
  // Zoom, and labels that leave room for the chart.
  const column = () => page.locator(".tp-issue").first().evaluate((box) => Number(box.getAttribute("width")));
  const before = await column();
  await page.click(".tp-tools button[title^=Wider]");
  assert.ok((await column()) > before);
  await page.selectOption("#machine", "t4");
  await page.waitForFunction(() => /pi\.s on t4/.test(document.getElementById("drawn").textContent));
  await page.fill("#which", "300");
  await page.keyboard.press("Enter");
  await page.waitForFunction(() => /pi\.s on t4, period 300/.test(document.getElementById("drawn").textContent));
  assert.ok(await page.locator(".tp-stalls").evaluate((box) => box.open), "there is room for it");
  await shot(page, "pipeline-t4");
  assert.deepEqual(errors, []);
});

test("people with a colour deficiency tell the pipeline's units apart", limit, async () => {
  // Two of the pairs that Sharma, Wu and Dalal publish.
  assert.ok(Math.abs(ciede2000([50, 2.6772, -79.7751], [50, 0, -82.7485]) - 2.0425) < 1e-4);
  assert.ok(Math.abs(ciede2000([22.7233, 20.0904, -46.694], [23.0331, 14.973, -42.5619]) - 2.0373) < 1e-4);
  assert.ok(distance("#3077c0", "#9b4fc0", "deuteranopia") < 10, "the colours of multiply and sequencer before");
  for (const colorScheme of ["light", "dark"]) {
    const { page, errors } = await open("#example=tracking.s", { colorScheme });
    await done(page);
    await page.click("#tab-pipeline");
    await page.waitForFunction(() => /tracking\.s on t3/.test(document.getElementById("drawn").textContent));
    const { colours, legend } = await page.evaluate(() => {
      const style = getComputedStyle(document.querySelector(".tp")), hex = (rgb) => `#${rgb.match(/\d+/g).slice(0, 3).map((one) => Number(one).toString(16).padStart(2, "0")).join("")}`;
      const colours = [];
      for (let i = 0; style.getPropertyValue(`--u${i}`); i++) colours.push(style.getPropertyValue(`--u${i}`).trim());
      return { colours, legend: [...document.querySelectorAll(".tp-unit")].map((one) => hex(getComputedStyle(one).backgroundColor)) };
    });
    assert.equal(colours.length, 11);
    assert.ok(legend.length > 5 && new Set(legend).size === legend.length && legend.every((one) => colours.includes(one)), `${legend}`);
    for (const vision of VISIONS) for (const [i, one] of colours.entries()) for (const other of colours.slice(0, i)) assert.ok(distance(one, other, vision) >= 10, `${colorScheme}, ${vision}: ${one} and ${other} differ by ${distance(one, other, vision)}`);
    await shot(page, `units-${colorScheme}`);
    assert.deepEqual(errors, []);
  }
});

test("time and labels of the pipeline stay in sight, on a telephone too", limit, async () => {
  const { page, errors } = await open("#example=tracking.s", { viewport: { width: 390, height: 844 } });
  await done(page);
  await page.click("#tab-pipeline");
  await page.waitForFunction(() => /tracking\.s on t3/.test(document.getElementById("drawn").textContent));
  const scroll = page.locator(".tp-scroll");
  await scroll.scrollIntoViewIfNeeded();
  await scroll.evaluate((box) => box.scrollTo(600, 2000));
  await page.waitForTimeout(300);
  const [box, labels, axis] = await Promise.all([scroll, page.locator(".tp-labels"), page.locator(".tp-axis")].map((one) => one.boundingBox()));
  assert.ok(Math.abs(labels.x - box.x) < 3 && Math.abs(axis.y - box.y) < 3, "they are where they were");
  assert.ok(labels.width <= 0.43 * box.width, `labels take ${labels.width} of ${box.width}`);
  assert.ok((await page.locator(".tp-axis text").count()) > 1);
  const legend = await page.locator(".tp-legend").evaluate((box) => [box.scrollHeight, box.clientHeight, box.lastElementChild.textContent]);
  assert.ok(legend[0] <= legend[1] && legend[2] === "longest chain", `all of the legend is in sight: ${legend}`);
  await shot(page, "pipeline-narrow");
  assert.deepEqual(errors, []);
});

test("what no longer holds is dimmed at once, and computed again", limit, async () => {
  const { page, errors } = await open();
  await done(page);
  const opacity = (selector) => page.evaluate((selector) => Number(getComputedStyle(document.querySelector(selector)).opacity), selector);
  assert.equal(await opacity("#cycles"), 1);
  await page.evaluate(() => takt.goTo(1));
  await page.keyboard.press("End");
  await page.keyboard.type("x");
  assert.ok((await opacity("#cycles")) < 0.5, "the cycles are of the text before");
  assert.ok((await opacity("#step .columns")) < 0.5);
  // The page recomputes without a request.
  await page.waitForFunction(() => !document.body.classList.contains("stale"));
  await done(page);
  assert.match(await cycles(page), /38 cycles a period/);
  // While the text has a mistake, results remain dimmed, and the mistake is reported.
  await page.keyboard.press("Enter");
  await page.keyboard.type("  fad e, e, e");
  await page.waitForFunction(() => /does not assemble: line 2: .*fad/.test(document.getElementById("cycles").textContent));
  assert.equal(await page.evaluate(() => document.body.classList.contains("stale")), true);
  assert.ok((await page.locator("#registers tr").count()) > 3);
  await page.waitForFunction(() => document.getElementById("cycles").classList.contains("now"));
  assert.deepEqual([await opacity("#cycles"), await opacity("#text")], [1, 1], "the mistake is that of this text");
  await shot(page, "stale");
  await page.keyboard.type("x");
  assert.ok((await opacity("#text")) < 0.5, "the message is one of the text before");
  await page.waitForFunction(() => document.getElementById("cycles").classList.contains("now"));
  await page.keyboard.press("Control+a");
  await page.keyboard.insertText(await example("foc.s"));
  // Inputs and plant belong to another program: the loop is open, the run uses zeros, and the page reports both.
  await page.waitForFunction(() => /pi\.s on t3: \d.* · the loop is open: the plant dc_motor is for other ports; for these there is pmsm, to be chosen above the plots/.test(document.getElementById("cycles").textContent) && !document.body.classList.contains("stale"));
  assert.match(await page.textContent("#text"), /The loop is open: the plant dc_motor is for other ports/);
  await page.click("#tab-plot");
  assert.deepEqual(await page.locator("#plant-name").evaluate((one) => [one.value, ...[...one.options].map(({ value }) => value)]), ["", "pmsm", ""]);
  assert.ok(await page.isHidden("#plant"), "no parameters of a plant that is not there");
  await page.click("#tab-inputs");
  await done(page);
  await page.fill("#table", await example("foc.csv"));
  await page.waitForFunction(() => /in 300 periods/.test(document.getElementById("more-text").textContent) && !document.body.classList.contains("stale"));
  // A table for other ports is none.
  await page.fill("#table", await example("pi.csv"));
  await page.waitForFunction(() => /the table is not read: inputs: no column for the input ports ia/.test(document.getElementById("cycles").textContent));
  assert.match(await page.textContent("#text"), /table of inputs is for other ports/);
  assert.deepEqual(errors, []);
});

test("a mistake leaves the curves where they are, and no figure of the text before stands beside it", limit, async () => {
  const { page, errors } = await open();
  await done(page);
  const shown = () => page.evaluate(() => ({ tab: takt.state.tab, charts: document.querySelectorAll("#charts canvas").length, mistake: getComputedStyle(document.getElementById("mistake")).display !== "none" }));
  const before = await shown();
  assert.deepEqual([before.tab, before.charts > 0, before.mistake], ["plot", true, false]);
  // A long run is not repeated unasked: the editor alone knows of the mistake.
  await page.evaluate(() => (takt.state.took = 1e6));
  await page.evaluate(() => takt.goTo(1));
  await page.keyboard.press("End");
  await page.keyboard.press("Enter");
  await page.keyboard.type("  fad e, e, e");
  await page.waitForFunction(() => /^does not assemble: line 2: .*fad/.test(document.getElementById("cycles").textContent));
  assert.doesNotMatch(await cycles(page), /38 cycles|proved/);
  await page.keyboard.press("Control+Enter");
  await page.waitForFunction(() => !document.getElementById("mistake").hidden);
  await done(page);
  assert.deepEqual(await shown(), { ...before, mistake: true }, "the tab and its curves stay");
  assert.match(await page.textContent("#mistake"), /The text does not assemble\. Below is the result of the text before\..*error\[.*pi\.s:2/s);
  await shot(page, "mistake-beside-curves");
  await page.click("#tab-messages");
  assert.equal((await shown()).mistake, false, "the messages are there anyway");
  await page.click("#tab-plot");
  for (let i = 0; i < "  fad e, e, e".length; i++) await page.keyboard.press("Backspace");
  await page.evaluate(() => takt.goTo(2, 13));
  for (let i = 0; i < 14; i++) await page.keyboard.press("Backspace");
  await page.waitForFunction(() => /38 cycles a period/.test(document.getElementById("cycles").textContent));
  assert.match(await page.evaluate(() => getComputedStyle(document.getElementById("cycles"), "::after").content), /before the change/);
  await page.keyboard.press("Control+Enter");
  await page.waitForFunction(() => !document.body.classList.contains("stale"));
  await done(page);
  assert.deepEqual(await shown(), before);
  assert.deepEqual(errors, []);
});

test("the seconds of assembling are counted; hints that are late can be asked for again", limit, async () => {
  // The machine answers late, and the language server not at all until it is asked again; its limit comes sooner.
  const script = () => {
    const post = Worker.prototype.postMessage, set = window.setTimeout;
    window.setTimeout = (act, delay, ...rest) => set(act, delay === 20_000 && window.isDeaf ? 1500 : delay, ...rest);
    Worker.prototype.postMessage = function (data, ...rest) {
      if (data?.method === "lsp.check" && window.isDeaf) return;
      if (data?.method === "assemble" && window.isSlow) set(() => post.call(this, data, ...rest), 3600);
      else post.call(this, data, ...rest);
    };
  };
  const { page, errors } = await open("", { script });
  await done(page);
  await page.evaluate(() => (window.isSlow = true));
  await page.selectOption("#example", "statespace.s");
  await page.waitForFunction(() => /482 cycles a period.* · assembling it here, [12] s so far; 2 s on an idle computer …$/.test(document.getElementById("cycles").textContent));
  await page.waitForFunction(() => /assembling it here, [3-9] s so far; 2 s on an idle computer …$/.test(document.getElementById("cycles").textContent));
  await page.evaluate(() => ([window.isDeaf, window.isSlow] = [true, false]));
  await page.selectOption("#example", "gains.s");
  await page.waitForSelector("#notice:visible");
  assert.match(await page.textContent("#notice"), /^Cycles and mistakes beside the lines are not here yet: reading this text took more than 20 s\. Try again/);
  assert.ok(await page.evaluate(() => document.getElementById("notice").classList.contains("told")), "it is no alarm");
  await page.evaluate(() => (window.isDeaf = false));
  await page.click("#notice button:has-text('Try again')");
  await page.waitForSelector(".hint");
  await done(page);
  assert.doesNotMatch(await cycles(page), /assembling/);
  assert.deepEqual(errors, []);
});

test("a click on a hint puts the cursor into its line", limit, async () => {
  const { page, errors } = await open();
  await done(page);
  await page.waitForSelector(".hint");
  const hint = page.locator(".cm-line:has(.hint)").nth(2);
  const text = (await hint.textContent()).trim();
  await hint.locator(".hint").click();
  assert.equal((await page.locator(".cm-activeLine").textContent()).trim(), text);
  assert.ok(text.length > 0 && (await page.evaluate(() => document.activeElement.classList.contains("cm-content"))));
  assert.deepEqual(errors, []);
});

test("before a script has run, the menus say what opens first, and nothing can be pressed", limit, async () => {
  const page = await (await browser.newContext({ javaScriptEnabled: false })).newPage();
  contexts.push(page.context());
  await page.goto(address);
  assert.deepEqual([await page.textContent("#example"), await page.textContent("#machine")], ["gains.s: motor speed, equations", "t3"]);
  assert.equal(await page.locator(":is(header, main)[inert]").count(), 2);
});

test("titles of the menu are short, with the whole one beside; units and formulas stand at the sliders", limit, async () => {
  const { page, errors } = await open("#example=foc.s");
  await done(page);
  const titles = await page.locator("#example option").evaluateAll((options) => options.slice(1).map(({ textContent, title }) => [textContent.split(": ")[1], title]));
  for (const [short, whole] of titles) assert.ok(short.length <= 25 && whole.length > short.length, `${short}: ${whole}`);
  const row = (name) => page.locator("#tuning .constant", { has: page.locator(`b:text-is("${name}")`) });
  assert.equal(await row("DMAX").locator(".formula").textContent(), "= 0.95/sqrt(3)");
  assert.equal(await row("Ld").locator("small").textContent(), "H");
  assert.equal(await row("R").locator(".formula").textContent(), "");
  const field = row("DMAX").locator(".field"), kept = await field.inputValue();
  await field.fill("half");
  await page.keyboard.press("Enter");
  assert.equal(await field.evaluate((one) => one.validationMessage), `"half" is not a number: DMAX stays ${kept}`);
  assert.equal(await field.inputValue(), kept);
  await field.fill("0.5");
  await page.keyboard.press("Enter");
  await page.waitForFunction(() => /DMAX = 0\.5/.test(takt.text) && !takt.state.stale);
  await done(page);
  assert.equal(await row("DMAX").locator(".formula").textContent(), "", "a number is no formula");
  assert.deepEqual(errors, []);
});

test("a parameter keeps to its range, and a tap on a curve sets from when it acts", limit, async () => {
  const { page, errors } = await open("#example=gains.s", { viewport: { width: 390, height: 844 }, hasTouch: true, isMobile: true });
  await done(page);
  const field = page.locator("#parameters .constant", { hasText: "ki" }).locator(".field");
  await field.fill("1e9");
  await field.press("Enter");
  assert.equal(await field.evaluate((one) => one.validationMessage), "1e9 is above the largest value, 60: ki stays 4");
  assert.equal(await field.inputValue(), "4");
  assert.deepEqual(await page.evaluate(() => takt.state.parameters), {});
  await page.locator("#lead .u-over").tap();
  await page.waitForFunction(() => Number(document.getElementById("from").value) > 100);
  assert.deepEqual(errors, []);
});

test("a text is shown from its beginning until somebody steps", limit, async () => {
  const { page, errors } = await open("#example=foc.s", { viewport: { width: 1400, height: 600 } });
  await done(page);
  const top = () => page.evaluate(() => document.querySelector("#source .cm-scroller").scrollTop);
  assert.equal(await top(), 0);
  await page.keyboard.press("F10");
  await page.waitForFunction(() => document.querySelector("#source .cm-scroller").scrollTop > 0);
  assert.deepEqual(errors, []);
});

test("the elements of an array are chosen together, and single results are points", limit, async () => {
  const { page, errors } = await open("#example=lu.s");
  await done(page);
  const boxes = async () => (await page.locator("#choice label").allTextContents()).map((text) => text.trim());
  assert.deepEqual(await boxes(), ["x (4)", "singular", "A (in, 16)", "b (in, 4)"]);
  assert.match(await page.locator(".chart-head").first().textContent(), /^largest \|A·x − b\|/);
  await page.click("#choice label:has-text('x (4)') input");
  assert.ok(!(await page.locator(".chart-head").allTextContents()).some((text) => /x1/.test(text)));
  await page.click("#choice label:has-text('x (4)') input");
  const [download] = await Promise.all([page.waitForEvent("download"), page.click("#plot-svg")]);
  const svg = (await readFile(await download.path())).toString();
  assert.ok((svg.match(/<rect [^>]*fill="#2f6fbf"/g) ?? []).length >= 50, "points");
  await shot(page, "points");
  assert.deepEqual(errors, []);
});

test("on a telephone a finger finds the buttons, and the whole pipeline is in sight", limit, async () => {
  const { page, errors } = await open("", { viewport: { width: 390, height: 844 }, hasTouch: true, isMobile: true });
  await done(page);
  const small = await page.evaluate(() => [...document.querySelectorAll("button, select, summary, input:not([type=checkbox]), .file")].filter((one) => one.checkVisibility() && !one.closest(".cm-editor")).map((one) => [one.id || one.textContent.slice(0, 20), one.getBoundingClientRect().height]).filter(([, height]) => height > 0 && height < 31.5));
  assert.deepEqual(small, []);
  assert.equal(await page.evaluate(() => document.getElementById("tab-keys").checkVisibility()), false);
  await page.locator("#tab-pipeline").click();
  await page.waitForSelector("#pipeline-picture .tp-label");
  const sticks = await page.evaluate(() => Math.max(...[...document.querySelectorAll(".tp-operation rect")].map((one) => one.getBoundingClientRect().right)) - document.querySelector(".tp-scroll").getBoundingClientRect().right);
  assert.ok(sticks < 0, `the last cycle sticks out by ${sticks}`);
  await shot(page, "pipeline-finger");
  assert.deepEqual(errors, []);
});

test("the pipeline and its heading are dimmed once while they are of another program", limit, async () => {
  const { page, errors } = await open();
  await done(page);
  await page.click("#tab-pipeline");
  await page.waitForFunction(() => /pi\.s on t3, period 2: 38 cycles/.test(document.getElementById("drawn").textContent));
  // Effective opacity of an element: the product over its ancestors.
  const seen = (selector) => page.evaluate((selector) => {
    let product = 1;
    for (let one = document.querySelector(selector); one; one = one.parentElement) product *= Number(getComputedStyle(one).opacity);
    return product;
  }, selector);
  const parts = ["#drawn", "#pipeline-picture .tp-chart", "#pipeline-picture .tp-legend"];
  const all = async () => Promise.all(parts.map(seen));
  assert.deepEqual(await all(), [1, 1, 1]);
  assert.equal(await seen("#draw"), 1);
  const dimmed = async (why) => {
    for (const [i, part] of (await all()).entries()) assert.ok(part > 0.3 && part < 0.5, `${why}: ${parts[i]} has ${part}`);
    assert.equal(await seen("#draw"), 1, why);
  };
  // In one evaluation, so that nothing is redrawn before the check.
  const changed = await page.evaluate(() => {
    const machine = document.getElementById("machine");
    machine.value = "t1";
    machine.dispatchEvent(new Event("change"));
    return ["#drawn", "#pipeline-picture"].map((one) => Number(getComputedStyle(document.querySelector(one)).opacity));
  });
  assert.ok(changed.every((opacity) => opacity < 0.5), `${changed}: the machine is another one`);
  await page.waitForFunction(() => /pi\.s on t1/.test(document.getElementById("drawn").textContent));
  assert.deepEqual(await all(), [1, 1, 1]);
  // The program changes while the diagram is hidden; the diagram is then shown with a mistake in the text.
  await page.click("#tab-step");
  await page.selectOption("#machine", "t3");
  await page.waitForFunction(() => takt.state.run && /on t3/.test(document.getElementById("cycles").textContent));
  await page.evaluate(() => takt.goTo(1));
  await page.keyboard.press("End");
  await page.keyboard.press("Enter");
  await page.keyboard.type("  fad e, e, e");
  await page.waitForFunction(() => /does not assemble/.test(document.getElementById("cycles").textContent));
  await page.click("#tab-pipeline");
  await dimmed("a mistake in the text, and a picture of the machine before");
  await shot(page, "pipeline-stale");
  // If a text has never assembled, there is no diagram, and the message refers to this text.
  await page.evaluate((hash) => (location.hash = hash), link({ name: "a.s", machine: "t3", source: "start:\n    fmull y, x, x\n" }));
  await page.waitForFunction(() => /The program does not assemble/.test(document.getElementById("drawn").textContent));
  assert.equal(await seen("#drawn"), 1);
  assert.deepEqual(errors, []);
});

test("plots have units, limits and what is no number; without numbers they say why", limit, async () => {
  const { page, errors } = await open();
  await done(page);
  await page.click("#tab-plot");
  await page.locator("#charts canvas").first().waitFor();
  assert.match(await page.locator(".chart-head").first().textContent(), /^w, w_ref, rad\/s *$/, "first what follows a reference");
  assert.match(await page.locator(".chart-head").nth(1).textContent(), /^u, V at its limit in 8\d periods *$/);
  assert.match(await page.textContent("#given"), /^DC motor with a load gives w: a table's columns of these names are not read\.$/);
  const fills = await page.evaluate(() => [document.getElementById("charts").getBoundingClientRect().bottom, document.getElementById("plot").getBoundingClientRect().bottom]);
  assert.ok(fills[1] - fills[0] < 60, `the charts end at ${fills[0]}, the panel at ${fills[1]}`);
  // Cursors of all charts are synchronised.
  await page.locator(".u-over").first().hover();
  await page.waitForFunction(() => {
    const told = [...document.querySelectorAll(".chart-head .at")].map((one) => one.textContent.split(":")[0]);
    return told.length === 2 && /^period \d+, [\d.]+ ms$/.test(told[0]) && told[0] === told[1];
  });
  await shot(page, "plot");
  assert.ok(await page.evaluate(() => takt.state.program.blank));
  // The plant's file states the other input.
  assert.equal(await page.locator(".why").count(), 0);
  assert.ok((await values(page, "w_ref")).every((one, i) => one === (i < 200 ? 100 : -100)));
  const speed = await values(page, "w");
  assert.ok(Math.abs(speed[99] - 100) < 1 && Math.abs(speed[399] + 100) < 1, "the motor follows");
  await page.selectOption("#plant-name", "");
  await page.waitForFunction(() => /There are no inputs: all 2 input ports are 0/.test(document.querySelector(".why")?.textContent));
  await done(page);
  await write(page, ".input x\n.output y, z\n.period\nstart:\n    fdiv y, x, x\n    fadd z, x, x\n    wait start\n");
  await page.waitForFunction(() => document.querySelector(".chart-head .lost"));
  assert.match(await page.locator(".chart-head").first().textContent(), /no number in 400 periods: NaN/);
  await write(page, "start:\n    halt\n");
  await page.waitForFunction(() => /nothing to plot/.test(document.querySelector(".why")?.textContent));
  assert.deepEqual(errors, []);
});

/** Values of a port in the last run. */
const values = (page, name) => page.evaluate((name) => takt.state.run.outputs[name] ?? takt.state.run.inputs[name], name);

test("a slider writes a constant, moves a trace, and leaves the trace before pale behind", limit, async () => {
  const { page, errors } = await open();
  await done(page);
  const before = await values(page, "u"), speed = await values(page, "w");
  const pale = () => page.evaluate(() => {
    const canvas = document.querySelectorAll("#charts canvas")[1], { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    let count = 0;
    // The curve's blue, of which two fifths cover what is behind; the full curve has such points at its edges only.
    for (let i = 0; i < data.length; i += 4) count += data[i + 2] - data[i] > 130 && Math.abs(data[i + 3] - 0x66) < 8;
    return count;
  });
  const none = await pale();
  const slider = page.locator("#tuning .constant", { hasText: "KP" }).locator("input[type=range]"), box = await slider.boundingBox();
  const text = await page.evaluate(() => takt.text);
  await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
  await page.mouse.down();
  for (let i = 1; i <= 20; i++) await page.mouse.move(box.x + (box.width / 2) * (1 + i / 40), box.y + box.height / 2);
  await page.waitForFunction((before) => !takt.state.stale && takt.state.run?.outputs.u.some((value, i) => value !== before[i]), before);
  await page.mouse.up();
  await page.waitForFunction(() => !takt.state.stale && !document.getElementById("assemble").disabled);
  const written = /\.const +KP += (\S+)/.exec(await page.evaluate(() => takt.text))[1];
  assert.ok(Number(written) > 1 && Number(written) <= 1.6, `KP = ${written} in the text`);
  const column = (source) => source.split("\n").find((line) => /KP +=/.test(line)).indexOf(";");
  assert.equal(column(await page.evaluate(() => takt.text)), column(text), "the comment keeps its column");
  assert.match(await page.textContent(".ghost"), /pale: before, with KP = 0\.8/);
  assert.ok((await pale()) > none + 40, `${await pale()} pale points, ${none} without a slider`);
  // The text that the slider has written is the text that runs elsewhere.
  const moved = await values(page, "u");
  const { page: other } = await open(link({ name: "pi.s", machine: "t3", source: await page.evaluate(() => takt.text), periods: 400, plant: { name: "dc_motor" } }));
  await done(other);
  assert.deepEqual(await values(other, "u"), moved);
  assert.ok((await values(page, "w")).some((value, i) => Math.abs(value - speed[i]) > 1), "the motor turns otherwise");
  await shot(page, "slider");
  await page.click("#tuning button");
  await page.waitForFunction((text) => takt.text === text && !takt.state.stale && !document.getElementById("assemble").disabled, text);
  assert.deepEqual(await values(page, "u"), before);
  assert.ok(await page.isDisabled("#tuning button"));
  // A number beyond the range moves the range's end; a value that the program cannot have is told, and the slider leads back.
  const field = page.locator("#tuning .constant", { hasText: "TT" }).locator(".field");
  await field.fill("0.5");
  await field.press("Enter");
  await page.waitForFunction(() => /TT += 0\.5 /.test(takt.text) && !takt.state.stale);
  assert.equal(await page.locator("#tuning .constant", { hasText: "TT" }).locator(".end").last().inputValue(), "0.5");
  await field.fill("0");
  await field.press("Enter");
  await page.waitForFunction(() => /does not assemble/.test(document.getElementById("cycles").textContent));
  assert.ok(await page.isEnabled("#tuning fieldset"));
  // A program with errors has no image: the page says so.
  await page.click("#export summary");
  await page.click("[data-export=image]");
  await page.waitForFunction(() => /correct them first/.test(document.getElementById("notice").textContent));
  await page.click("#tuning button");
  await page.waitForFunction((text) => takt.text === text && !takt.state.stale && !document.body.classList.contains("stale"), text);
  assert.deepEqual(errors, []);
});

test("curves follow a slider although a run takes long, and a double click sets no period", limit, async () => {
  const { page, errors } = await open("#example=gains.s");
  await done(page);
  const seen = await page.evaluate(async () => {
    const slider = document.querySelector("#parameters [type=range]"), runs = new Set();
    takt.state.took = 2000;
    for (let i = 0; i < 40; i++) {
      slider.value = 0.3 + i / 50;
      slider.dispatchEvent(new Event("input", { bubbles: true }));
      await new Promise((resolve) => setTimeout(resolve, 100));
      runs.add(takt.state.run);
    }
    return runs.size;
  });
  assert.ok(seen > 3, `${seen} runs while the slider moved`);
  await page.waitForFunction(() => !takt.state.stale);
  await done(page);
  const chart = await page.locator("#charts .u-over").first().boundingBox();
  await page.mouse.dblclick(chart.x + 0.3 * chart.width, chart.y + chart.height / 2);
  await page.waitForTimeout(600);
  assert.equal(await page.inputValue("#from"), "1");
  assert.deepEqual(errors, []);
});

test("keys move a slider as a drag does: the curve before is that before the first of them", limit, async () => {
  const { page, errors } = await open();
  await done(page);
  const slider = page.locator("#tuning .constant", { hasText: "KP" }).locator("input[type=range]");
  const press = async (key) => {
    const text = await page.evaluate(() => takt.text);
    await page.keyboard.press(key);
    await page.waitForFunction((text) => takt.text !== text && !takt.state.stale && !document.getElementById("assemble").disabled, text);
  };
  // The clock of the page stands still between the presses, however busy the machine is.
  await page.evaluate(() => {
    globalThis.clock = performance.now();
    performance.now = () => globalThis.clock;
  });
  await slider.focus();
  for (let i = 0; i < 3; i++) await press("ArrowRight");
  assert.match(await page.textContent(".ghost"), /pale: before, with KP = 0\.8$/);
  // After a pause, another movement begins.
  await page.evaluate(() => (globalThis.clock += 3000));
  await press("ArrowRight");
  assert.match(await page.textContent(".ghost"), /pale: before, with KP = 0\.8[0-9]+$/);
  assert.deepEqual(errors, []);
});

test("the page stays where it is when a second document is opened", limit, async () => {
  const { page, errors } = await open();
  await done(page);
  const tops = () => page.evaluate(() => ["summary", "side", "charts"].map((id) => document.getElementById(id).getBoundingClientRect().top));
  const before = (await tops()).slice(0, 2), text = () => page.evaluate(() => document.querySelector(".cm-editor").getBoundingClientRect().top), editor = await text();
  await write(page, `${await example("blink.s")}; mine\n`);
  await page.waitForFunction(() => !takt.state.stale && takt.state.program?.assembled);
  await page.selectOption("#example", "gains.s");
  await page.waitForFunction(() => takt.state.name === "gains.s" && document.querySelectorAll("#documents > span").length === 2);
  assert.deepEqual((await tops()).slice(0, 2), before);
  assert.equal(await text(), editor);
  assert.deepEqual(errors, []);
});

test("no button offers to run a text with a mistake", limit, async () => {
  const { page, errors } = await open();
  await done(page);
  await page.evaluate(() => (takt.state.took = 5000));
  await page.evaluate(() => takt.goTo(1));
  await page.keyboard.press("End");
  await page.keyboard.type("x");
  await page.waitForSelector("#wait", { state: "visible" });
  await page.keyboard.press("Enter");
  await page.keyboard.type("  fad e, e, e");
  await page.waitForFunction(() => /does not assemble: line 2/.test(document.getElementById("cycles").textContent));
  assert.ok(await page.isHidden("#wait"));
  // Once the mistake is gone, it is there again.
  for (let i = 0; i < 14; i++) await page.keyboard.press("Backspace");
  await page.waitForSelector("#wait", { state: "visible" });
  assert.deepEqual(errors, []);
});

test("each example says for whom it is and what to try, and has a time axis", limit, async () => {
  const { page, errors } = await open();
  await done(page);
  const names = (await page.locator("#example option").evaluateAll((options) => options.map((one) => one.value))).filter(Boolean);
  for (const name of names) {
    await page.selectOption("#example", name);
    await page.waitForFunction((name) => takt.state.name === name && takt.state.run, name);
    assert.match(await page.textContent("#try"), /^For .+\. Try .+\.$/, name);
    // The equations of lu.s have nothing to do with time.
    if (!["lu.s", "tracking.s"].includes(name)) assert.match(await page.inputValue("#axis"), /^m?s$/, name);
  }
  await page.selectOption("#example", "kalman.s");
  await page.waitForFunction(() => takt.state.name === "kalman.s" && takt.state.run && !takt.state.ahead && !document.getElementById("assemble").disabled);
  assert.deepEqual(await page.locator("#tuning .constant b").allTextContents(), ["QA", "RX", "P0"]);
  // A text of one's own has no such line.
  await write(page, `${await example("blink.s")}; mine\n`);
  await page.reload();
  await page.waitForSelector("body[data-ready]");
  assert.equal(await page.textContent("#try"), "");
  assert.deepEqual(errors, []);
});

test("a plant closes the loop: its sliders move what it gives, and links carry it", limit, async () => {
  const { page, errors } = await open();
  await done(page);
  assert.equal(await page.locator("#plant-name option:checked").textContent(), "DC motor with a load: w");
  const light = await values(page, "w");
  assert.ok(Math.abs(light[95] - 100) < 3, `the controller reaches its reference: ${light[95]}`);
  const load = page.locator("#plant .constant", { hasText: "load" }).first(), field = load.locator(".field");
  assert.equal(await load.getAttribute("title"), "torque of the load, against the motor's");
  await page.click("#plant summary");
  await field.fill("1.2");
  await field.press("Enter");
  await page.waitForFunction((light) => !takt.state.stale && takt.state.run?.inputs.w[130] < light[130] - 5, light);
  assert.ok(Math.abs(light[95] - 100) < 3);
  await done(page);
  assert.match(await page.textContent(".ghost"), /pale: before, with load = 0\.4/);
  const heavy = await values(page, "w");
  assert.deepEqual(heavy.slice(0, 100), light.slice(0, 100), "the load comes after 0.1 s");
  await shot(page, "plant");
  await page.click("#link");
  await page.waitForFunction(() => location.hash.startsWith("#p1="));
  const { page: other } = await open(await page.evaluate(() => location.hash));
  await done(other);
  assert.deepEqual(await values(other, "w"), heavy);
  // A reload shows the document with its plant.
  await page.reload();
  await page.waitForSelector("body[data-ready]");
  await done(page);
  assert.deepEqual(await values(page, "w"), heavy);
  // A value that the plant cannot have is refused at its field.
  await page.click("#plant summary");
  const inertia = page.locator("#plant .constant", { hasText: "J" }).locator(".field");
  await inertia.fill("-1");
  await page.keyboard.press("Enter");
  assert.equal(await inertia.evaluate((one) => one.validationMessage), "-1 is not above 0: J stays 7e-4");
  // A link may have one: it opens the loop, and the page says why.
  await page.evaluate(() => {
    takt.state.plant = { ...takt.state.plant, parameters: { J: -1 } };
    document.getElementById("assemble").click();
  });
  await page.waitForFunction(() => /the loop is open: the parameter `J` of `dc_motor` is -1; expected a positive number/.test(document.getElementById("cycles").textContent));
  await inertia.fill("7e-4");
  await page.keyboard.press("Enter");
  await page.waitForFunction(() => !/open/.test(document.getElementById("cycles").textContent) && !takt.state.stale);
  // A record of the loop gives the same without the plant.
  await done(page);
  const u = await values(page, "u");
  await page.click("#tab-inputs");
  await page.click("#fill");
  await page.waitForFunction(() => !takt.state.stale && !takt.state.program.blank);
  await page.click("#tab-plot");
  await page.selectOption("#plant-name", "");
  await page.waitForFunction(() => !takt.state.stale && takt.state.program?.plant === null && takt.state.run);
  assert.deepEqual(await values(page, "u"), u);
  assert.ok(await page.isHidden("#plant"));
  // Without plant and table, a port whose range leaves 0 out is not 0: no output is NaN.
  await page.selectOption("#example", "foc.s");
  await page.waitForFunction(() => takt.state.name === "foc.s" && !takt.state.stale && takt.state.run);
  await done(page);
  await page.selectOption("#plant-name", "");
  await page.waitForFunction(() => /all 7 input ports are 0, but udc 18 /.test(document.querySelector(".why")?.textContent));
  assert.ok((await values(page, "da")).every((one) => typeof one === "number"), "duties are numbers");
  assert.deepEqual(errors, []);
});

test("a parameter's slider moves a trace without another assembly, within its range, and links carry it", limit, async () => {
  const { page, errors } = await open();
  await done(page);
  const source = ".param k = 2.0 range 0..50 ; V\n.input x\n.output y ; V\n.period\np: fmul y, x, k\n wait p\n";
  const hash = await page.evaluate(async (source) => {
    const bytes = new TextEncoder().encode(JSON.stringify({ name: "k.s", machine: "t3", source, inputs: "x\n1\n2\n3\n" }));
    const packed = new Uint8Array(await new Response(new Blob([bytes]).stream().pipeThrough(new CompressionStream("deflate"))).arrayBuffer());
    return `#p1=${btoa(String.fromCharCode(...packed)).replaceAll("+", "-").replaceAll("/", "_").replace(/=+$/, "")}`;
  }, source);
  await page.evaluate((hash) => (location.hash = hash), hash);
  await page.waitForFunction(() => takt.state.name === "k.s" && takt.state.run);
  await done(page);
  assert.deepEqual(await values(page, "y"), [2, 4, 6]);
  const row = page.locator("#parameters .constant", { hasText: "k" });
  assert.deepEqual(await row.locator(".end").evaluateAll((ends) => ends.map((end) => end.value)), ["0", "50"], "the range in the source");
  for (const [place, text, why] of [
    ["first", "5", "k is 2, below 5: Least value of k stays 0"],
    ["last", "1.5", "k is 2, above 1.5: Largest value of k stays 50"],
    ["last", "much", '"much" is not a number: Largest value of k stays 50'],
    ["last", "51", "51 is above the largest value, 50: Largest value of k stays 50"],
  ]) {
    const end = row.locator(".end")[place]();
    await end.fill(text);
    await end.press("Enter");
    assert.equal(await end.evaluate((one) => one.validationMessage), why);
  }
  await row.locator(".field").fill("5");
  await row.locator(".field").press("Enter");
  await page.waitForFunction(() => !takt.state.stale && takt.state.run?.outputs.y[2] === 15);
  assert.equal(await page.evaluate(() => takt.text), source, "the text stays as it is");
  assert.match(await page.textContent(".ghost"), /pale: before, with k = 2/);
  await page.click("#link");
  await page.waitForFunction((hash) => location.hash.startsWith("#p1=") && location.hash !== hash, hash);
  const { page: other } = await open(await page.evaluate(() => location.hash));
  await done(other);
  assert.deepEqual(await values(other, "y"), [5, 10, 15]);
  await page.click("#parameters button");
  await page.waitForFunction(() => !takt.state.stale && takt.state.run?.outputs.y[2] === 6);
  assert.deepEqual(errors, []);
});

test("a range of the pipeline says its sums", limit, async () => {
  const { page, errors } = await open();
  await done(page);
  await page.click("#tab-pipeline");
  await page.waitForSelector("#pipeline-picture .tp-label");
  const sums = () => page.textContent("#pipeline-picture .tp-sums");
  assert.match(await sums(), /drag along the cycles/);
  // Columns 5 to 11, counted from 0: cycles 6 to 12 of pi.s.
  const place = await page.evaluate(() => {
    const { x, y } = document.querySelector("#pipeline-picture .tp-chart").getBoundingClientRect(), boxes = [...document.querySelectorAll("#pipeline-picture .tp-issue")].map((one) => one.getBoundingClientRect());
    return { y: y + 8, from: boxes[1].x + boxes[1].width / 2, to: boxes[3].x + 1.5 * boxes[3].width };
  });
  await page.mouse.move(place.from, place.y);
  await page.mouse.down();
  await page.mouse.move(place.to, place.y);
  await page.mouse.up();
  assert.match(await sums(), /^cycles 6 to 12: 7 · 3 bundles, 3 operations \(multiply 2, add 1\) · 4 cycles stalled \(operand 4\)/);
  assert.ok(await page.locator("#pipeline-picture .tp-range").count());
  await shot(page, "range");
  // By keys: the row with the focus begins and ends it.
  await page.locator("#pipeline-picture .tp-label").nth(4).focus();
  await page.keyboard.press("]");
  assert.match(await sums(), /^cycles 6 to 16: 11/);
  await page.keyboard.press("Escape");
  assert.match(await sums(), /drag along the cycles/);
  assert.deepEqual(errors, []);
});

test("two machines, and a text before and after a change, stand side by side with the differences by line", limit, async () => {
  const { page, errors } = await open();
  await done(page);
  requests = [];
  await page.click("#tab-pipeline");
  await page.waitForSelector("#pipeline-picture .tp-label");
  assert.deepEqual(requests, [], "the comparison is loaded when it is asked for");
  await page.selectOption("#against", "on t1");
  assert.ok(await page.isVisible("#pipeline-picture .tp-label") || await page.isVisible(".compare-total"), "a picture stays until the other side is there");
  await page.waitForFunction(() => /^on t3: 38 → on t1: 65 cycles in the period \(\+27, \+71\.1 %\)/.test(document.querySelector(".compare-total")?.textContent ?? ""));
  assert.ok(requests.length > 0 && requests.every((path) => path.startsWith("/parts/") || path === "/worker.js"), `${requests}`);
  assert.equal(await page.locator(".compare-pipeline .tp-scroll").count(), 2);
  // Ten cycles are as wide in both pictures.
  const tens = await page.locator(".compare-pipeline .tp-axis").evaluateAll((axes) => axes.map((axis) => {
    const at = (cycle) => Number([...axis.querySelectorAll("text")].find(({ textContent }) => textContent === cycle).getAttribute("x"));
    return at("20") - at("10");
  }));
  assert.ok(tens[0] > 0 && tens[0] === tens[1], `${tens}`);
  const row = (text) => page.locator(".compare-lines tbody tr", { hasText: text }).locator("td").allTextContents();
  assert.deepEqual(await row("fmul p, e, KP"), ["28", "fmul    p, e, KP", "1", "5", "8", "+3"]);
  const total = () => page.locator(".compare-lines tfoot td").allTextContents();
  assert.deepEqual((await total()).slice(3), ["38", "65", "+27"], "the lines have the cycles of the period together");
  await shot(page, "compare-machines");
  // A line that is changed stands beside the line that it was, and lines that moved are no difference.
  await page.selectOption("#against", "opened");
  const changed = (await example("pi.s")).replace("; A PI", "; Another\n; A PI").replace("fmul    back, back, T/TT", "fdiv    back, back, TT");
  await write(page, changed);
  await page.keyboard.press("Control+Enter");
  await page.waitForFunction(() => /^as opened, on t3: 38 → now, on t3: 44 cycles in the period \(\+6, \+15\.8 %\).*stalled by operand 24 → 30$/.test(document.querySelector(".compare-total").textContent));
  // The sum waits for the quotient.
  assert.deepEqual(await page.locator(".compare-lines tbody tr").evaluateAll((rows) => rows.map((row) => [...row.cells].map(({ textContent }) => textContent))), [["36 → 37", "fadd    di, di, back", "1", "5", "11", "+6"], ["34 → 35", "fdiv    back, back, TT", "1", "5", "5", "="]]);
  assert.equal(await page.locator(".compare-lines .was").getAttribute("title"), "before: fmul    back, back, T/TT");
  await shot(page, "compare-change");
  // What was kept, with sliders, plant and all.
  await page.click("#keep");
  await page.waitForFunction(() => /^kept, on t3: (\d+) → now, on t3: \1 cycles in the period \(the same\)/.test(document.querySelector(".compare-total").textContent));
  await page.selectOption("#against", "");
  await page.locator("#pipeline-picture").waitFor();
  assert.ok(await page.isHidden("#comparison"));
  assert.deepEqual(errors, []);
});

test("bundles have the colours of their lines, and follow the debugger", limit, async () => {
  const { page, errors } = await open();
  await done(page);
  await page.click("#tab-code");
  const cell = page.locator(".code td[data-key]", { hasText: "fmul p, e" }), line = page.locator(".cm-line.cm-hue", { hasText: "fmul    p, e, KP" });
  await cell.waitFor();
  const colour = (one) => one.evaluate((element) => getComputedStyle(element).backgroundColor);
  const passive = await colour(line);
  assert.equal(await colour(cell), passive);
  const hues = await page.locator(".code td[data-key]").evaluateAll((cells) => cells.map((one) => getComputedStyle(one).backgroundColor));
  assert.ok(hues.length === 13 && new Set(hues).size === 13 && hues.every((one) => one !== "rgba(0, 0, 0, 0)"), `${hues}`);
  await cell.click();
  assert.equal(await page.locator(".cm-activeLineGutter").first().textContent(), "28");
  assert.match(await page.locator(".code td.on").textContent(), /fmul p, e/);
  const active = page.locator(".cm-line.cm-activeLine.cm-hue");
  assert.equal(await colour(active), passive, "the cursor's line keeps its colour");
  await shot(page, "code");
  await page.keyboard.press("F10");
  await page.waitForFunction(() => document.getElementById("head").textContent.includes("bundle 0"));
  await done(page);
  await page.keyboard.press("F10");
  await page.waitForFunction(() => document.getElementById("head").textContent.includes("bundle 1"));
  await page.click("#tab-code");
  await page.waitForFunction(() => document.querySelector(".code .next th")?.textContent === "1");
  assert.ok((await page.locator(".cm-hue").count()) > 5);
  await page.click("#tab-plot");
  assert.equal(await page.locator(".cm-hue").count(), 0, "the text has its colours only beside the bundles");
  assert.deepEqual(errors, []);
});

test("the code begins with the period, and says where the outputs are out", limit, async () => {
  const { page, errors } = await open("#example=foc_early.s", { viewport: { width: 1600, height: 900 } });
  await done(page);
  await page.click("#tab-code");
  const fold = page.locator(".code .fold button"), row = (text) => page.locator(".code tbody tr", { hasText: text });
  assert.equal(await fold.textContent(), "▸ before the first period: 5 bundles");
  assert.ok(await page.isHidden(".code tr:has(th:text-is('0'))"));
  assert.match(await page.locator(".published").textContent(), /the outputs are out/);
  const [before, mark] = [await row("publish").first().boundingBox(), await page.locator(".published").boundingBox()];
  assert.ok(before.y < mark.y && mark.y - before.y < 60, "the mark stands below the operation");
  // All slots have room.
  assert.equal(await page.locator(".code-scroll").evaluate((box) => box.scrollWidth > box.clientWidth), false);
  await fold.click();
  assert.ok(await page.isVisible(".code tr:has(th:text-is('0'))"));
  await fold.click();
  // The cursor's line unfolds it.
  await page.evaluate(() => takt.goTo(takt.text.split("\n").findIndex((line) => line.includes(".once")) + 2));
  await page.waitForFunction(() => !document.querySelector(".code .on")?.closest("tbody").hidden);
  assert.deepEqual(errors, []);
});

test("of many ports those that are not plotted are offered when they are asked for", limit, async () => {
  const { page, errors } = await open("#example=tracking.s");
  await done(page);
  const more = page.locator("#choice button");
  assert.match(await more.textContent(), /^\d+ more ports$/);
  const [few, all] = [await page.locator("#choice label:visible").count(), await page.locator("#choice label").count()];
  assert.ok(few < 8 && all > 30, `${few} of ${all}`);
  await more.click();
  assert.equal(await page.locator("#choice label:visible").count(), all);
  assert.match(await page.locator("#cycles").textContent(), /^tracking\.s on t3: 112 cycles a period, 0\.896 µs at 125 MHz \(the first 117\)/);
  assert.deepEqual(errors, []);
});

test("the picture of the machine lights up while stepping", limit, async () => {
  const { page, errors } = await open();
  await done(page);
  await page.click("#tab-step");
  // Where there is room, it is open.
  await page.waitForSelector(".machine");
  assert.equal(await page.locator(".machine .mp-stage").count(), 5 + 5 + 14 + 24 + 30 + 5 + 2 + 11 + 4 + 1, "a cell for each cycle of each unit of t3");
  await page.fill("#command", "goto cycle 25");
  await page.keyboard.press("Enter");
  // The sum takes the product in the cycle of its writeback, and the integrator from its bank.
  await page.waitForFunction(() => /forwarded in the cycle of issue: p\./.test(document.querySelector(".machine-text").textContent));
  assert.deepEqual([await page.locator(".mp-forward").count(), await page.locator(".mp-read").count()], [1, 1]);
  assert.match((await page.locator(".machine .mp-text").allTextContents()).join("; "), /cycle 25: bundle 5 \(pi\.s:29\) issues.*fadd v, p, s/);
  await shot(page, "machine");
  await page.fill("#command", "goto cycle 27");
  await page.keyboard.press("Enter");
  await page.waitForFunction(() => /cycle 27: bundle 6 .* waits: awaits v/.test(document.querySelector(".machine .mp-stall")?.textContent ?? ""));
  await page.selectOption("#machine", "t4");
  await page.waitForFunction(() => document.querySelector(".machine").getAttribute("aria-label") === "The machine t4: 4 slots");
  assert.deepEqual(errors, []);
});

test("a parameter that is set in the middle of a run acts on the rest of it", limit, async () => {
  const { page, errors } = await open("#example=gains.s");
  await done(page);
  const before = await values(page, "w");
  assert.ok(before.length === 400 && Math.abs(before[99] - 100) < 5);
  // A click on a curve sets the period.
  const chart = await page.locator("#charts .u-over").first().boundingBox();
  await page.mouse.click(chart.x + 0.15 * chart.width, chart.y + chart.height / 2);
  await page.waitForFunction(() => Number(document.getElementById("from").value) > 1);
  const from = Number(await page.inputValue("#from"));
  assert.ok(Math.abs(from - 60) < 8, `${from}`);
  const slider = page.locator("#parameters .constant", { hasText: "ki" }).locator("input[type=range]"), box = await slider.boundingBox();
  await page.mouse.move(box.x + box.width * 0.1, box.y + box.height / 2);
  await page.mouse.down();
  for (const part of [0.3, 0.5, 0.7]) await page.mouse.move(box.x + box.width * part, box.y + box.height / 2);
  await page.mouse.up();
  await page.waitForFunction(() => !takt.state.stale && takt.state.changes[0]?.value > 35);
  await done(page);
  const after = await values(page, "w"), same = after.findIndex((value, i) => value !== before[i]);
  // The plant answers one period after the output.
  assert.ok(same >= from && same <= from + 2, `the curve differs from period ${same + 1} on`);
  assert.match(await page.textContent(".ghost"), /pale: before, with ki = 4/);
  assert.match(await page.textContent("#changes"), new RegExp(`ki = \\d+(\\.\\d+)? from ${from}`));
  await shot(page, "parameter-from");
  await page.click("#link");
  await page.waitForFunction(() => location.hash.startsWith("#p1="));
  const { page: other } = await open(await page.evaluate(() => location.hash));
  await done(other);
  assert.deepEqual(await values(other, "w"), after, "links carry it");
  await page.click("#parameters > button");
  await page.waitForFunction(() => !takt.state.stale && !takt.state.changes.length);
  await done(page);
  assert.deepEqual(await values(page, "w"), before);
  assert.deepEqual(errors, []);
});

test("a text has its own choice of ports, its values as written, and a number beside another of its name", limit, async () => {
  assert.deepEqual([0.3, 0.1, 1 / 3, 4, 1e-9, 16777216].map((value) => binary32(Math.fround(value))), ["0.3", "0.1", "0.33333334", "4", "1e-9", "16777216"]);
  assert.deepEqual([0.1 + 0.2, NaN, -Infinity].map(binary32), ["0.30000000000000004", "NaN", "-Infinity"]);
  const { page, errors } = await open("#example=tracking.s");
  const shows = async (name) => {
    await page.waitForFunction((name) => takt.state.name === name && takt.state.run && takt.state.program, name);
    await done(page);
  };
  const box = (name) => page.locator("#choice label", { hasText: name }).locator("input");
  await shows("tracking.s");
  await page.selectOption("#example", "biquads.s");
  await shows("biquads.s");
  assert.ok(await box("x (in)").isChecked(), "the robot's program has an input x, too, which is not plotted");
  await page.selectOption("#example", "gains.s");
  await shows("gains.s");
  for (const yours of ["yours", "yours, 2"]) {
    const field = page.locator("#parameters .constant", { hasText: "kp" }).locator(".field");
    await field.fill("0.5");
    await field.press("Enter");
    await page.waitForFunction(() => !takt.state.stale && Object.keys(takt.state.parameters).length);
    await done(page);
    assert.equal(await page.textContent(".ghost"), "pale: before, with kp = 0.3");
    await page.waitForFunction((yours) => document.querySelector("#documents .here small").textContent === yours, yours);
    if (yours !== "yours") continue;
    await page.selectOption("#example", "gains.s");
    await page.waitForFunction(() => !Object.keys(takt.state.parameters).length);
    await shows("gains.s");
  }
  assert.deepEqual(errors, []);
});

test("the curves of an example that takes long are there before it is assembled, and stay", limit, async () => {
  const { page, errors } = await open();
  await done(page);
  const early = await page.evaluate(async () => {
    const example = document.getElementById("example");
    example.value = "statespace.s";
    example.dispatchEvent(new Event("change"));
    while (!takt.state.ahead) await new Promise((resolve) => setTimeout(resolve, 5));
    document.getElementById("tab-pipeline").click();
    const rows = document.querySelectorAll("#pipeline-picture .tp-label").length;
    document.getElementById("tab-plot").click();
    return { rows, run: takt.state.run, charts: document.querySelectorAll("#charts canvas").length, cycles: document.getElementById("cycles").textContent, step: document.getElementById("head").textContent };
  });
  assert.match(early.cycles, /statespace\.s on t3: 482 cycles a period, 3\.86 µs.*assembling it here/);
  assert.match(early.step, /^cycle 0, period 0.*assembling it here/);
  assert.ok(early.charts > 0 && early.rows > 5, `${early.charts} charts and ${early.rows} rows of the pipeline`);
  await page.waitForFunction(() => takt.state.run && !takt.state.ahead && !document.getElementById("assemble").disabled);
  assert.deepEqual(await page.evaluate(() => takt.state.run), early.run, "this page's run is the build's");
  assert.deepEqual(errors, []);
});

test("examples that are chosen quickly end in the last one, without a word about the others, in one tab", limit, async () => {
  const { page, errors } = await open();
  await done(page);
  const names = (await page.locator("#example option").evaluateAll((options) => options.map((one) => one.value))).filter(Boolean);
  assert.equal(names.length, 12);
  for (const name of [...names, ...names.slice(0, 4), "gains.s"]) {
    await page.selectOption("#example", name);
    await page.waitForTimeout(70);
  }
  await page.waitForFunction(() => takt.state.name === "gains.s" && takt.state.run && !takt.state.ahead && !document.getElementById("assemble").disabled);
  // The language server is that of the last text.
  await page.waitForSelector(".lens");
  assert.match((await page.locator(".lens").allTextContents()).join("; "), /33 cycles/);
  assert.ok(await page.isHidden("#notice"));
  assert.equal(await page.locator("#documents > span").count(), 1, "nothing was edited: there is one document");
  assert.deepEqual(errors, []);
});

test("the robot and its path are there before the program is assembled", limit, async () => {
  const { page, errors } = await open();
  await done(page);
  const early = await page.evaluate(async () => {
    const example = document.getElementById("example");
    example.value = "tracking.s";
    example.dispatchEvent(new Event("change"));
    while (!takt.drive?.robot.poses.length) await new Promise((resolve) => setTimeout(resolve, 5));
    const canvas = document.getElementById("scene");
    let drawn = 0;
    // On a busy machine the drawing may be some frames late.
    for (let frame = 0; frame < 100 && !drawn; frame++) {
      await new Promise((resolve) => requestAnimationFrame(resolve));
      const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
      for (let i = 3; i < data.length; i += 4) drawn += data[i] > 0;
    }
    return { drawn, tracks: takt.state.shown?.tracks, drove: document.getElementById("drove").textContent };
  });
  assert.ok(early.drawn > 5000 && !early.tracks, `${early.drawn} points, before the program is assembled`);
  assert.match(early.drove, /34\.7 s of path; 112 cycles a period, .* 7\.8\d µm cutting, .*when this page was built/);
  // The page's own program repeats the drive; on another machine it is another one.
  await done(page);
  await page.waitForFunction(() => takt.state.shown && !takt.state.stale);
  const isOld = () => page.evaluate(() => document.getElementById("robot").classList.contains("old"));
  assert.equal(await isOld(), false, "the drive is this program's");
  await page.selectOption("#machine", "t4");
  await page.waitForFunction(() => takt.state.program?.machine === "t4" && !takt.state.stale);
  // The drive is another machine's: this one drives by itself, as somebody looks.
  await page.waitForFunction(() => /; 91 cycles a period/.test(document.getElementById("drove").textContent));
  await done(page);
  assert.equal(await isOld(), false, "the drive is this machine's");
  assert.deepEqual(errors, []);
});

test("the pipeline follows the size of the page until somebody zooms", limit, async () => {
  const { page, errors } = await open();
  await done(page);
  await page.click("#tab-pipeline");
  await page.waitForSelector("#pipeline-picture .tp-label");
  const right = () => page.evaluate(() => Math.max(...[...document.querySelectorAll(".tp-operation rect")].map((one) => one.getBoundingClientRect().right)) - document.querySelector(".tp-scroll").getBoundingClientRect().right);
  assert.ok((await right()) < 0);
  await page.setViewportSize({ width: 1000, height: 700 });
  await page.waitForTimeout(300);
  assert.ok((await right()) < 0, "all cycles are in sight");
  await page.setViewportSize({ width: 1600, height: 1000 });
  await page.waitForTimeout(300);
  assert.ok((await right()) < 0);
  const room = await page.evaluate(() => document.querySelector(".tp-scroll").clientHeight - 22 - document.querySelectorAll(".tp-label").length * document.querySelector(".tp-label").offsetHeight);
  assert.ok(room < 330, `the rows leave ${room} pixels`);
  assert.deepEqual(errors, []);
});

test("an example that is chosen shows no figure of another", limit, async () => {
  const { page, errors } = await open();
  await done(page);
  assert.equal(await page.evaluate(() => takt.state.tab), "plot", "the result is what one sees first");
  await page.click("#tab-pipeline");
  await page.waitForFunction(() => /pi\.s on t3/.test(document.getElementById("drawn").textContent));
  const seen = await page.evaluate(async () => {
    const example = document.getElementById("example");
    example.value = "statespace.s";
    example.dispatchEvent(new Event("change"));
    await new Promise((resolve) => setTimeout(resolve));
    const of = (selector) => document.querySelector(selector).textContent;
    return {
      cycles: of("#cycles"), charts: of("#charts"), drawn: of("#drawn"), head: of("#head"), rows: document.querySelectorAll(".tp-label, #step tr, #charts canvas, #tuning:not([hidden])").length,
      rest: ["ran", "fault", "text", "answer", "choice"].map((id) => of(`#${id}`)).join(""), stale: document.body.classList.contains("stale"),
    };
  });
  const why = "Assembling statespace.s, 2 s on an idle computer …";
  assert.deepEqual(seen, { cycles: why, charts: why, drawn: why, head: why, rows: 0, rest: "", stale: false });
  await shot(page, "assembling");
  await page.waitForFunction(() => /statespace\.s on t3, period 2: 482 cycles/.test(document.getElementById("drawn").textContent));
  // The period has several blocks, and the bound is the period's.
  assert.match(await cycles(page), /statespace\.s on t3: 482 cycles a period, .* · proved: at most 487, whatever the inputs/);
  assert.match(await page.textContent("#more-text"), /in 300 periods · no schedule takes fewer than 457 cycles/);
  assert.deepEqual(errors, []);
});

/** Records the boxes of all texts on canvases, in the canvas' pixels, since each was cleared. */
const BOXES = () => {
  const prototype = CanvasRenderingContext2D.prototype, { fillText, clearRect } = prototype;
  window.boxes = new Map();
  prototype.clearRect = function (...rest) {
    window.boxes.set(this.canvas, []);
    return clearRect.apply(this, rest);
  };
  prototype.fillText = function (text, x, y, ...rest) {
    const { actualBoundingBoxLeft: left, actualBoundingBoxRight: right, actualBoundingBoxAscent: up, actualBoundingBoxDescent: down } = this.measureText(text), turn = this.getTransform();
    const corners = [[-left, -up], [right, -up], [-left, down], [right, down]].map(([a, b]) => turn.transformPoint({ x: x + a, y: y + b }));
    const [xs, ys] = [corners.map((one) => one.x), corners.map((one) => one.y)];
    if (text.trim()) window.boxes.get(this.canvas)?.push({ text, box: [Math.min(...xs), Math.min(...ys), Math.max(...xs), Math.max(...ys)] });
    return fillText.call(this, text, x, y, ...rest);
  };
};

test("on a telephone the picture stands above the code, and no two labels overlap", limit, async () => {
  const { page, errors } = await open("", { viewport: { width: 390, height: 844 }, script: BOXES });
  await done(page);
  const top = (selector) => page.locator(selector).first().evaluate((one) => one.getBoundingClientRect().top);
  assert.equal(await page.evaluate(() => scrollY), 0, "the page begins at its top");
  assert.ok((await top("#lead canvas")) < 300, `the first chart begins at ${await top("#lead canvas")}`);
  assert.ok((await top("#charts canvas")) < (await top(".cm-editor")));
  // A slider is on the first screen, and the first chart stays in sight at the last one.
  assert.ok((await top(".constant [type=range]:visible")) < 600, `the first slider is at ${await top(".constant [type=range]:visible")}`);
  await page.locator(".constant [type=range]:visible").last().evaluate((slider) => window.scrollTo(0, slider.getBoundingClientRect().top - 300));
  const chart = await top("#lead canvas"), summary = await page.locator("#summary").evaluate((one) => one.getBoundingClientRect().bottom);
  assert.ok(chart >= summary && chart < summary + 60, `the chart is at ${chart}, below the summary at ${summary}`);
  await page.evaluate(() => window.scrollTo(0, 0));
  const tabs = await page.locator("[role=tab]:visible").evaluateAll((tabs) => tabs.map((tab) => [tab.getBoundingClientRect().top, tab.getBoundingClientRect().right]));
  assert.ok(tabs.length > 5 && tabs.every(([top, right]) => top === tabs[0][0] && right <= 390), `${tabs}`);
  await shot(page, "telephone");
  for (const name of await page.locator("#example option").evaluateAll((options) => options.map((one) => one.value).filter(Boolean))) {
    await page.selectOption("#example", name);
    await page.waitForFunction((name) => takt.state.name === name && takt.state.run?.shortest && !document.getElementById("assemble").disabled, name);
    await page.click("#tab-plot");
    const { found, labels } = await page.evaluate(async () => {
      await new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve)));
      const found = [];
      let labels = 0;
      for (const canvas of document.querySelectorAll(":is(#lead, #charts) canvas")) {
        const all = window.boxes.get(canvas) ?? [];
        labels += all.length;
        for (const [i, { text, box: [l, t, r, b] }] of all.entries()) {
          if (l < -1 || t < -1 || r > canvas.width + 1 || b > canvas.height + 1) found.push(`${text} leaves the chart`);
          for (const other of all.slice(i + 1)) if (l < other.box[2] && other.box[0] < r && t < other.box[3] && other.box[1] < b) found.push(`${text} over ${other.text}`);
        }
      }
      // Headings and what stands between charts.
      const lines = [...document.querySelectorAll("#charts > *")].map((one) => one.getBoundingClientRect());
      lines.slice(1).forEach((line, i) => line.top < lines[i].bottom - 1 && found.push(`row ${i + 1} over row ${i}`));
      return { found, labels };
    });
    assert.deepEqual(found, [], name);
    assert.ok(labels > 5, `${name}: ${labels} labels`);
    assert.equal(await page.evaluate(() => document.documentElement.scrollWidth > innerWidth), false, `${name}: nothing sticks out`);
    await shot(page, `telephone-${name}`);
  }
  assert.deepEqual(errors, []);
});

test("plots: ports over one axis, time, folded constants, files", limit, async () => {
  const { page, errors } = await open("#example=foc.s");
  await done(page);
  const heads = async () => (await page.locator(".chart-head").allTextContents()).map((text) => text.replace(/ +$/, ""));
  // A port stands over its reference.
  assert.deepEqual(await heads(), ["id, iq, id_ref, iq_ref, A", "da, db, dc", "we, rad/s", "cycles 123 in every period; at most 128, whatever the inputs"]);
  assert.equal(await page.locator("#charts canvas").count(), 3, "constant cycles are a line");
  assert.deepEqual([await page.inputValue("#axis"), await page.inputValue("#length")], ["ms", "0.05"]);
  await page.locator(".u-over").first().hover();
  await page.waitForFunction(() => /^period \d+, [\d.]+ ms: id \S+ A, iq \S+ A, id_ref \S+ A/.test(document.querySelectorAll(".chart-head .at")[0].textContent));
  await page.selectOption("#axis", "s");
  await page.locator(".u-over").first().hover({ position: { x: 50, y: 20 } });
  await page.waitForFunction(() => / s: id/.test(document.querySelectorAll(".chart-head .at")[0].textContent));
  await page.selectOption("#together", "each");
  assert.equal((await heads()).length, 9);
  await page.selectOption("#together", "unit");
  const take = async (id) => {
    const [download] = await Promise.all([page.waitForEvent("download"), page.click(id)]);
    return { name: download.suggestedFilename(), text: (await readFile(await download.path())).toString() };
  };
  const csv = await take("#plot-csv"), rows = csv.text.trim().split("\n").map((line) => line.split(","));
  assert.equal(csv.name, "foc.csv");
  assert.deepEqual(rows[0], ["period", "time_s", "da", "db", "dc", "id", "iq", "ia", "ib", "theta", "we", "udc", "id_ref", "iq_ref", "cycles"]);
  assert.deepEqual([rows.length, rows[3][0], rows[3][1], rows[3].at(-1)], [321, "3", "0.0001", "123"]);
  assert.equal(Number(rows[200][2]), (await values(page, "da"))[199]);
  const svg = await take("#plot-svg");
  assert.equal(svg.name, "foc.svg");
  const drawn = await page.evaluate((text) => {
    const root = new DOMParser().parseFromString(text, "image/svg+xml");
    return { wrong: root.querySelectorAll("parsererror").length, curves: [...root.querySelectorAll("path")].filter((one) => one.getAttribute("d").length > 1000).length, texts: [...root.querySelectorAll("text")].map((one) => one.textContent) };
  }, svg.text);
  assert.deepEqual([drawn.wrong, drawn.curves], [0, 8]);
  assert.ok(drawn.texts.includes("time, s") && drawn.texts.some((text) => /da, — db, ╌ dc/.test(text)) && drawn.texts.some((text) => /— iq, ┈ id_ref, ┈ iq_ref/.test(text)), `${drawn.texts}`);
  if (process.env.TAKT_SCREENSHOTS) {
    const { page: file } = await open();
    await file.setContent(svg.text);
    await shot(file, "svg");
  }
  // What the comment does not say can be typed; without it, there are periods only.
  await page.selectOption("#example", "lu.s");
  await page.waitForFunction(() => takt.state.name === "lu.s" && takt.state.run);
  await done(page);
  assert.deepEqual([await page.inputValue("#axis"), await page.inputValue("#length")], ["periods", ""]);
  await page.fill("#length", "2");
  await page.keyboard.press("Enter");
  assert.equal(await page.inputValue("#axis"), "ms");
  assert.deepEqual(errors, []);
});

test("inputs of too many rows are refused, and nothing else is said", limit, async () => {
  const { page } = await open();
  await done(page);
  await page.evaluate(() => {
    const table = document.getElementById("table");
    table.value = `w_ref,w\n${"1,1\n".repeat(100_001)}`;
    table.dispatchEvent(new Event("input"));
  });
  await page.waitForFunction(() => /inputs cannot be read/.test(document.getElementById("cycles").textContent));
  await page.waitForTimeout(1500);
  assert.match(await cycles(page), /The inputs cannot be read: .*100,?000/);
  assert.match(await page.textContent("#text"), /^error: [^\n]*100,?000[^\n]*$/);
});

test("what cannot be drawn is said in the place of the picture", limit, async () => {
  const { page, errors } = await open(link({ name: "a.s", machine: "t3", source: ".input x\n.output y\n.period\nstart:\n    fmull y, x, x\n    wait start\n" }));
  await done(page);
  await page.click("#tab-plot");
  assert.equal(await page.textContent("#charts .why"), "The program does not assemble: see Messages.");
  await page.click("#tab-pipeline");
  assert.equal(await page.textContent("#drawn"), "The program does not assemble: see Messages.");
  assert.ok(!(await page.isVisible("#pipeline-picture")), "no frame around nothing");
  assert.deepEqual(errors, []);
});

test("a number between infinities is seen, and cycles have no halves", limit, async () => {
  const source = ".input x\n.output y\n.period\nstart:\n    fmul y, x, 1e30\n    fmul y, y, 1e30\n    wait start\n";
  const { page, errors } = await open(link({ name: "a.s", machine: "t3", source, inputs: "x\n" + Array.from({ length: 60 }, (_, i) => (i === 30 ? 0 : 1)).join("\n") }));
  await done(page);
  await page.evaluate(() => {
    const real = CanvasRenderingContext2D.prototype.fillText;
    window.written = new Set();
    CanvasRenderingContext2D.prototype.fillText = function (text, ...rest) { window.written.add(text); return real.call(this, text, ...rest); };
  });
  await page.click("#tab-plot");
  assert.match(await page.locator(".chart-head").first().textContent(), /no number in 59 periods: inf/);
  await page.waitForFunction(() => {
    const canvas = document.querySelector("#charts canvas");
    const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    for (let i = 0; i < data.length; i += 4) if (data[i] === 0x2f && data[i + 1] === 0x6f && data[i + 2] === 0xbf) return true;
    return false;
  });
  // Only the chart of cycles has two-digit values; periods are always integers.
  const halves = await page.evaluate(() => [...window.written].filter((text) => /^\d\d\.\d/.test(text)));
  assert.deepEqual(halves, []);
  assert.deepEqual(errors, []);
});

test("links and examples open beside what one has written", limit, async () => {
  const { page, context, errors } = await open();
  await done(page);
  await write(page, ".output y\n.period\nmine:\n    mov y, one\n.const one = 1\n    wait mine\n");
  await page.waitForFunction(() => !document.body.classList.contains("stale") && takt.state.program?.assembled);
  const mine = await page.evaluate(() => takt.text);
  // Open another page in the same browser, as the book does.
  const other = await context.newPage();
  other.setDefaultTimeout(PATIENCE);
  await other.goto(address + link({ name: "theirs.s", machine: "t1", source: await example("blink.s") }));
  await other.waitForSelector("body[data-ready]");
  await done(other);
  assert.match(await other.textContent("#notice"), /theirs\.s was opened beside your own text/);
  assert.equal(await other.locator("#documents > span").count(), 2);
  await shot(other, "documents");
  await other.locator("#notice button", { hasText: "Back to" }).click();
  await other.waitForFunction((mine) => takt.text === mine, mine);
  // The first page continues: neither page overwrites the other's document.
  await page.click(".cm-content");
  await page.keyboard.press("Control+End");
  await page.keyboard.type("; more");
  await page.waitForTimeout(600);
  await other.locator("#documents button", { hasText: "theirs.s" }).first().click();
  await other.waitForFunction(() => /lamp/.test(takt.text));
  await other.locator("#documents button", { hasText: "pi.s" }).first().click();
  await other.waitForFunction(() => takt.text.endsWith("; more"));
  // An example does not replace the document either; a reload shows the example again.
  await page.selectOption("#example", "foc.s");
  await page.waitForFunction(() => /foc\.s on/.test(document.getElementById("cycles").textContent));
  await page.reload();
  await page.waitForSelector("body[data-ready]");
  assert.match(await page.evaluate(() => takt.text), /ia, ib/);
  await page.locator("#documents button", { hasText: "pi.s" }).first().click();
  await page.waitForFunction((mine) => takt.text === `${mine}; more`, mine);
  await done(page);
  // Closing a document can be undone.
  await page.locator("#documents .here .close").click();
  await page.waitForFunction(() => !/mine/.test(takt.text));
  await page.locator("#notice button", { hasText: "Undo" }).click();
  await page.waitForFunction((mine) => takt.text === `${mine}; more`, mine);
  assert.deepEqual(errors, []);
});

test("a damaged link on a first visit shows the first example and says so", limit, async () => {
  const { page } = await open("#p1=%%%");
  await done(page);
  assert.match(await page.textContent("#notice"), /damaged: .*no link has.*The first example is shown instead/);
  assert.match(await cycles(page), /gains\.s/);
  await page.click(".cm-content");
  await page.keyboard.type("; mine\n");
  await page.waitForTimeout(600);
  await page.goto(address + "?again#p1=%%%");
  await page.waitForSelector("body[data-ready]");
  await done(page);
  assert.match(await page.textContent("#notice"), /Your last text, gains\.s, is shown instead/);
  assert.match(await page.evaluate(() => takt.text), /; mine/);
});

test("every example runs with numbers in every output", limit, async () => {
  const { page, errors } = await open();
  await done(page);
  for (const name of await page.locator("#example option").evaluateAll((options) => options.map((one) => one.value).filter(Boolean))) {
    await page.selectOption("#example", name);
    await page.waitForFunction((name) => takt.state.name === name && takt.state.run?.shortest && !document.getElementById("assemble").disabled, name);
    const outputs = await page.evaluate(() => Object.entries(takt.state.run.outputs).map(([name, values]) => [name, values.filter((value) => typeof value !== "number").length]));
    assert.deepEqual(outputs.filter(([, lost]) => lost), [], name);
  }
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
  assert.equal(zip.name, "pi-takt_t3.zip");
  assert.ok(zip.bytes.includes("takt_t3/takt_t3_bench.v"));
  const header = await take("c");
  assert.equal(header.name, "pi.h");
  assert.match(header.bytes.toString(), /#define|#ifndef/);
  assert.deepEqual(errors, []);
});

test("the tracking program drives the robot", limit, async () => {
  const { page, errors } = await open("#example=tracking.s");
  await done(page);
  assert.match(await cycles(page), /tracking\.s on t3: 112 .*cycles a period/);
  assert.match(await page.textContent("#more-text"), /no schedule takes fewer than 108 cycles/);
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

test("an example shows what it does when it is chosen, in the tab where one is", limit, async () => {
  const { page, errors } = await open();
  await done(page);
  assert.ok(await page.isHidden("#tab-robot"), "this program drives no robot");
  // The arrows pass over the tab that is not there.
  await page.click("#tab-step");
  await page.focus("#tab-step");
  await page.keyboard.press("ArrowRight");
  assert.equal(await page.evaluate(() => takt.state.tab), "inputs");
  await page.click("#tab-step");
  await page.selectOption("#example", "tracking.s");
  assert.equal(await page.evaluate(() => takt.state.tab), "robot");
  await page.waitForFunction(() => /^[1-9].* of path/.test(document.getElementById("drove").textContent));
  assert.ok((await page.evaluate(() => takt.drive.robot.poses.length)) > 10);
  // Selecting another machine during a drive ends it, without a restart.
  await page.selectOption("#machine", "t4");
  await page.waitForFunction(() => /tracking\.s on t4: \d/.test(document.getElementById("cycles").textContent) && takt.state.run);
  await done(page);
  assert.equal(await page.evaluate(() => takt.drive.driving), false);
  // The document is still the example.
  assert.match(await page.locator("#documents .here small").textContent(), /^example$/);
  // If the user switches tabs meanwhile, the page stays there.
  await page.evaluate(() => {
    const example = document.getElementById("example");
    example.value = "tracking.s";
    example.dispatchEvent(new Event("change"));
    document.getElementById("tab-pipeline").click();
  });
  await page.waitForFunction(() => /tracking\.s on t[34], period 2/.test(document.getElementById("drawn").textContent));
  await done(page);
  assert.equal(await page.evaluate(() => takt.state.tab), "pipeline");
  // The robot's tab goes with its program.
  await page.click("#tab-robot");
  await page.selectOption("#example", "blink.s");
  await page.waitForFunction(() => takt.state.tab === "plot" && document.getElementById("tab-robot").hidden);
  // The blinking lamp changes within the default number of periods.
  await page.waitForFunction(() => takt.state.name === "blink.s" && takt.state.run?.cycles.length > 20);
  const lit = await page.evaluate(() => takt.state.run.outputs.lamp);
  assert.ok(lit.includes(0) && lit.includes(1), "it is on and off");
  await page.selectOption("#example", "pi.s");
  await page.waitForFunction(() => takt.state.name === "pi.s");
  assert.equal(await page.inputValue("#periods"), "400");
  assert.deepEqual(errors, []);
});

test("light and dark, wide and narrow", { timeout: 20 * PATIENCE, skip: process.env.TAKT_SCREENSHOTS ? false : "no folder for pictures" }, async () => {
  const tabs = ["step", "plot", "pipeline", "inputs"];
  for (const colorScheme of ["light", "dark"]) {
    for (const [name, viewport] of [["wide", { width: 1600, height: 900 }], ["narrow", { width: 390, height: 844 }]]) {
      const { page, context, errors } = await open("", { colorScheme, viewport });
      const picture = async (what) => {
        await shot(page, `${what}-${colorScheme}-${name}`);
        assert.equal(await page.evaluate(() => document.documentElement.scrollWidth > innerWidth), false, `${name}, ${what}: nothing sticks out`);
      };
      const show = async (tab) => {
        await page.click(`#tab-${tab}`);
        await done(page);
        if (name === "narrow") await page.locator("[role=tablist]").evaluate((list) => scrollTo(0, list.getBoundingClientRect().top + scrollY - 120));
        await page.waitForTimeout(700);
        await picture(tab);
      };
      await done(page);
      await page.waitForSelector(".hint");
      await picture("first");
      await page.evaluate(() => (location.hash = "#example=foc.s"));
      await page.waitForFunction(() => takt.state.name === "foc.s");
      await done(page);
      await page.waitForSelector(".hint");
      await picture("source");
      for (const tab of tabs) await show(tab);
      await page.evaluate(() => scrollTo(0, 0));
      await page.evaluate(() => takt.goTo(9, 0));
      await page.keyboard.type("wrong ");
      await page.waitForSelector(".cm-lintRange-error");
      await page.waitForTimeout(1500);
      await picture("mistake");
      await show("messages");
      await page.evaluate(() => (location.hash = "#example=tracking.s"));
      await page.waitForFunction(() => takt.state.name === "tracking.s");
      await done(page);
      for (const tab of ["plot", "pipeline"]) {
        await page.click(`#tab-${tab}`);
        await done(page);
      }
      await page.waitForTimeout(700);
      await picture("tracking-pipeline");
      await page.click("#tab-robot");
      await page.click("#drive");
      await page.waitForFunction(() => document.querySelector("#error-chart canvas") || /^[3-9]\./.test(document.getElementById("drove").textContent));
      await page.evaluate(() => { const time = document.getElementById("time"); time.value = time.max; time.dispatchEvent(new Event("input")); });
      await page.locator("#scene").scrollIntoViewIfNeeded();
      await picture("robot");
      assert.deepEqual(errors, []);
      await context.close();
    }
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
  const { page } = await open("");
  await done(page);
  // The panels that are imported when they are asked for are none of it; what they share with it is.
  const asked = [...new Set(requests)].map((path) => path.replace(/^\/parts\/chunk-\w+\.js$/, "/parts/chunk")).sort();
  assert.deepEqual([...new Set(asked)], ["/ahead/gains.s.json.gz", "/index.html", "/main.css", "/main.js", "/parts/chunk", "/takt.wasm.gz", "/worker.js"]);
});
