import { Pipeline } from "../../../../emu/analysis/src/pipeline.js";
import "../../../../emu/analysis/src/pipeline.css";
import { PERIODS, WHICH, collect, shipped } from "./collect.js";
import { Documents } from "./documents.js";
import { Editor, reader } from "./editor.js";
import { LINK_CHARACTERS, pack, unpack } from "./link.js";
import { Plots } from "./plot.js";
import { binary32, save, short } from "./parts.js";
import { REPLACED, Stopped, Thread, fetched, load } from "./thread.js";
import { Tuning } from "./tuning.js";
import "./style.css";

const el = (id) => document.getElementById(id);
const text = (value) => (value === null || value === undefined ? "" : String(value));
const plural = (count, noun) => `${count.toLocaleString("en")} ${noun}${count === 1 ? "" : "s"}`;
/** Delay from a change to the next run, which is automatic only if a run takes at most the second number; ms. */
const PAUSE = 400, SOON = 1000;
/** Age at which a result is dimmed while a slider moves, and time of a result beyond which only that of the slider's rest is computed; ms. */
const LATE = 1500, LONG = 3000;
/** Clock in MHz at which times are stated, as everywhere in Takt's documents. */
const CLOCK = 125;

const state = { works: 0, opens: 0, breaks: [], name: "main.s", about: null, program: null, stale: true, run: null, took: 0, document: null };
let machine, editor, plots, pipeline, documents, tuning, parameters, plant, module;
/** Panels that are loaded when they are asked for, and the worker of the program that the comparison is with. */
let code, picture, comparison, drive, other;

/** Shows an error; with `act` (text and action of a button), a notice without alarm. */
function notice(message, act) {
  el("notice").replaceChildren(message ?? "");
  if (act) el("notice").append(" ", Object.assign(document.createElement("button"), { textContent: act[0], onclick: () => (notice(), act[1]()) }));
  const close = Object.assign(document.createElement("button"), { textContent: "×", className: "close", title: "Close", onclick: () => notice() });
  close.setAttribute("aria-label", "Close the message");
  el("notice").append(close);
  el("notice").classList.toggle("told", Boolean(act));
  el("notice").hidden = !message;
}

/** Says that the editor's hints are missing because the language server was too slow; the program itself is not concerned. */
function late(seconds) {
  notice(`Cycles and mistakes beside the lines are not here yet: reading this text took more than ${seconds} s.`, ["Try again", () => editor.again(true)]);
}

/** Fills a table with rows; cells are texts, or objects with class and title. */
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
  state.tab = name;
  showHint();
  // Until somebody steps, the debugger's position is nothing to look at.
  if (name === "step" || name === "code") document.body.classList.add("steps");
  if (name === "plot") plots.draw();
  if (name === "step") light();
  if (name === "robot") {
    drive?.draw();
    driveFirst();
  }
  if (name === "pipeline") pipelineInStep();
  if (name === "code") codeInStep();
  else editor?.paint(new Map());
}

/** Shows the hint of an example beside the curves, and in the tab that it names. */
function showHint() {
  const tab = state.tab ?? "plot", isNamed = el("try").textContent.includes(`the tab ${el(`tab-${tab}`).textContent}`);
  el("try").hidden = tab !== "plot" && !isNamed;
}

/** Dims the diagram of an earlier program, but not a text in its place. */
function dimPipeline() {
  el("pipeline").classList.toggle("old", Boolean(state.drawn) && state.drawn !== state.program);
}

/** Draws the diagram if it is visible and outdated. */
function pipelineInStep() {
  dimPipeline();
  if (state.drawn === state.program || state.tab !== "pipeline" || state.stale || !state.program?.assembled || state.program.inputs_error) return;
  if (state.ahead) drawAhead();
  else draw();
}

/** Shows the bundles if their panel is visible, and colours the lines of the text as them. */
async function codeInStep() {
  el("code").classList.toggle("old", Boolean(state.coded) && state.coded !== state.program);
  const { program } = state, isHere = () => state.tab === "code" && !state.stale && program === state.program;
  if (!isHere() || !program?.assembled) return;
  if (state.coded === program) {
    code.colour();
    code.mark(editor.line);
    return;
  }
  let bundles;
  try {
    const { Code } = await import("./code.js");
    code ??= new Code(el("code"), { reveal, paint: (hues) => editor.paint(hues) });
    bundles = state.ahead ? state.ahead.bundles : await machine.call("bundles");
  } catch (error) {
    if (!(error instanceof Stopped)) notice(error.message);
    return;
  }
  if (!isHere()) return;
  code.show(bundles, state.name);
  state.coded = program;
  el("code").classList.remove("old");
  code.mark(editor.line);
  code.stand(state.address);
}

/** Lights up the picture of the machine at the debugger's position, if it is open. */
async function light() {
  if (!el("machine-box").open || state.tab !== "step" || !state.program?.view || state.ahead) return;
  const { MachinePicture } = await import("./machine.js");
  picture ??= new MachinePicture(el("machine-picture"));
  // The machine may have been stopped while the panel was loaded.
  if (state.stale) return;
  try {
    const activity = await machine.call("activity");
    picture.show(activity.machine, activity);
  } catch (error) {
    if (!(error instanceof Stopped)) notice(error.message);
  }
}

/** Loads the panel of the robot. */
async function loadDrive() {
  const { Drive } = await import("./drive.js");
  drive ??= new Drive({ machine, work, current });
}

/** Offers the tab of the robot if the program can drive it. */
function offerRobot(on) {
  el("tab-robot").hidden = !on;
  if (!on && state.tab === "robot") select("plot");
}

/** Drives the robot if its panel is visible, nothing has been driven yet, and the program can drive it. */
function driveFirst() {
  if (state.tab === "robot" && !state.opening && !state.stale && state.program?.tracks && !state.program.inputs_error && (drive?.idle || drive?.isOld)) drive.drive();
}

for (const tab of tabs) {
  const name = tab.getAttribute("aria-controls");
  tab.addEventListener("click", () => select(name));
  tab.addEventListener("keydown", (event) => {
    const shown = tabs.filter(({ hidden }) => !hidden), i = shown.indexOf(tab);
    const to = { ArrowRight: i + 1, ArrowLeft: i - 1, Home: 0, End: tabs.length - 1 }[event.key];
    if (to === undefined) return;
    event.preventDefault();
    select(shown.at(to % shown.length).getAttribute("aria-controls"), true);
  });
}

// ---- The program.

const table = () => el("table").value;
const periods = () => Math.max(1, Math.round(Number(el("periods").value)) || 1);

/**
 * Invalidates all results: dims them at once, and recomputes them after a pause if that is fast. A slider's results follow one another so
 * soon that only late ones dim those before.
 */
function changed(event) {
  if (!state.document) return;
  state.stale = true;
  state.tuning = event === "tune";
  const dim = () => state.stale && document.body.classList.add("stale");
  if (state.tuning) state.dims ??= setTimeout(dim, LATE);
  else {
    dim();
    tuning.enabled = parameters.enabled = plant.enabled = false;
    plots.before = null;
  }
  // A reported mistake also belongs to the previous text.
  const wrong = el("cycles").className === "early";
  el("cycles").className = "";
  if (!state.opening) {
    state.dirty = true;
    // An example remains the example on another machine.
    if (event !== "machine") state.document.changed = true;
    // The URL no longer describes the document.
    if (location.hash) history.replaceState(null, "", location.pathname + location.search);
  }
  clearTimeout(state.keeping);
  state.keeping = setTimeout(keep, 300);
  clearTimeout(state.soon);
  if (state.tuning) return follow();
  if (event !== "later") state.soon = setTimeout(again, PAUSE);
  el("wait").hidden = wrong || state.took <= SOON;
}

/** Computes the results of a slider: one after the other, each of the newest value, or, if they take long, that of the slider's rest. */
function follow() {
  if (state.took > LONG) {
    state.soon = setTimeout(() => (machine.busy && machine.stop(REPLACED), assemble()), PAUSE);
  } else if (!state.following) {
    state.following = true;
    assemble().finally(() => {
      state.following = false;
      if (state.stale && state.tuning) follow();
    });
  }
}

/** Recomputes invalid results. */
function again() {
  if (!state.stale || state.took > SOON) return;
  if (machine.busy && !drive?.driving) state.soon = setTimeout(again, PAUSE);
  else {
    if (machine.busy) machine.stop(REPLACED);
    assemble();
  }
}

function keep() {
  clearTimeout(state.keeping);
  // Do not overwrite another page's changes with a document that is merely displayed here.
  if (!state.document || !state.dirty) return;
  state.dirty = false;
  Object.assign(state.document, { name: state.name, machine: el("machine").value, source: editor.text, inputs: table(), periods: periods(), plant: state.plant, parameters: state.parameters, changes: state.changes });
  documents.write(state.document);
  showDocuments();
}

const showDocuments = () => documents.show(el("documents"), state.document?.id, openDocument, closeDocument);

async function closeDocument(one) {
  const all = documents.list(), at = all.findIndex(({ id }) => id === one.id);
  documents.remove(one.id);
  if (one.id === state.document?.id) {
    clearTimeout(state.keeping);
    state.document = null;
    state.dirty = false;
    await openDocument(all[at + 1] ?? all[at - 1] ?? documents.open(state.about.examples[0], "example", "example=" + state.about.examples[0].name));
  }
  showDocuments();
  if (one.changed) notice(`${one.name} was closed.`, ["Undo", () => (documents.write(one), openDocument(one))]);
}

/** Opens a stored document; the previous one remains stored. */
async function openDocument(one) {
  const opens = ++state.opens;
  keep();
  one = documents.get(one.id) ?? one;
  if (exampleOf(one.name, one.source)?.track) {
    await loadDrive();
    // Another document may have been opened, or this one's predecessor changed, meanwhile.
    if (opens !== state.opens) return;
    keep();
  }
  state.document = one;
  documents.use(one);
  showDocuments();
  if (location.hash && one.key !== location.hash.slice(1)) history.replaceState(null, "", location.pathname + location.search);
  await open(one);
}

/** Menu entry for a machine file (docs/machines.md). Elsewhere, the text of the file takes the place of the machine's name. */
const OWN = "own";

/** Adds a machine file to the menu, and selects it. */
function offer(text) {
  const select = el("machine");
  if (![...select.options].some((option) => option.value === text)) {
    const name = /^\s*name\s*=\s*"([^"]*)"/m.exec(text)?.[1] ?? "own";
    select.add(new Option(name, text), select.options.length - 1);
  }
  select.value = text;
}

/** Uses the selected machine, or asks the user for a machine file. */
function useMachine() {
  if (el("machine").value === OWN) {
    el("machine").value = state.document?.machine ?? "t3";
    return el("own").click();
  }
  changed("machine");
  editor.use(el("machine").value);
  return assemble();
}

/** The example whose text it is, if it is one. */
const exampleOf = (name, source) => state.about.examples.find((one) => one.name === name && one.source === source);

async function open({ name, source, inputs, periods, plant, parameters, changes, machine: wanted }) {
  const example = exampleOf(name, source);
  if (machine.busy) machine.stop(REPLACED);
  clearTimeout(state.soon);
  state.opening = true;
  state.name = name || "main.s";
  state.plant = plant ?? null;
  state.parameters = parameters ?? {};
  state.changes = changes ?? [];
  el("from").value = 1;
  if (wanted?.includes("\n")) offer(wanted);
  else if ([...el("machine").options].some((option) => option.value === wanted)) el("machine").value = wanted;
  el("table").value = inputs ?? "";
  el("periods").value = periods ?? PERIODS;
  editor.stops = [];
  document.body.classList.toggle("steps", ["step", "code"].includes(state.tab));
  // The menu says which example is open, and offers it again.
  el("example").options[0].textContent = example ? `${example.name}: ${example.short}` : "open one …";
  el("try").textContent = example?.text ?? "";
  showHint();
  el("example").title = example?.title ?? "Programs that come with Takt";
  const opened = editor.open(state.name, source, el("machine").value);
  changed("later");
  state.opening = false;
  state.opened = asked();
  state.kept = null;
  showSides();
  empty();
  offerRobot(example?.track ?? false);
  if (isDriven(state.opened)) drive.prepare(true);
  await assemble();
  await opened;
}

/** Whether an example is asked for as it is shipped, so that the build's results of it hold. */
const isShipped = (example, wanted) => JSON.stringify(shipped(example, PERIODS)) === JSON.stringify(wanted);

/** The build has driven the robot with this program. */
const isDriven = (wanted) => state.about.examples.some((one) => one.track && isShipped(one, wanted));

/** Seconds that assembling has taken, beside those that it took here before, or else takes where nothing else runs. */
function elapsed(now, { usual, idle }) {
  if (idle) return `, ${now ? `${now} s so far; ` : ""}${idle} s on an idle computer`;
  if (!now) return usual ? `, about ${usual} s` : "";
  return !usual ? `, ${now} s` : now <= usual ? `, ${now} of about ${usual} s` : `, ${now} s, longer than the usual ${usual} s`;
}

/** Counts the seconds of assembling in the elements of `where`, by default wherever the page says that it assembles; returns what ends the count. */
function countSeconds(where = ".elapsed", usual = seconds()) {
  const begun = performance.now();
  const timer = setInterval(() => {
    const now = Math.floor((performance.now() - begun) / 1000);
    for (const one of document.querySelectorAll(where)) one.textContent = elapsed(now, usual);
  }, 1000);
  return () => clearInterval(timer);
}

/** Says in the summary, in place of the figures before, that a change takes longer to assemble; returns what ends that. */
function sayAssembling() {
  const timer = setTimeout(() => {
    if (!state.shown || state.tuning || state.ahead) return;
    el("cycles").className = "now";
    el("cycles").replaceChildren(...assembling(`${state.name} on ${el("machine").selectedOptions[0]?.text}: assembling`));
    el("more").hidden = true;
  }, SOON);
  return () => clearTimeout(timer);
}

/** A text that ends with the seconds of assembling; they are not read aloud each second. */
function assembling(start) {
  const counted = Object.assign(document.createElement("span"), { className: "elapsed", ariaLive: "off", textContent: elapsed(0, seconds()) });
  return [start, counted, " …"];
}

/** Empties all panels until the result of the opened text is there. */
function empty() {
  const why = () => assembling(`Assembling ${state.name}`);
  state.shown = state.program = state.run = state.drawn = state.coded = null;
  state.ahead = false;
  document.body.classList.remove("stale");
  drive?.clear();
  tuning.clear();
  parameters.clear();
  plant.clear();
  el("loop").hidden = true;
  plots.clear(why, `${state.document?.id} ${state.name}`);
  pipeline.show(null);
  clearView();
  for (const id of ["ran", "fault", "text", "answer"]) el(id).textContent = "";
  showMistake();
  for (const id of ["cycles", "head", "drawn"]) el(id).replaceChildren(...why());
  el("cycles").className = "";
  el("more").hidden = true;
}

/** Key of the times that assembling took here. */
const TOOK = "takt-playground-took";

const times = () => {
  try {
    return JSON.parse(localStorage.getItem(TOOK)) ?? {};
  } catch {
    return {};
  }
};
const timed = () => `${state.name} ${el("machine").value.slice(0, 20)}`;

/** Seconds that assembling the text took the last time (`usual`), or takes on an idle computer (`idle`); neither below one second. */
function seconds() {
  const took = times()[timed()];
  if (took !== undefined) return { usual: Math.round(took) };
  // On another machine it takes about as long.
  return { idle: exampleOf(state.name, editor.text)?.seconds };
}

/** Keeps the time of a result that took long. */
function took(milliseconds) {
  state.took = milliseconds;
  remember(timed(), milliseconds);
}

/** Keeps how long assembling a program on a machine took, if that was long. */
function remember(key, milliseconds) {
  if (milliseconds < SOON) return;
  try {
    localStorage.setItem(TOOK, JSON.stringify({ ...times(), [key]: milliseconds / 1000 }));
  } catch {
    // The browser has no storage.
  }
}

/** Shows why there is no new result above the panel, which keeps the result of the text before; without `why`, hides the reason. */
function showMistake(why, text) {
  el("mistake").hidden = !why;
  el("mistake-why").textContent = [why, why && state.shown && "Below is the result of the text before."].filter(Boolean).join(" ");
  el("mistake-text").textContent = text ?? "";
}

/** Says in the summary that the text does not assemble, and why: figures of the text before are not to stand beside a mistake. `by`: who found it. */
function showWrong(first, more, by) {
  const out = el("cycles");
  out.className = by;
  // Whoever is to mend a mistake is not to assemble it again.
  el("wait").hidden = true;
  out.replaceChildren(Object.assign(document.createElement("b"), { textContent: "does not assemble" }), first ? `: ${first}${more ? ` (${more} more in Messages)` : ""}` : ": see Messages");
  el("more").hidden = true;
}

/** Takes notice of the editor's mistakes, which are known before the text is assembled. */
function diagnosed(mistakes) {
  if (!state.stale || state.opening || state.ahead) return;
  if (mistakes.length) showWrong(`line ${mistakes[0].line}: ${mistakes[0].message}`, mistakes.length - 1, "early");
  // The mistake is gone, the text is still to be assembled.
  else if (state.shown && !state.tuning) {
    showCycles(state.shown);
    showMistake();
    el("wait").hidden = state.took <= SOON;
  }
}

/** Shows cycles and bound in the summary, which is always visible. */
function showCycles(program = state.program) {
  const { run } = state, out = el("cycles");
  out.replaceChildren();
  el("more").hidden = true;
  out.className = program?.inputs_error ? "now" : "";
  const put = (content, tag) => out.appendChild(Object.assign(document.createElement(tag ?? "span"), { textContent: content }));
  if (!program) return put("no program");
  if (!program.assembled) {
    const [first] = program.messages ?? [], at = first?.places?.[0];
    return showWrong(first && `${at ? `${at.file === state.name ? "" : `${at.file} `}line ${at.line}: ` : ""}${first.message}`, program.messages.length - 1, "now");
  }
  if (program.inputs_error) return put(`The inputs cannot be read: ${program.inputs_error}`, "b");
  const range = ({ best, worst }) => (best === worst ? `${best.toLocaleString("en")}` : `${best.toLocaleString("en")} to ${worst.toLocaleString("en")}`);
  const periods = program.bounds?.filter((section) => !section.once) ?? [];
  const once = program.bounds?.find((section) => section.once);
  put(`${program.name} on ${program.machine}: `);
  if (run?.cycles.length) {
    // The first period of many programs does what comes before it, too; the others are what one asks for.
    const [first, ...rest] = run.cycles, isFirstAlone = rest.length > 0 && rest.every((one) => one === rest[0]);
    const ends = isFirstAlone ? [rest[0]] : [...new Set([run.shortest, run.longest])];
    const times = ends.map((cycles) => short(Number((cycles / CLOCK).toPrecision(3))));
    put(`${ends.map((cycles) => cycles.toLocaleString("en")).join(" to ")} cycles`, "b");
    put(` a period, ${times.join(" to ")} µs at ${CLOCK} MHz${isFirstAlone && first !== rest[0] ? ` (the first ${first.toLocaleString("en")})` : ""}`);
  } else put(run ? `${plural(run.total, "cycle")}` : "running …", "b");
  const worst = Math.max(...periods.map((section) => section.cycles.worst));
  if (worst > 0) {
    put(` · proved: at most ${worst.toLocaleString("en")}`);
    put(", whatever the inputs (deadlines kept)").className = "whatever";
  }
  if (program.no_bound) put(` · no bound: ${program.no_bound}`);
  if (run?.missed) put(` · ${plural(run.missed, "deadline")} missed`, "em");
  if (program.parameter_error) put(` · parameters as in the source: ${program.parameter_error}`, "em");
  if (program.plant_error) put(` · the loop is open: ${program.plant_error}`, "em");
  if (program.inputs_of_others) put(` · the table is not read: ${program.inputs_of_others}`, "em");
  if (program.inputs_note) put(` · ${program.inputs_note}`, "em");
  const least = Math.max(...periods.map((section) => section.least ?? 0)), more = [];
  if (run?.cycles.length) more.push(`measured in ${plural(run.cycles.length, "period")}`);
  if (least > 0) more.push(`no schedule takes fewer than ${least} cycles`);
  for (const section of periods) more.push(`${section.name} takes ${range(section.cycles)} whatever the inputs, ${section.missed.toLocaleString("en")} after a missed deadline`);
  if (once) more.push(`before the first period ${range(once.cycles)}`);
  el("more").hidden = !more.length;
  el("more-text").textContent = more.join(" · ");
}

/** Shows an assembled program. While the text has errors, results for the previous text remain, dimmed. */
function showProgram(program) {
  state.program = program;
  const { inputs_error: wrong } = program, whole = program.assembled && !wrong;
  const open = program.plant_error && `The loop is open: ${program.plant_error}`;
  const others = program.inputs_of_others && `The table of inputs is for other ports, and is not read: ${program.inputs_of_others}`;
  const note = program.inputs_note && `note: ${program.inputs_note}`;
  el("text").textContent = [wrong && `error: ${wrong}`, open, others, note, program.text].filter(Boolean).join("\n\n") || "No errors, no warnings.";
  el("tab-messages").classList.toggle("bad", !whole);
  showMistake(wrong ? "The inputs cannot be read." : whole ? "" : "The text does not assemble.", el("text").textContent);
  el("wait").hidden = true;
  clearTimeout(state.dims);
  state.dims = null;
  document.body.classList.toggle("stale", !whole && state.shown !== null);
  if (whole) {
    showParameters();
    showPlants();
    const names = program.inputs.map(({ name }) => name);
    el("table").placeholder = names.length ? `${names.join(",")}\n${names.map(() => "0").join(",")}\n${names.map((_, i) => (i ? "0" : "1")).join(",")}` : "The program has no input port.";
  }
  if (whole || state.shown === null) {
    const why = program.assembled ? wrong && `The inputs cannot be read: ${wrong}` : "The program does not assemble: see Messages.";
    // The curves before stay until those of a slider's new value are there.
    if (!state.tuning && !(state.ahead && whole)) {
      state.run = null;
      el("fault").textContent = "";
      el("ran").textContent = "";
      plots.show(null, program, why);
    }
    if (program.view) showView(program.view);
    else clearView(why ?? "The program has no instruction.");
    state.shown = whole ? program : null;
    if (!whole) {
      pipeline.show(null);
      state.drawn = null;
      el("drawn").textContent = why;
    }
  }
  // The build's drive is that of the same program.
  if (drive) drive.old = whole && !(drive.built && isDriven(asked()));
  if (whole) {
    offerRobot(program.tracks);
    if (program.tracks) drive.offer();
  }
  dimPipeline();
  if (!whole || !state.tuning) showCycles();
}

const asked = () => ({ name: state.name, source: editor.text, machine: el("machine").value, inputs: table(), tick: Number(el("tick").value) || 0, plant: state.plant, parameters: state.parameters, changes: state.changes, periods: periods() });

// ---- Parameters, for the whole run or from a period on.

const from = () => Math.max(1, Math.round(Number(el("from").value)) || 1);

/** Text of a parameter's value in the period from which on the sliders act. */
function parameterOf(name) {
  const last = state.changes.filter((one) => one.name === name && one.period <= from()).at(-1);
  const value = last?.value ?? state.parameters[name] ?? state.program?.parameters?.find((one) => one.name === name)?.value;
  return typeof value === "number" ? binary32(value) : String(value);
}

function setParameters(texts) {
  for (const [name, text] of texts) {
    const value = Number(text), period = from();
    if (period === 1) state.parameters = { ...state.parameters, [name]: value };
    else {
      const rest = state.changes.filter((one) => one.name !== name || one.period !== period);
      state.changes = [...rest, { period, name, value }].sort((a, b) => a.period - b.period);
    }
  }
  changed("tune");
}

/** Shows the sliders with the values of their period, and the changes during the run. */
function showParameters() {
  const { changes, program } = state, all = program.parameters;
  parameters.show(all.map((one) => ({ ...one, value: Number(parameterOf(one.name)) })));
  const remove = (change) => () => {
    plots.keep(`${change.name} = ${change.value} from period ${change.period}`);
    state.changes = state.changes.filter((one) => one !== change);
    changed("tune");
  };
  el("changes").replaceChildren(...changes.flatMap((change) => {
    const close = Object.assign(document.createElement("button"), { textContent: "×", title: "Remove the change", onclick: remove(change) });
    const chip = Object.assign(document.createElement("span"), { className: "chip", textContent: `${change.name} = ${change.value} from ${change.period} ` });
    chip.append(close);
    return chip;
  }), ...(changes.length ? [] : [matchMedia("(pointer: coarse)").matches ? "a tap on a curve sets it" : "a click on a curve sets it"]));
  plots.mark = all.length ? { from: from(), changes, picked: (period) => ((el("from").value = period), act()) } : null;
}

/** Lets the sliders act from another period on. */
function act() {
  showParameters();
  plots.draw();
}

/** Shows the plants that the program's ports fit, and the parameters of the one that closes the loop. */
function showPlants() {
  // Of a program with parameters, these are what one sets; its constants are there when they are asked for, and so is the plant.
  if (state.tuned !== state.document?.id) {
    el("tuning").open = !state.program.parameters.length;
    el("plant").open = !state.program.parameters.length && !state.program.settable.length;
  }
  state.tuned = state.document?.id;
  const { plants } = state.program, here = plants.find(({ name }) => name === state.plant?.name), choice = el("plant-name");
  el("loop").hidden = !plants.length;
  choice.replaceChildren(...plants.map(({ name, text, gives }) => new Option(`${text}: ${gives.join(", ")}`, name)), new Option("the table alone, without a plant", ""));
  choice.value = here?.name ?? "";
  el("given").textContent = here ? `${here.text[0].toUpperCase()}${here.text.slice(1)} gives ${here.gives.join(", ")}: a table's columns of these names are not read.` : "";
  // What the program takes the plant for stands apart from its gains, and from the plant's own numbers.
  const own = new Set(here?.parameters.map(({ name }) => name)), isModel = ({ name }) => own.has(name), { settable } = state.program;
  tuning.show([...settable.filter((one) => !isModel(one)), ...settable.filter(isModel).map((one) => ({ ...one, under: "the program's model of the plant; the plant's own numbers are under Plant" }))]);
  plant.show((here?.parameters ?? []).map((one) => ({ ...one, value: state.plant.parameters?.[one.name] ?? one.value, integer: true })));
}

/** Text of a parameter's present value. */
function valueOf(name) {
  const own = state.program?.plants?.find((one) => one.name === state.plant?.name)?.parameters.find((one) => one.name === name);
  return String(state.plant?.parameters?.[name] ?? own?.value);
}

/** Chooses what closes the loop, or its parameters. */
function usePlant(plant, event) {
  state.plant = plant;
  changed(event);
}

/** Shows a shipped example in all panels before it is assembled here, from the build's results, which are the same. */
async function showAhead(wanted, isOver) {
  const { works } = state, example = state.about.examples.find((one) => isShipped(one, wanted));
  if (state.shown !== null || !example) return;
  try {
    const { program, run, bundles, picture } = JSON.parse(new TextDecoder().decode(await fetched(`ahead/${example.name}.json.gz`)));
    if (isOver() || works !== state.works || state.stale) return;
    Object.assign(state, { program: known(program, wanted), run, ahead: { bundles, picture } });
    plots.show(run, state.program);
    showCycles();
    showView(program.view);
    showParameters();
    showPlants();
    tuning.enabled = parameters.enabled = plant.enabled = false;
    for (const id of ["cycles", "head"]) el(id).append(...assembling(" · assembling it here"));
    drawAhead();
    codeInStep();
  } catch {
    // The page's folder lacks the file: the results come with the assembled program.
  }
}

/** A program with what the page knows: whether there is a table, the ports that are plotted first, and whether their values are single points or have a residual. */
function known(program, wanted) {
  const { plotted, points, residual } = state.about.examples.find(({ name }) => name === wanted.name) ?? {};
  return Object.assign(program, { blank: !wanted.inputs.trim(), plotted, points, residual });
}

/** Shows the build's diagram, if it is of the period that is asked for. */
function drawAhead() {
  const { period, picture, cycles } = state.ahead.picture;
  if (state.tab !== "pipeline" || el("against").value || Number(el("which").value) !== period) return;
  showPicture(picture, period, cycles);
  markPipeline(editor.line, false);
}

/** Assembles the program, and restores the breakpoints. */
async function begin() {
  const { version } = editor, { opens } = state;
  const wanted = asked(), answer = machine.call("assemble", wanted), counted = countSeconds(), said = sayAssembling();
  let over = false;
  showAhead(wanted, () => over);
  const program = known(await answer.finally(() => (counted(), said(), (over = true))), wanted);
  if (program.tracks) await loadDrive();
  if (opens !== state.opens) throw new Stopped(REPLACED);
  if (state.ahead && program.assembled) {
    // What the build has drawn is of this program.
    if (state.drawn === state.program) state.drawn = program;
    if (state.coded === state.program) state.coded = program;
  }
  state.program = program;
  if (state.program.settable) editor.know(state.program.settable, version);
  await setStops();
  showProgram(state.program);
}

/** Runs a job on the machine's worker; reports if it is stopped or fails. */
async function work(doing) {
  const mine = ++state.works, { opens } = state;
  notice();
  el("stop").hidden = false;
  el("assemble").disabled = true;
  try {
    return await doing();
  } catch (error) {
    // Nothing that was asked about another program is told of this one.
    if (opens !== state.opens || (error instanceof Stopped && error.message === REPLACED)) return;
    if (error instanceof Stopped) {
      state.stale = true;
      if (state.shown) showCycles(state.shown);
      notice(`${error.message === "stopped" ? "Stopped." : `The machine stopped (${error.message}).`} The text is as it was; assemble again to go on.`);
    } else notice(error.message);
  } finally {
    if (mine === state.works) {
      el("stop").hidden = true;
      el("assemble").disabled = false;
    }
  }
}

/** Assembles and runs. */
const assemble = () => work(async () => {
  const begun = performance.now();
  clearTimeout(state.soon);
  if (drive?.driving) machine.stop(REPLACED);
  el("wait").hidden = true;
  state.stale = false;
  await begin();
  keep();
  const { program } = state;
  if (!program.assembled || program.inputs_error) return;
  await run();
  took(performance.now() - begun);
}).then(() => (pipelineInStep(), codeInStep(), driveFirst()));

/** Assembles if the text has changed. */
async function current() {
  if (state.stale || !state.program?.assembled || state.program.inputs_error) {
    state.stale = false;
    await begin();
  }
  if (!state.program.assembled) throw new Error("The program has errors: correct them first.");
  if (state.program.inputs_error) throw new Error("The inputs have an error: correct it first.");
}

async function run() {
  const whole = await collect((method, params) => machine.call(method, params), periods(), (part) => {
    // All cycles together contain what runs once and the waits for the tick: beside the cycles of a period they would not add up.
    const ran = part.all ? `${plural(part.done, "period")}${part.all > part.done ? ` of ${part.all.toLocaleString("en")}` : ""}` : plural(part.total, "cycle");
    el("ran").textContent = `${ran}, ${plural(part.operations, "operation")}; flags: ${part.flags.replaceAll("|", ", ")}${part.halted ? "; halted" : ""}${part.nan_writes ? `; ${plural(part.nan_writes, "NaN")} written to ports` : ""}`;
    el("fault").textContent = text(part.fault);
    if (part.fault) select("plot");
  });
  state.run = whole;
  state.ahead = false;
  // Beyond the run there is nothing to draw or to change.
  for (const id of ["which", "from"]) el(id).max = Math.max(1, whole.cycles.length);
  el("which").value = Math.min(state.which ?? WHICH, whole.cycles.length);
  plots.show(whole, state.program);
  showCycles();
}

// ---- Stepping.

function clearView(message = "") {
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
  state.address = view.address;
  code?.stand(view.address);
  light();
  state.breaks = view.breaks;
  editor.stops = view.breaks.filter(({ file }) => file === state.name).map(({ line }) => line);
}

/** Sets the breakpoints in a new debugger, and drops those on lines without code. */
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
    await current();
    const known = state.breaks.filter((one) => one.file === state.name && one.line === line);
    const commands = known.length ? known.map(({ id }) => `delete ${id}`) : [`break ${state.name}:${line}`];
    for (const command of commands) {
      const { text: answer, view } = await machine.call("execute", { line: command });
      el("answer").textContent = answer;
      showView(view);
    }
  });
}

/** Shows a file that the program includes, as read-only. */
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
    await current();
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

// ---- The pipeline.

function draw() {
  return work(async () => {
    await current();
    const { program } = state;
    const { picture, period, cycles } = await machine.call("picture", { period: Math.max(0, Number(el("which").value) || 0) });
    if (program !== state.program) return;
    showPicture(picture, period, cycles);
    await compare();
    markPipeline(editor.line, false);
  });
}

function showPicture(picture, period, cycles) {
  pipeline.show(picture);
  state.drawn = state.program;
  dimPipeline();
  state.caption = `${picture.program} on ${picture.machine}, ${period ? `period ${period}` : "what runs once"}: ${plural(cycles, "cycle")}, ${plural(picture.bundles.length, "bundle")}`;
  showDrawn();
}

const showDrawn = () => (el("drawn").textContent = state.caption);

/** Sides that the program can be compared with: other machines, the text as it was opened, and what was kept. */
function showSides() {
  const select = el("against"), before = select.value, on = [...el("machine").options].filter(({ value }) => value !== OWN);
  const sides = [["", "nothing else"], ["opened", "the text as opened"], ...(state.kept ? [["kept", `kept: ${state.kept.name} on ${state.kept.on}`]] : []), ...on.map(({ value, text }) => [`on ${value}`, `on ${text}`])];
  select.replaceChildren(...sides.map(([value, text]) => new Option(text, value)));
  select.value = sides.some(([value]) => value === before) ? before : "";
}

/** Shows the period's pipeline beside that of the other side. */
async function compare() {
  const side = el("against").value, period = Math.max(0, Number(el("which").value) || 0), { program } = state;
  const shows = (on) => {
    el("comparison").hidden = !on;
    el("pipeline-picture").hidden = on;
  };
  if (!side) return shows(false);
  const { Comparison } = await import("./compare.js");
  comparison ??= new Comparison(el("comparison"), { reveal, goTo: (line) => editor.goTo(line, 0) });
  other ??= new Thread(module, new URL("worker.js", location.href));
  const wanted = side === "opened" ? state.opened : side === "kept" ? state.kept : { ...asked(), machine: side.slice(3) }, key = JSON.stringify([wanted, period]);
  if (comparison.key !== key) {
    if (other.busy) other.stop(REPLACED);
    // The picture of this side stays until the other is there.
    shows(false);
    const begun = performance.now(), pair = `${wanted.name} ${wanted.machine.slice(0, 20)}`, usual = times()[pair] ? { usual: Math.round(times()[pair]) } : seconds();
    const counting = Object.assign(document.createElement("span"), { className: "seconds", ariaLive: "off", textContent: elapsed(0, usual) });
    el("drawn").append(` · assembling ${wanted.name} ${side === "opened" ? "as it was opened" : side === "kept" ? "as it was kept" : side}`, counting, " …");
    const counted = countSeconds("#drawn .seconds", usual), assembled = await other.call("assemble", wanted).finally(counted);
    remember(pair, performance.now() - begun);
    if (!assembled.assembled) throw new Error(`What it is to be compared with does not assemble on this machine: ${assembled.messages[0]?.message ?? "see its text"}`);
    const { picture } = await other.call("picture", { period });
    const title = { opened: `as opened, on ${assembled.machine}`, kept: `kept, on ${assembled.machine}` }[side] ?? `on ${assembled.machine}`;
    Object.assign(comparison, { key, side: { title, name: wanted.name, source: wanted.source, picture } });
  }
  if (program !== state.program) return;
  // From what was to what is, and from this machine to another.
  const isMachine = side.startsWith("on "), own = { title: isMachine ? `on ${program.machine}` : `now, on ${program.machine}`, name: state.name, source: editor.text, picture: pipeline.data };
  shows(true);
  showDrawn();
  comparison.show(...(isMachine ? [own, comparison.side] : [comparison.side, own]));
}

/** Splits a place such as `pi.s:12` or `pi.s:12:3-9` into file and line. */
const place = (text) => /^(.*?):(\d+)/.exec(text ?? "")?.slice(1, 3) ?? [null, 0];

/** Marks the operations of a source line in the diagram. */
function markPipeline(line, show) {
  if (state.tab === "code") code?.mark(line, show);
  if (state.tab !== "pipeline") return;
  if (!el("comparison").hidden) return comparison?.mark(line);
  pipeline.mark((operation) => {
    const [file, at] = place(operation.place);
    return file === state.name && Number(at) === line;
  }, show);
}

/** Shows the source line of a clicked operation. */
async function reveal(operation) {
  const [file, line] = place(operation.place);
  if (!file) return;
  if (file === state.name) return editor.goTo(Number(line), 0);
  const view = await showFile(file);
  if (view) view.dispatch({ selection: { anchor: view.state.doc.line(Math.min(Number(line), view.state.doc.lines)).from }, scrollIntoView: true });
}

// ---- Downloads and links.

async function link() {
  try {
    const fragment = await pack({ name: state.name, machine: el("machine").value, source: editor.text, inputs: table(), periods: periods(), plant: state.plant, parameters: state.parameters, changes: state.changes });
    history.replaceState(null, "", `#${fragment}`);
    // A reload shows this document again.
    state.document.key = fragment;
    state.dirty = true;
    keep();
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

/** Opens the program or example in the URL as an additional document; if there is none, the last document. */
async function openAddress(first) {
  const examples = state.about.examples, { reloaded, last } = documents.last(), key = location.hash.slice(1);
  // After a reload, show the page's document: it may have changed since it was opened.
  if (first && reloaded && (key === "" || reloaded.key === key)) return openDocument(reloaded);
  let program = null, complaint = null, from = "link";
  try {
    program = await unpack(location.hash);
    if (program?.example !== undefined) {
      const name = program.example;
      [program, from] = [examples.find((example) => example.name === name), "example"];
      if (!program) throw new Error(`there is no example \`${name}\``);
    }
  } catch (error) {
    const instead = first ? (last ? `Your last text, ${last.name}, is shown instead.` : `The first example is shown instead.`) : "The text is as it was.";
    complaint = /^there is no example/.test(error.message) ? `The link leads to no program: ${error.message}. ${instead}` : `The link is damaged: ${error.message}. ${instead} Ask for the link again, or for the source.`;
  }
  if (program) {
    const own = first ? last : state.document;
    await openDocument(documents.open(program, from, key));
    if (own?.changed && own.id !== state.document.id) notice(`${state.name} was opened beside your own text, which is kept.`, [`Back to ${own.name}`, () => openDocument(own)]);
  } else if (first) await openDocument(last ?? documents.open(examples[0], "example", `example=${examples[0].name}`));
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
const EDITOR_KEYS = [["Ctrl-Space", "complete"], ["F12", "to the definition"], ["Shift-F12", "references"], ["F2", "rename"], ["Shift-Alt-f", "format"], ["Ctrl-Shift-m", "diagnostics and their fixes"], ["Escape, then Tab", "leave the source"], ["← →", "between tabs"],
  ["drag, double click", "in a plot: zoom, and all again"], ["+ − 0", "in the pipeline: zoom, and all again"], ["[ ]", "in the pipeline: begin and end a range"]];

function pressed(event) {
  const name = [event.ctrlKey || event.metaKey ? "Mod" : "", event.altKey ? "Alt" : "", event.shiftKey ? "Shift" : "", event.key.length === 1 ? event.key.toLowerCase() : event.key].filter(Boolean).join("-");
  const found = KEYS.find(([key]) => key === name);
  // Other work may proceed during a drive.
  if (!found || (el("assemble").disabled && !drive?.driving)) return;
  event.preventDefault();
  event.stopPropagation();
  found[2]();
}

async function start() {
  module = await load("takt.wasm.gz");
  machine = new Thread(module, new URL("worker.js", location.href));
  const language = new Thread(module, new URL("worker.js", location.href));
  documents = new Documents();
  plant = new Tuning(el("plant"), {
    begins: (differs) => plots.keep(differs), textOf: (name) => valueOf(name),
    sets: (texts) => usePlant({ ...state.plant, parameters: { ...state.plant.parameters, ...Object.fromEntries([...texts].map(([name, text]) => [name, Number(text)])) } }, "tune"),
  });
  parameters = new Tuning(el("parameters"), {
    begins: (differs) => plots.keep(differs), textOf: parameterOf, bounded: true,
    sets: setParameters, isChanged: () => state.changes.length > 0 || Object.keys(state.parameters).length > 0,
    resets: () => {
      Object.assign(state, { parameters: {}, changes: [] });
      changed("tune");
    },
  });
  plots = new Plots(el("charts"), el("choice"), el("lead"), { axis: el("axis"), length: el("length"), together: el("together") });
  pipeline = new Pipeline(el("pipeline-picture"), reveal);
  tuning = new Tuning(el("tuning"), { begins: (differs) => plots.keep(differs), sets: (texts) => editor.tune(texts), textOf: (name) => editor.valueOf(name) });
  editor = new Editor(el("source"), { thread: language, told: notice, late, diagnosed, changed, stopped: toggleStop, showFile, moved: (line) => markPipeline(line, true) });
  state.about = await machine.call("about");
  el("machine").replaceChildren(...state.about.machines.map(({ name, text }) => new Option(name, name)), new Option("own…", OWN));
  el("machine").value = "t3";
  const groups = Map.groupBy(state.about.examples, ({ group }) => group), entry = ({ name, short, title }) => Object.assign(new Option(`${name}: ${short}`, name), { title });
  el("example").replaceChildren(new Option("open one …", ""), ...[...groups].map(([label, examples]) => {
    const group = Object.assign(document.createElement("optgroup"), { label });
    group.append(...examples.map(entry));
    return group;
  }));
  rows("keytable", [...KEYS.map(([key, what]) => [key.replace("Mod", "Ctrl"), what]), ...EDITOR_KEYS]);

  document.addEventListener("keydown", pressed, true);
  // A number beyond its field's ends is the end.
  document.addEventListener("change", ({ target }) => {
    const { type, value, min, max } = target;
    if (type !== "number" || value === "") return;
    const least = min === "" ? -Infinity : Number(min), most = max === "" ? Infinity : Number(max);
    if (Number(value) < least || Number(value) > most) target.value = Math.min(Math.max(Number(value), least), most);
  }, true);
  el("assemble").addEventListener("click", () => assemble());
  el("stop").addEventListener("click", () => machine.stop());
  el("link").addEventListener("click", link);
  el("machine").addEventListener("change", useMachine);
  el("own").addEventListener("change", async () => {
    const [file] = el("own").files;
    el("own").value = "";
    if (!file) return;
    // Add a line break; without one, the text would be taken for the name of a machine.
    offer(`${await file.text()}\n`);
    useMachine();
  });
  el("wait").addEventListener("click", () => assemble());
  el("example").addEventListener("change", () => {
    const example = state.about.examples.find(({ name }) => name === el("example").value);
    el("example").value = "";
    if (!example) return;
    if (example.track) select("robot");
    else if (!["step", "pipeline"].includes(state.tab)) select("plot");
    openDocument(documents.open(example, "example", `example=${example.name}`));
  });
  for (const button of document.querySelectorAll("[data-step]")) button.addEventListener("click", () => step(button.dataset.step));
  for (const button of document.querySelectorAll("[data-line]")) button.addEventListener("click", () => execute(button.dataset.line));
  for (const button of document.querySelectorAll("[data-export]")) {
    button.addEventListener("click", async () => (await import("./take.js")).taker({ machine, work, current, state, editor })(button.dataset.export));
  }
  el("console").addEventListener("submit", (event) => {
    event.preventDefault();
    execute(el("command").value);
    el("command").select();
  });
  el("plant-name").addEventListener("change", () => {
    usePlant(el("plant-name").value ? { name: el("plant-name").value } : null, "later");
    assemble();
  });
  el("draw").addEventListener("click", draw);
  el("against").addEventListener("change", draw);
  el("keep").addEventListener("click", () => {
    state.kept = { ...asked(), on: el("machine").selectedOptions[0].text };
    showSides();
    el("against").value = "kept";
    draw();
  });
  el("from").addEventListener("change", act);
  el("machine-box").addEventListener("toggle", light);
  // What lies over the page goes by a click beside it, or by Escape.
  const over = [el("more"), el("export")];
  document.addEventListener("pointerdown", ({ target }) => over.filter((box) => !box.contains(target)).forEach((box) => (box.open = false)));
  document.addEventListener("keydown", ({ key }) => key === "Escape" && over.forEach((box) => (box.open = false)));
  for (const [id, ending, type] of [["plot-svg", "svg", "image/svg+xml"], ["plot-csv", "csv", "text/csv"]]) {
    el(id).addEventListener("click", () => state.run?.cycles.length && save(state.name.replace(/\.(s|tks)$/, `.${ending}`), plots[ending](), type));
  }
  el("which").addEventListener("change", () => {
    state.which = Math.max(0, Math.round(Number(el("which").value)) || 0);
    draw();
  });
  for (const id of ["table", "tick", "periods"]) el(id).addEventListener("input", changed);
  el("fill").addEventListener("click", () => work(async () => {
    await current();
    const names = state.program.inputs.map((port) => port.name);
    if (!names.length) throw new Error("the program has no input port");
    const { run } = state, row = (_, i) => names.map((name) => (typeof run?.inputs[name]?.[i] === "number" ? binary32(run.inputs[name][i]) : run?.inputs[name]?.[i] ?? 0)).join(",");
    el("table").value = [names.join(","), ...Array.from({ length: run?.cycles.length || periods() }, row)].join("\n") + "\n";
    changed();
  }));
  el("file").addEventListener("change", async () => {
    const [file] = el("file").files;
    if (!file) return;
    el("table").value = await file.text();
    el("file").value = "";
    changed("later");
    assemble();
  });
  addEventListener("hashchange", () => openAddress(false));
  addEventListener("pagehide", keep);
  // Another page of the playground has changed or closed a document.
  addEventListener("storage", () => {
    const now = state.document && documents.get(state.document.id);
    if (now && !state.dirty && now.source !== editor.text) openDocument(now);
    else showDocuments();
  });
  // On a telephone, the first chart stays below the summary while sliders move.
  new ResizeObserver(() => document.documentElement.style.setProperty("--summary", `${el("summary").offsetHeight}px`)).observe(el("summary"));
  // Where there is room, the machine is to be seen.
  el("machine-box").open = innerWidth >= 1100 && innerHeight >= 800;
  select("plot");
  for (const part of document.querySelectorAll("[inert]")) part.inert = false;
  await openAddress(true);
  document.body.dataset.ready = "";
}

// For tests: benchmark of the closed loop without drawing.
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
  get drive() {
    return drive;
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
