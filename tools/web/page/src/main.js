import { zipSync, strToU8 } from "fflate";
import { Editor, reader } from "./editor.js";
import { LINK_CHARACTERS, pack, unpack } from "./link.js";
import { Plots, chart } from "./plot.js";
import { Robot } from "./robot.js";
import { Stopped, Thread, load } from "./thread.js";
import "./style.css";

const el = (id) => document.getElementById(id);
const text = (value) => (value === null || value === undefined ? "" : String(value));
const plural = (count, noun) => `${count.toLocaleString("en")} ${noun}${count === 1 ? "" : "s"}`;
/** Where an unsaved text is kept, so that closing the page loses none. */
const KEPT = "takt-playground";
/** Periods that a call drives. */
const DRIVE = 2000;

/** Why a worker is stopped for another program. */
const REPLACED = "another program was opened";

const state = { works: 0, breaks: [], name: "main.s", about: null, program: null, stale: true, run: null };
let machine, editor, plots, robot, errorChart;

function notice(message) {
  el("notice").textContent = message ?? "";
  el("notice").hidden = !message;
}

/** Rows of a table: texts, or objects with a class and a title. */
function rows(id, list) {
  el(id).tBodies[0].replaceChildren(...list.map((cells) => {
    const row = document.createElement("tr");
    row.className = cells.className ?? "";
    if (cells.title) row.title = cells.title;
    for (const cell of cells.cells ?? cells) {
      const td = document.createElement("td");
      td.textContent = text(cell?.text ?? cell);
      if (cell?.className) td.className = cell.className;
      row.append(td);
    }
    return row;
  }));
  el(id).hidden = !list.length;
}

// ---- Tabs.

const tabs = [...document.querySelectorAll("[role=tab]")];

function select(name, focus) {
  for (const tab of tabs) {
    const on = tab.id === `tab-${name}`;
    tab.setAttribute("aria-selected", on);
    tab.tabIndex = on ? 0 : -1;
    el(tab.getAttribute("aria-controls")).hidden = !on;
    if (on && focus) tab.focus();
  }
  if (name === "plot") plots.draw();
  if (name === "robot") robot.draw();
  if (name === "pipeline" && state.drawn !== state.program) draw();
}

for (const [i, tab] of tabs.entries()) {
  const name = tab.getAttribute("aria-controls");
  tab.addEventListener("click", () => select(name));
  tab.addEventListener("keydown", (event) => {
    const to = { ArrowRight: i + 1, ArrowLeft: i - 1, Home: 0, End: tabs.length - 1 }[event.key];
    if (to === undefined) return;
    event.preventDefault();
    select(tabs[(to + tabs.length) % tabs.length].getAttribute("aria-controls"), true);
  });
}

// ---- The program.

const table = () => el("table").value;

function changed() {
  state.stale = true;
  el("cycles").classList.add("stale");
  clearTimeout(state.keeping);
  state.keeping = setTimeout(keep, 300);
}

function keep() {
  const { name } = state;
  try {
    localStorage.setItem(KEPT, JSON.stringify({ name, machine: el("machine").value, source: editor.text, inputs: table() }));
  } catch {
    // A browser that keeps nothing still runs.
  }
}

function kept() {
  try {
    const program = JSON.parse(localStorage.getItem(KEPT));
    return typeof program?.source === "string" ? program : null;
  } catch {
    return null;
  }
}

async function open({ name, source, inputs, machine: wanted }, assembleIt = true) {
  if (machine.busy) machine.stop(REPLACED);
  state.name = name || "main.s";
  if (wanted && [...el("machine").options].some((option) => option.value === wanted)) el("machine").value = wanted;
  el("table").value = inputs ?? "";
  editor.stops = [];
  const opened = editor.open(state.name, source, el("machine").value);
  if (assembleIt) await assemble();
  await opened;
}

/** The cycles and the bound, which are always in sight. */
function showCycles() {
  const { program, run } = state, out = el("cycles");
  out.classList.remove("stale");
  out.replaceChildren();
  const put = (content, tag) => out.append(Object.assign(document.createElement(tag ?? "span"), { textContent: content }));
  if (!program) return put("no program");
  if (!program.assembled) return put("does not assemble: see Messages", "b");
  const range = ({ best, worst }) => (best === worst ? `${best.toLocaleString("en")}` : `${best.toLocaleString("en")} to ${worst.toLocaleString("en")}`);
  const periods = program.bounds?.filter((section) => !section.once) ?? [];
  const once = program.bounds?.find((section) => section.once);
  put(`${program.name} on ${program.machine}: `);
  if (run?.cycles.length) {
    const least = run.shortest, most = run.longest;
    put(least === most ? `${most.toLocaleString("en")} cycles` : `${least.toLocaleString("en")} to ${most.toLocaleString("en")} cycles`, "b");
    put(` a period, in ${plural(run.cycles.length, "period")}${run.missed ? `, ${plural(run.missed, "deadline")} missed` : ""}`);
  } else if (run) put(`${plural(run.total, "cycle")}`, "b");
  // A block that is a whole period has the scheduler's bound: no schedule takes fewer.
  const whole = program.blocks.filter((block) => periods.some((section) => section.name === block.label));
  const schedule = whole.reduce((most, block) => (most && most.cycles >= block.cycles ? most : block), null);
  if (schedule) put(` · no schedule takes fewer than ${schedule.bound}`);
  for (const section of periods) put(` · ${section.name} takes ${range(section.cycles)} whatever the inputs`);
  if (once) put(` · once ${range(once.cycles)}`);
  if (program.no_bound) put(` · no bound: ${program.no_bound}`);
}

function showProgram(program) {
  state.program = program;
  state.run = null;
  el("text").textContent = program.text || (program.assembled ? "No errors, no warnings." : "");
  if (program.inputs_error) el("text").textContent = `error: ${program.inputs_error}\n\n${el("text").textContent}`;
  el("fault").textContent = "";
  el("ran").textContent = "";
  if (program.view) showView(program.view);
  else clearView(program.assembled ? program.inputs_error ?? "The program has no instruction." : "The program does not assemble: see Messages.");
  el("play").hidden = true;
  robot.play(false);
  showCycles();
}

const asked = () => ({ name: state.name, source: editor.text, machine: el("machine").value, inputs: table(), tick: Number(el("tick").value) || 0 });

/** Assembles, with the breakpoints that there were. */
async function begin() {
  state.program = await machine.call("assemble", asked());
  await setStops();
  showProgram(state.program);
}

/** Runs what the machine's worker is asked for; a stop or an error is told. */
async function work(doing) {
  const mine = ++state.works;
  notice();
  el("stop").hidden = false;
  el("assemble").disabled = true;
  try {
    return await doing();
  } catch (error) {
    if (error instanceof Stopped && error.message === REPLACED) return;
    if (error instanceof Stopped) {
      state.stale = true;
      notice(`${error.message === "stopped" ? "Stopped." : `The machine stopped (${error.message}).`} The text is as it was; assemble again to go on.`);
    } else notice(error.message);
  } finally {
    if (mine === state.works) {
      el("stop").hidden = true;
      el("assemble").disabled = false;
    }
  }
}

const assemble = () => work(async () => {
  state.stale = false;
  await begin();
  keep();
  const { program } = state;
  if (!program.assembled || program.inputs_error) return select("messages");
  await run();
});

/** Assembles if the text has changed since. */
async function current() {
  if (!state.stale && state.program?.assembled) return true;
  state.stale = false;
  await begin();
  if (!state.program.assembled || state.program.inputs_error) {
    select("messages");
    return false;
  }
  return true;
}

async function run() {
  const whole = { cycles: [], inputs: {}, outputs: {} };
  for (let begin = true, over = false; !over; begin = false) {
    const part = await machine.call("run", { begin, periods: Math.max(1, Number(el("periods").value) || 1) });
    whole.cycles.push(...part.cycles);
    for (const kind of ["inputs", "outputs"]) for (const [name, values] of Object.entries(part[kind])) (whole[kind][name] ??= []).push(...values);
    Object.assign(whole, { missed: part.missed, total: part.total, operations: part.operations });
    over = part.over;
    el("ran").textContent = `${plural(part.done, "period")}${part.all > part.done ? ` of ${part.all.toLocaleString("en")}` : ""}, ${plural(part.total, "cycle")}, ${plural(part.operations, "operation")}; flags: ${part.flags}${part.halted ? "; halted" : ""}${part.nan_writes ? `; ${plural(part.nan_writes, "NaN")} written to ports` : ""}`;
    el("fault").textContent = text(part.fault);
    if (part.fault) select("plot");
  }
  whole.shortest = whole.cycles.reduce((a, b) => Math.min(a, b), Infinity);
  whole.longest = whole.cycles.reduce((a, b) => Math.max(a, b), 0);
  state.run = whole;
  el("which").value = Math.min(2, whole.cycles.length || 0);
  plots.show(whole);
  showCycles();
}

// ---- Stepping.

function clearView(message) {
  el("head").textContent = message;
  for (const id of ["bundle", "registers", "ports", "flight", "stalls"]) rows(id, []);
  editor.stand(0);
}

function showView(view) {
  el("head").textContent = view.head + (view.last === null ? "" : `; the last period took ${plural(view.last, "cycle")}`);
  rows("bundle", view.bundle.map(({ slot, text }) => [slot, text ?? "·"]));
  const named = (row) => ({
    cells: [row.name, { text: row.value, className: "value" }, { text: `${row.type} ${row.place}`, className: "dim" }],
    title: row.every_way, className: `${row.changed ? "changed" : ""} ${row.used ? "used" : ""}`,
  });
  rows("registers", view.registers.map(named));
  rows("ports", [...view.inputs, ...view.outputs].map(named));
  rows("flight", view.flight.map((one) => [`${one.left}`, one.register || "–", one.mnemonic, one.from]));
  rows("stalls", view.stalls.map((one) => [{ text: one.cycles.toLocaleString("en"), className: "value" }, one.text]));
  const here = view.file === state.name;
  editor.stand(here ? view.line : 0, here ? view.part : []);
  state.breaks = view.breaks;
  editor.stops = view.breaks.filter(({ file }) => file === state.name).map(({ line }) => line);
}

/** Tells a debugger that begins anew of the breakpoints that were set before; those whose line has no code now go. */
async function setStops() {
  const lines = editor.stops;
  if (!state.program?.view) return;
  for (const line of lines) {
    try {
      const { view } = await machine.call("execute", { line: `break ${state.name}:${line}` });
      state.program.view = view;
    } catch (error) {
      if (error instanceof Stopped) throw error;
    }
  }
}

/** Sets a breakpoint on a line of the source, or removes it. */
function toggleStop(line) {
  return work(async () => {
    if (!(await current())) return;
    const known = state.breaks.filter((one) => one.file === state.name && one.line === line);
    const commands = known.length ? known.map(({ id }) => `delete ${id}`) : [`break ${state.name}:${line}`];
    for (const command of commands) {
      const { text: answer, view } = await machine.call("execute", { line: command });
      el("answer").textContent = answer;
      showView(view);
    }
  });
}

/** Shows a file that the program includes, to be read. */
async function showFile(name) {
  let source;
  try {
    source = await machine.call("source", { name });
  } catch (error) {
    notice(error.message);
    return null;
  }
  el("file-name").textContent = name;
  el("file-text").replaceChildren();
  el("file-shown").showModal();
  const view = reader(el("file-text"), source, name);
  view.focus();
  return view;
}

async function execute(line) {
  return work(async () => {
    if (!(await current())) return;
    const { text: answer, view } = await machine.call("execute", { line });
    el("answer").textContent = answer;
    showView(view);
  });
}

function step(command) {
  select("step");
  const unit = command === "step" || command === "back" ? ` ${el("unit").value}` : "";
  return execute(command + unit);
}

// ---- Pictures.

function draw() {
  return work(async () => {
    if (!(await current())) return;
    state.drawn = state.program;
    const { html, period, cycles } = await machine.call("picture", { period: Math.max(0, Number(el("which").value) || 0) });
    el("picture").srcdoc = html;
    el("drawn").textContent = `${period ? `period ${period}` : "what runs once"}: ${plural(cycles, "cycle")}`;
  });
}

function drive() {
  return work(async () => {
    if (!(await current())) return;
    el("robot-fault").textContent = "";
    errorChart?.destroy();
    errorChart = null;
    let begun = performance.now();
    for (let begin = true, over = false; !over; begin = false) {
      const part = await machine.call("track", { begin, periods: DRIVE });
      if (begin) {
        robot.begin(part.base, part.sample_time);
        robot.over = false;
        robot.play(true);
        el("play").hidden = false;
        el("play").textContent = "Pause";
        el("time").disabled = false;
      }
      robot.add(part.poses);
      el("time").max = robot.poses.length - 1;
      over = part.over;
      const seconds = (performance.now() - begun) / 1000;
      el("robot-fault").textContent = text(part.fault);
      el("drove").textContent = `${(part.done * part.sample_time).toFixed(1)} s of ${(part.all * part.sample_time).toFixed(1)} s of path; ${plural(part.cycles, "cycle")} a period, ${part.longest} at most; largest tool error ${(part.cutting * 1e6).toFixed(2)} µm cutting, ${(part.overall * 1e6).toFixed(2)} µm overall; ${(part.operations / seconds / 1e6).toFixed(1)} million operations/s here`;
    }
    robot.over = true;
    const { poses } = robot;
    errorChart = chart(el("error-chart"), {
      x: poses.map((pose) => pose[0] * robot.sampleTime), label: "s", height: 130,
      curves: [{ name: "tool error, µm", values: poses.map((pose) => pose[6] * 1e6) }],
    });
  });
}

// ---- Taking away.

function save(name, content, type) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([content], { type }));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

const stem = () => state.name.replace(/\.s$/, "");

function take(what) {
  el("export").open = false;
  return work(async () => {
    if (what === "source") return save(state.name, editor.text, "text/plain");
    if (!(await current())) return;
    if (what === "image") return save(`${stem()}.takt`, await machine.call("image"), "application/octet-stream");
    if (what === "listing") return save(`${stem()}.lst`, await machine.call("listing"), "text/plain");
    if (what === "verilog") {
      const { top, files } = await machine.call("verilog");
      const zipped = zipSync(Object.fromEntries(files.map((file) => [`${top}/${file.name}`, strToU8(file.text)])));
      return save(`${top}.zip`, zipped, "application/zip");
    }
    const ending = { c: ".h", rust: ".rs", json: ".json", svd: ".svd" }[what];
    return save(stem() + ending, await machine.call("header", { language: what }), "text/plain");
  });
}

async function link() {
  try {
    const fragment = await pack({ name: state.name, machine: el("machine").value, source: editor.text, inputs: table() });
    history.replaceState(null, "", `#${fragment}`);
    try {
      await navigator.clipboard.writeText(location.href);
      notice();
      el("link").textContent = "Link copied";
    } catch {
      el("link").textContent = "Link is in the address";
    }
    setTimeout(() => (el("link").textContent = "Copy link"), 2500);
  } catch (error) {
    notice(error.message);
  }
}

/** Opens what the address says: a program in its fragment, an example; else what was there last, else the first example. */
async function openAddress(first) {
  const examples = state.about.examples;
  let program = null, complaint = null;
  try {
    program = await unpack(location.hash);
    if (program?.example !== undefined) {
      const name = program.example;
      program = examples.find((example) => example.name === name);
      if (!program) throw new Error(`there is no example \`${name}\``);
    }
  } catch (error) {
    complaint = `The link is damaged: ${error.message}. ${first ? "Your last text is shown instead." : "The text is as it was."} Ask for the link again, or for the source.`;
  }
  if (program) await open(program);
  else if (first) await open(kept() ?? examples[0]);
  if (complaint) notice(complaint);
}

// ---- Keys.

const KEYS = [
  ["Mod-Enter", "assemble and run", () => assemble()],
  ["F10", "step", () => step("step")], ["Shift-F10", "step back", () => step("back")],
  ["F9", "set a breakpoint on the line, or remove it", () => toggleStop(editor.line)],
  ["F8", "run on to a breakpoint", () => step("continue")], ["Shift-F8", "run back to one", () => step("reverse")],
  ["Mod-Alt-e", "to the source", () => editor.focus()], ["Mod-Alt-c", "to the debugger's commands", () => (select("step"), el("command").focus())],
];
const EDITOR_KEYS = [["Ctrl-Space", "complete"], ["F12", "to the definition"], ["Shift-F12", "references"], ["F2", "rename"], ["Shift-Alt-f", "format"], ["Ctrl-Shift-m", "diagnostics and their fixes"], ["Escape, then Tab", "leave the source"], ["← →", "between tabs"]];

function pressed(event) {
  const name = [event.ctrlKey || event.metaKey ? "Mod" : "", event.altKey ? "Alt" : "", event.shiftKey ? "Shift" : "", event.key.length === 1 ? event.key.toLowerCase() : event.key].filter(Boolean).join("-");
  const found = KEYS.find(([key]) => key === name);
  if (!found || el("assemble").disabled) return;
  event.preventDefault();
  event.stopPropagation();
  found[2]();
}

async function start() {
  const module = await load("takt.wasm.gz");
  machine = new Thread(module, new URL("worker.js", location.href));
  const language = new Thread(module, new URL("worker.js", location.href));
  plots = new Plots(el("charts"), el("choice"));
  robot = new Robot(el("scene"), (pose, index) => (el("time").value = index), () => (el("play").textContent = "Play"));
  editor = new Editor(el("source"), { thread: language, told: notice, changed, stopped: toggleStop, showFile });
  state.about = await machine.call("about");
  el("machine").replaceChildren(...state.about.machines.map(({ name, text }) => new Option(name, name)));
  el("machine").value = "t3";
  el("example").replaceChildren(new Option("open one …", ""), ...state.about.examples.map(({ name, title }) => new Option(`${name}: ${title}`, name)));
  rows("keytable", [...KEYS.map(([key, what]) => [key.replace("Mod", "Ctrl"), what]), ...EDITOR_KEYS]);

  document.addEventListener("keydown", pressed, true);
  el("assemble").addEventListener("click", assemble);
  el("stop").addEventListener("click", () => machine.stop());
  el("link").addEventListener("click", link);
  el("machine").addEventListener("change", () => (changed(), editor.use(el("machine").value), assemble()));
  el("example").addEventListener("change", () => {
    const example = state.about.examples.find(({ name }) => name === el("example").value);
    el("example").value = "";
    if (!example) return;
    history.replaceState(null, "", location.pathname + location.search);
    open(example).then(() => select(example.track ? "robot" : "step"));
  });
  for (const button of document.querySelectorAll("[data-step]")) button.addEventListener("click", () => step(button.dataset.step));
  for (const button of document.querySelectorAll("[data-line]")) button.addEventListener("click", () => execute(button.dataset.line));
  for (const button of document.querySelectorAll("[data-export]")) button.addEventListener("click", () => take(button.dataset.export));
  el("console").addEventListener("submit", (event) => {
    event.preventDefault();
    execute(el("command").value);
    el("command").select();
  });
  el("draw").addEventListener("click", draw);
  el("drive").addEventListener("click", drive);
  el("play").addEventListener("click", () => {
    if (!robot.playing && robot.over && robot.shown >= robot.poses.length - 1) robot.show(0);
    robot.play(!robot.playing);
    el("play").textContent = robot.playing ? "Pause" : "Play";
  });
  el("time").addEventListener("input", () => {
    robot.play(false);
    el("play").textContent = "Play";
    robot.show(Number(el("time").value));
  });
  for (const id of ["table", "tick", "periods"]) el(id).addEventListener("input", changed);
  el("fill").addEventListener("click", () => work(async () => {
    if (!(await current())) return;
    const names = state.program.inputs.map((port) => port.name);
    if (!names.length) throw new Error("the program has no input port");
    const row = names.map(() => "0").join(",");
    el("table").value = [names.join(","), ...Array(Math.min(Number(el("periods").value) || 1, 1000)).fill(row)].join("\n") + "\n";
    changed();
  }));
  el("file").addEventListener("change", async () => {
    const [file] = el("file").files;
    if (!file) return;
    el("table").value = await file.text();
    el("file").value = "";
    changed();
    assemble();
  });
  addEventListener("hashchange", () => openAddress(false));
  addEventListener("pagehide", keep);
  select("step");
  await openAddress(true);
  document.body.dataset.ready = "";
}

// For the tests: a bench of the closed loop, without drawing.
globalThis.takt = {
  async bench(periods) {
    await current();
    const before = await machine.call("track", { begin: true, periods: 200 });
    const started = performance.now();
    let part = before;
    while (part.done < periods + before.done && !part.over) part = await machine.call("track", { periods: 20_000 });
    const seconds = (performance.now() - started) / 1000;
    return { periods: part.done - before.done, seconds, operations: part.operations - before.operations, rate: (part.operations - before.operations) / seconds };
  },
  get state() {
    return state;
  },
  get text() {
    return editor.text;
  },
  get stops() {
    return editor.stops;
  },
  goTo(line, column = 0) {
    editor.goTo(line, column);
  },
  LINK_CHARACTERS,
};

start().catch((error) => {
  el("cycles").textContent = "";
  notice(`The playground cannot begin: ${error.message}. It needs a browser with WebAssembly and workers, and a file server (it does not run from file:).`);
});
