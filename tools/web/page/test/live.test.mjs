// The page of `takt live serve` in a real browser, with a board simulated in Verilator: `cargo xtask web --test`.
import assert from "node:assert/strict";
import { execFileSync, spawn } from "node:child_process";
import { constants, mkdtempSync, openSync, readFileSync, rmSync, writeFileSync, writeSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { createInterface } from "node:readline";
import { after, afterEach, before, test } from "node:test";
import { ReadStream } from "node:tty";
import { chromium } from "playwright-core";
import { serve as serveFiles } from "../serve.mjs";

const TAKT = process.env.TAKT;
/** Time limit in a browser, and for the circuit's compilation, on a busy machine; ms. */
const PATIENCE = 600_000;
const limit = { timeout: 2 * PATIENCE };

/** A speed loop with its motor in the program. */
const PROGRAM = `.param  kp = 0.4 range 0..5             ; V·s
.param  ki = 0.02 range 0..0.5          ; V
.param  limit:int = 24 range 1..48      ; V
.input  enable:int
.input  w_ref                           ; rad/s
.input  load                            ; N·m
.output u                               ; V
.output w                               ; rad/s
.output i                               ; A
.output mode:int                        ; 0 off, 1 on
.output duty
.state  sum speed amps
.reg    e
.range  enable = 0, 1
.range  w_ref = -100, 100
.once
        sum, speed, amps = 0, 0, 0
        u, w, i, duty = 0, 0, 0, 0
        mode = 0
        wait    period
.period
period: e = enable ? w_ref - speed : 0 - speed
        sum = enable ? sum + ki*e : 0
.reg    want
        want = enable ? kp*e + sum : 0
.reg    most
        most = itof(limit)
        want = want > most ? most : want
        want = want < -most ? -most : want
        u = want
        amps = amps + 0.2*(want - 0.12*speed - 1.1*amps)
        speed = speed + 0.05*(1.9*amps - 0.02*speed - load)
        w, i, mode = speed, amps, enable
        duty = want * 0.02
        wait    period
`;
const WIRING = `board = "ulx3s-85f"
clock = 50
period = 40
baud = 10_000_000
autostart = true
[signals]
stop = "gn10"
[scope]
channels = 4
depth = 1024
[peripheral.motor]
kind = "pwm"
pins = { high = "gp2" }
half = 1000
ports = { duty = "duty" }
scale = { duty = 512 }
`;

let folder, browser, board, server, address, line;

/** Starts a command of `takt`; returns it with the first line that it prints. */
async function start(...options) {
  const child = spawn(TAKT, options, { cwd: folder, stdio: ["ignore", "pipe", "inherit"] });
  for await (const said of createInterface(child.stdout)) return [child, said];
  assert.fail(`takt ${options.join(" ")} has printed nothing`);
}

const end = (child) => new Promise((resolve) => {
  if (!child || child.exitCode !== null || child.signalCode !== null) return resolve();
  child.once("exit", resolve);
  child.kill();
});

/** Prints of a command that asks the board, while no server does. */
const live = (...options) => execFileSync(TAKT, [...line, ...options], { cwd: folder, encoding: "utf8" });

async function serve(...options) {
  const [child, said] = await start(...line, "serve", ...options);
  return { child, address: said };
}

before(async () => {
  assert.ok(TAKT, "TAKT is the command: `cargo xtask web --test` sets it");
  folder = mkdtempSync(join(tmpdir(), "takt-live-"));
  writeFileSync(join(folder, "drive.s"), PROGRAM);
  writeFileSync(join(folder, "drive.toml"), WIRING);
  const program = ["--program", "drive.s", "--machine", "t1", "--wiring", "drive.toml"];
  const [sim, said] = await start("board", "sim", ...program, "--set", "stop=0");
  const [port, baud] = said.split(" ");
  board = sim;
  line = ["live", port, "--baud", baud, ...program];
  ({ child: server, address } = await serve());
  browser = await chromium.launch({ executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", args: ["--no-sandbox"] });
}, { timeout: PATIENCE });

after(async () => {
  await browser?.close();
  await end(server);
  await end(board);
  if (folder) rmSync(folder, { recursive: true });
});

const contexts = [];
afterEach(async () => {
  for (const context of contexts.splice(0)) await context.close();
});

/** Opens the page; errors in its code fail the test. */
async function open(options = {}) {
  const context = await browser.newContext({ viewport: { width: 1600, height: 1000 }, acceptDownloads: true, ...options });
  contexts.push(context);
  const page = await context.newPage();
  page.setDefaultTimeout(PATIENCE);
  const errors = [];
  page.on("pageerror", (error) => errors.push(error.message));
  page.on("console", (message) => message.type() === "error" && errors.push(message.text()));
  page.on("request", (request) => /^(blob|data):/.test(request.url()) || assert.ok(request.url().replace(/^ws:/, "http:").startsWith(address), `it asks for ${request.url()}`));
  await page.goto(address);
  await shown(page, "#runs", /^runs$/);
  return { page, errors };
}

const shown = (page, selector, wanted) => page.waitForFunction(([selector, source]) => new RegExp(source).test(document.querySelector(selector)?.textContent ?? ""), [selector, wanted.source]);
const row = (page, name) => page.locator(`[data-name="${name}"]`);
/** Waits for the value in a field, which the board has. */
const field = (page, name, value) => page.waitForFunction(([name, value]) => document.querySelector(`[data-name="${name}"] .field`)?.value === value, [name, value]);

async function shot(page, name) {
  const into = process.env.TAKT_SCREENSHOTS;
  if (into) await page.screenshot({ path: join(into, `${name}.png`), fullPage: true });
}

/** Moves a slider to a part of its range, as a hand does. */
async function slide(page, name, part) {
  const box = await row(page, name).locator("input[type=range]").boundingBox();
  const y = box.y + box.height / 2, from = box.x + 8, wide = box.width - 16;
  await page.mouse.move(from + 0.1 * wide, y);
  await page.mouse.down();
  for (let i = 1; i <= 5; i++) await page.mouse.move(from + (0.1 + ((part - 0.1) * i) / 5) * wide, y);
  await page.mouse.up();
}

test("a slider moves a parameter of the board, which a reloaded page reads from there", limit, async () => {
  const { page, errors } = await open();
  await field(page, "kp", "0.4");
  assert.deepEqual(await row(page, "kp").locator(".unit").allTextContents(), ["V·s"]);
  assert.match(await row(page, "kp").innerText(), /0 to 5/);
  await slide(page, "kp", 0.6);
  await page.waitForFunction(() => !document.querySelector('[data-name="kp"].sending') && Number(document.querySelector('[data-name="kp"] .field').value) > 2);
  const value = await row(page, "kp").locator(".field").inputValue();
  assert.ok(value > 2 && value < 4, value);
  await page.reload();
  await field(page, "kp", value);
  // Another value, typed; what is out of range is refused, and said beside it.
  const typed = row(page, "kp").locator(".field");
  await typed.fill("5.5");
  await typed.press("Enter");
  await shown(page, '[data-name="kp"] .refusal', /^5.5 is no value of the parameter `kp`: the source states the range 0 to 5$/);
  await typed.fill("much");
  await typed.press("Enter");
  await shown(page, '[data-name="kp"] .refusal', /`much` is not a number/);
  await shot(page, "live-refused");
  await typed.press("Escape");
  await field(page, "kp", value);
  await page.waitForFunction(() => document.querySelector('[data-name="kp"] .refusal').textContent === "");
  assert.deepEqual(errors, []);
  // The board has it: another host, once the server has ended.
  await end(server);
  await shown(page, "#link", /server does not answer/);
  await page.waitForFunction(() => [...document.querySelectorAll("[data-writes]")].every((element) => element.disabled));
  assert.match(live("param"), new RegExp(`^kp = ${value.replace(".", "\\.")} `, "m"));
  ({ child: server, address } = await serve());
});

test("inputs, trend and scope: the motor follows its reference, and the recording is drawn and exported", limit, async () => {
  const { page, errors } = await open();
  await row(page, "enable").locator(".switch").click();
  await shown(page, '[data-name="mode"] output', /^1$/);
  for (const name of ["i", "w_ref"]) await row(page, name).locator(".trend").check();
  await page.fill("#channels input", "speed");
  await page.keyboard.press("Enter");
  await page.selectOption("#trigger", "rises");
  await page.selectOption("#trigger-channel", "speed");
  await page.fill("#level", "10");
  await page.fill("#samples", "60");
  await page.check("#events [value=fault]");
  await page.click("#single");
  await shown(page, "#phase", /^armed: waits for speed rises 10 or fault$/);
  const typed = row(page, "w_ref").locator(".field");
  await typed.fill("40");
  await typed.press("Enter");
  await shown(page, "#summary-line", /^60 samples of 3 channels.*: `speed rises 10`$/);
  // The curve itself is drawn, not only the axes.
  const count = await page.evaluate(() => {
    const canvas = document.querySelector("#recording canvas"), { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    let found = 0;
    for (let i = 0; i < data.length; i += 4) found += data[i] === 0x2f && data[i + 1] === 0x6f && data[i + 2] === 0xbf;
    return found;
  });
  assert.ok(count > 50, `${count} pixels of the first curve`);
  const [download] = await Promise.all([page.waitForEvent("download"), page.click("#scope-csv")]);
  const rows = readFileSync(await download.path(), "utf8").trim().split("\n");
  assert.equal(rows[0], "period,u,w,speed");
  assert.equal(rows.length, 61);
  assert.ok(Number(rows[16].split(",")[3]) >= 10 && Number(rows[15].split(",")[3]) < 10, rows.slice(14, 18).join(" "));
  await page.waitForFunction(() => Math.abs(Number(document.querySelector('[data-name="w"] output').textContent) - 40) < 8);
  await shot(page, "live-wide");
  await page.setViewportSize({ width: 390, height: 844 });
  await page.waitForTimeout(300);
  assert.equal(await page.evaluate(() => document.documentElement.scrollWidth), 390, "nothing sticks out");
  await shot(page, "live-narrow");
  assert.deepEqual(errors, []);
});

test("a second page only shows, until control is free; stop makes outputs safe, start lets them drive", limit, async () => {
  const { page: first, errors } = await open();
  const { page: second, errors: others } = await open({ colorScheme: "dark" });
  await shown(second, "#role", /Another page has control: this one only shows/);
  assert.deepEqual(await second.locator(".chip").allTextContents(), ["u×", "w×", "speed×"], "the form is that of the last recording");
  assert.ok(await second.locator("#stop").isDisabled() && await row(second, "ki").locator(".field").isDisabled());
  await first.click("#stop");
  await shown(second, "#reasons", /The outputs are safe: it is stopped, and not started again/);
  await shown(second, "#log", /stopped; outputs safe/);
  await shot(second, "live-reads");
  await first.click("[data-control=start]");
  await shown(second, "#drives", /^outputs drive$/);
  await first.close();
  await shown(second, "#role", /No page has control/);
  await second.click("#claim");
  await second.waitForFunction(() => document.getElementById("role").hidden && !document.getElementById("stop").disabled);
  assert.deepEqual([...errors, ...others], []);
});

/** Gives a page a port of Web Serial whose bytes go through this test to the simulated board: Chromium opens no pseudo-terminal. */
async function withPort(page, path) {
  const terminal = openSync(path, constants.O_RDWR | constants.O_NOCTTY), stream = new ReadStream(terminal);
  stream.setRawMode(true);
  await page.exposeFunction("toBoard", (bytes) => void writeSync(terminal, Uint8Array.from(bytes)));
  await page.addInitScript(() => {
    let from = null;
    const port = {
      getInfo: () => ({ usbVendorId: 0x403, usbProductId: 0x6015 }),
      async open({ baudRate }) {
        if (window.unplugged) throw new Error("there is no device");
        port.baud = baudRate;
        port.readable = new ReadableStream({ start: (controller) => void (from = controller) });
        port.writable = new WritableStream({ write: (chunk) => window.toBoard([...chunk]) });
      },
      async close() {
        from = null;
      },
    };
    window.fromBoard = (bytes) => from?.enqueue(Uint8Array.from(bytes));
    window.unplug = () => {
      window.unplugged = true;
      from.error(new Error("the device has been lost"));
      from = null;
    };
    Object.defineProperty(navigator, "serial", { value: { requestPort: async () => port } });
    window.port = port;
  });
  stream.on("data", (chunk) => page.evaluate((bytes) => window.fromBoard(bytes), [...chunk]).catch(() => {}));
  return () => stream.destroy();
}

test("a page that opens the port itself sets parameters, records, and finds a board that was unplugged", limit, async () => {
  await end(server);
  const files = await serveFiles(process.env.TAKT_PAGE);
  const context = await browser.newContext({ viewport: { width: 1600, height: 1000 } });
  contexts.push(context);
  const page = await context.newPage();
  page.setDefaultTimeout(PATIENCE);
  const errors = [];
  page.on("pageerror", (error) => errors.push(error.message));
  page.on("console", (message) => message.type() === "error" && errors.push(message.text()));
  const close = await withPort(page, line[1]);
  await page.goto(`${files.address}live/index.html`);
  const chosen = (...names) => page.setInputFiles("#connect-files", names.map((name) => join(folder, name)));
  // A mistake in the program is said in the form.
  writeFileSync(join(folder, "wrong.s"), ".period\np: fadd y, x\n wait p\n");
  await chosen("wrong.s");
  await page.click("#connect-open");
  await shown(page, "#connect-error", /^error[^]*wrong\.s:2/);
  await shot(page, "live-serial-wrong");
  await chosen("drive.s", "drive.toml");
  await page.fill("#connect-machine", "t1");
  await page.fill("#connect-baud", line[3]);
  assert.equal(await page.inputValue("#connect-program"), "drive.s");
  await shot(page, "live-serial-form");
  await page.click("#connect-open");
  await shown(page, "#runs", /^runs$/);
  assert.match(await page.innerText("#what"), /^drive\.s on t1, USB 0403:6015 at 10,000,000 baud$/);
  assert.equal(await page.evaluate(() => window.port.baud), 10_000_000);
  const typed = row(page, "kp").locator(".field");
  await typed.fill("1.5");
  await typed.press("Enter");
  await field(page, "kp", "1.5");
  await typed.fill("7");
  await typed.press("Enter");
  await shown(page, '[data-name="kp"] .refusal', /^7 is no value of the parameter `kp`/);
  await typed.press("Escape");
  await page.fill("#channels input", "speed");
  await page.keyboard.press("Enter");
  await page.fill("#samples", "50");
  await page.click("#single");
  await shown(page, "#summary-line", /^50 samples of \d channels/);
  await shot(page, "live-serial");
  await page.evaluate(() => window.unplug());
  await shown(page, "#link", /the port was unplugged, or closed/);
  await page.evaluate(() => (window.unplugged = false));
  await page.waitForFunction(() => document.getElementById("link").hidden);
  await page.click("#stop");
  await shown(page, "#reasons", /The outputs are safe: it is stopped/);
  await page.click("[data-control=start]");
  await shown(page, "#drives", /^outputs drive$/);
  assert.deepEqual(errors, []);
  await page.close();
  close();
  files.server.close();
  ({ child: server, address } = await serve());
});

test("a board that goes away is said, and nothing can be set", limit, async () => {
  const { page, errors } = await open();
  await end(board);
  await shown(page, "#link", /The board does not answer: the connection is lost|is the board plugged in/);
  await page.waitForFunction(() => document.getElementById("stop").disabled && document.getElementById("runs").textContent === "no board");
  await shot(page, "live-lost");
  assert.deepEqual(errors, []);
});
