// What a board does, and, on one page at a time, its parameters, inputs and commands: the page of `takt live serve`, and, with a line of
// its own to the port, that of the playground's folder.
import { Chart, Colours, text } from "./chart.js";
import { open } from "./line.js";
import { initial, isNumber, node, save, short } from "./parts.js";

const el = (id) => document.getElementById(id);
const plural = (count, noun) => `${count.toLocaleString("en")} ${noun}${count === 1 ? "" : "s"}`;
/** A number of a text; a word such as "NaN" stays one. */
const numeric = (value) => (Number.isFinite(Number(value)) ? Number(value) : value);

/** Time until a lost server is asked again; ms. */
const RETRY = 1000;
/** Time after a reload in which this page takes control again as soon as it is free; ms. */
const RECLAIM = 5000;
/** Most seconds of the trend, and most lines of the log. */
const KEPT = 300, LINES = 40;
/** Samples of a recording, if not stated otherwise. */
const SAMPLES = 512;
/** Steps of a slider of real numbers. */
const STEPS = 400;

let line, hello, state, link = { connected: false }, role = { writer: false, free: false, pages: 0 };
/** Rows of values by name; all of them in the order of the messages. */
let rows = new Map(), order = [];
/** Answers that are awaited, by number. */
const asked = new Map();
let number = 0, opened = 0;

// ---- The line to the server -------------------------------------------------------------------------------------------------

function connect() {
  line = open({
    opened: () => (opened = performance.now()),
    message(text) {
      const message = JSON.parse(text);
      take[message.type]?.(message);
    },
    closed() {
      for (const { reject } of asked.values()) reject(new Error("the connection to the server is lost"));
      asked.clear();
      link = { connected: false, text: "", gone: true };
      showLink();
      setTimeout(connect, RETRY);
    },
  });
}

/** Asks the server for something; an error is its answer. */
function ask(wish) {
  return new Promise((resolve, reject) => {
    if (!line.isOpen()) return reject(new Error("there is no connection to the server"));
    asked.set(++number, { resolve, reject });
    line.send(JSON.stringify({ id: number, ...wish }));
  });
}

/** Asks, and shows an error above the page. */
async function attempt(wish) {
  try {
    const answer = await ask(wish);
    notice("");
    return answer;
  } catch (error) {
    notice(error.message);
    return null;
  }
}

function notice(message) {
  el("notice").textContent = message;
  el("notice").hidden = !message;
}

const take = {
  hello(message) {
    if (hello && hello.version !== message.version) return location.reload();
    hello = message;
    el("what").textContent = `${hello.program} on ${hello.machine}, ${hello.port} at ${hello.baud.toLocaleString("en")} baud`;
    build();
  },
  role(message) {
    role = message;
    if (role.writer) sessionStorage.setItem("control", "1");
    // Reloaded before the server has seen that the page was gone.
    else if (role.free && sessionStorage.getItem("control") && performance.now() - opened < RECLAIM) ask({ do: "claim" }).catch(() => {});
    showRole();
  },
  link(message) {
    link = message;
    showLink();
    showScope();
  },
  state(message) {
    state = message;
    showState();
  },
  scope(message) {
    // The form is that of the last recording, of whichever page; what the writer is typing stays.
    const isNew = message.request && (!scope.request || !role.writer) && JSON.stringify(message.request) !== JSON.stringify(scope.request);
    scope = message;
    if (isNew && fitted !== null) {
      fill(message.request);
      showChannels();
    }
    showScope();
  },
  recording(message) {
    recording = message;
    showRecording();
  },
  answer({ id, error, file }) {
    const waiting = asked.get(id);
    asked.delete(id);
    if (error === null) waiting?.resolve({ file });
    else waiting?.reject(new Error(error));
  },
};

// ---- Who may, and what there is ---------------------------------------------------------------------------------------------

function permit() {
  const may = role.writer && link.connected;
  for (const element of document.querySelectorAll("[data-writes]")) element.disabled = !may || element.dataset.off === "1";
  const control = (name) => document.querySelector(`[data-control=${name}]`);
  const report = state?.report;
  if (!may || !report) return;
  control("start").textContent = report.runs ? "Restart" : "Start";
  control("stop").disabled = !report.runs;
  control("hold").disabled = !report.runs || report.held;
  control("go").disabled = control("step").disabled = !report.held || !report.runs;
}

function showRole() {
  const others = role.pages - 1;
  el("role").hidden = role.writer && !others;
  el("role").classList.toggle("reads", !role.writer);
  const more = others ? ` ${plural(others, "other page")} ${others === 1 ? "is" : "are"} open.` : "";
  el("role").firstElementChild.textContent = role.writer
    ? `This page has control;${more.replace(".", " and only show" + (others === 1 ? "s." : "."))}`
    : role.free ? "No page has control: this one only shows." : `Another page has control: this one only shows.`;
  el("claim").hidden = role.writer ? !others : !role.free;
  el("claim").textContent = role.writer ? "Give control up" : "Take control";
  permit();
}

el("claim").addEventListener("click", () => {
  if (role.writer) sessionStorage.removeItem("control");
  attempt({ do: role.writer ? "release" : "claim" });
});

function showLink() {
  el("link").hidden = link.connected;
  el("link").textContent = link.gone
    ? "The server does not answer. Looking for it… If it is started again, it prints a new address."
    : `The board does not answer: ${link.text}. Looking for it…`;
  document.body.classList.toggle("lost", !link.connected);
  if (!link.connected) {
    el("runs").textContent = link.gone ? "no server" : "no board";
    el("drives").textContent = el("load").textContent = "";
    el("state").className = "lost";
    before = "";
    el("reasons").replaceChildren(node("li", { className: "warn", textContent: "Whether the outputs drive is not known." }));
    document.title = `no board · ${hello?.program ?? "Takt live"}`;
  }
  permit();
}

// ---- Values -----------------------------------------------------------------------------------------------------------------

/** Step of a slider; integers move by whole numbers. */
const stepOf = ([low, high], whole) => (whole ? 1 : 10 ** Math.floor(Math.log10(Math.abs(high - low) / STEPS || 1)));

/** A row of the page for a value. */
class Row {
  constructor(shown, kind) {
    Object.assign(this, { shown, kind, name: shown.name, whole: shown.type !== "float", sending: false, wanted: null });
    const { name, unit, range, fixed } = shown;
    const tick = node("input", { type: "checkbox", className: "trend", ariaLabel: `Draw ${name}`, title: "Draw it in the trend" });
    tick.checked = chosen().includes(name);
    tick.addEventListener("change", () => choose(name, tick.checked));
    this.message = node("small", { className: "refusal" });
    this.message.setAttribute("role", "alert");
    this.element = node("div", { className: "value" }, node("label", { className: "name" }, tick, node("b", { textContent: name, title: name })));
    this.element.dataset.name = name;
    if (kind === "output" || fixed !== null) {
      this.output = node("output", { title: kind === "output" ? "" : fixed });
      this.element.append(node("span", { className: "fill", textContent: fixed !== null && kind !== "output" ? "read only" : "", title: fixed ?? "" }), this.output);
    } else {
      this.ends = range?.map(Number);
      this.isSwitch = this.whole && this.ends?.[0] === 0 && this.ends[1] === 1;
      this.slider = node("input", this.isSwitch ? { type: "checkbox", className: "switch", ariaLabel: name } : { type: "range", ariaLabel: `${name}, slider` });
      this.field = node("input", { inputMode: "decimal", className: "field", ariaLabel: `${name}${unit ? `, ${unit}` : ""}`, autocomplete: "off", spellcheck: false });
      this.slider.dataset.writes = this.field.dataset.writes = "";
      const between = range ? `${short(this.ends[0])} to ${short(this.ends[1])}` : "";
      this.element.append(node("span", { className: "fill" }, this.slider, node("small", { textContent: this.isSwitch ? "" : between })), this.field);
      if (this.isSwitch) this.field.hidden = true;
      this.slider.addEventListener("input", () => this.send(this.isSwitch ? String(Number(this.slider.checked)) : this.whole ? this.slider.value : short(Number(this.slider.value))));
      this.field.addEventListener("change", () => this.send(this.field.value.trim()));
      this.field.addEventListener("keydown", ({ key }) => {
        if (key !== "Escape") return;
        this.refuse("");
        this.field.value = this.texts ?? "";
        this.field.blur();
      });
    }
    this.element.append(node("small", { className: "unit", textContent: unit ?? "" }), this.message);
  }

  refuse(message) {
    this.message.textContent = message;
    this.element.classList.toggle("refused", message !== "");
  }

  /** Sends a value; while one is under way, the last that was wanted follows it. */
  async send(value) {
    this.wanted = value;
    if (document.activeElement !== this.field) this.field.value = value;
    if (this.sending) return;
    this.sending = true;
    this.element.classList.add("sending");
    while (this.wanted !== null) {
      const next = this.wanted;
      this.wanted = null;
      try {
        await ask(this.kind === "parameter" ? { do: "parameters", values: { [this.name]: next } } : { do: "input", name: this.name, value: next });
        this.refuse("");
      } catch (error) {
        this.refuse(error.message);
      }
    }
    this.sending = false;
    this.element.classList.remove("sending");
  }

  /** Shows the value on the board; a value that is being typed, or was refused, stays in its field. */
  show(value) {
    this.texts = value;
    const seen = this.whole || !isNumber(value) ? value : short(Number(value));
    if (this.output) {
      if (this.output.textContent !== seen) this.output.textContent = seen;
      return;
    }
    if (this.sending) return;
    const refused = this.element.classList.contains("refused");
    if (document.activeElement !== this.field && !refused) this.field.value = seen;
    this.field.title = value;
    if (this.isSwitch) return (this.slider.checked = Number(value) !== 0);
    if (!isNumber(value)) return;
    const now = Number(value);
    if (!this.span) {
      this.span = this.ends ?? initial(now);
      Object.assign(this.slider, { min: this.span[0], max: this.span[1], step: stepOf(this.span, this.whole) });
    }
    if (!this.ends && (now < this.span[0] || now > this.span[1])) {
      this.span = [Math.min(now, this.span[0]), Math.max(now, this.span[1])];
      Object.assign(this.slider, { min: this.span[0], max: this.span[1], step: stepOf(this.span, this.whole) });
    }
    if (document.activeElement !== this.slider || Number(this.slider.value) !== now) this.slider.value = now;
  }
}

function build() {
  rows = new Map();
  order = [];
  for (const [kind, list] of [["parameter", hello.parameters], ["input", hello.inputs], ["output", hello.outputs]]) {
    const made = list.map((shown) => new Row(shown, kind)), section = el(`${kind}s`);
    for (const row of made) rows.set(row.name, row);
    order.push(...made);
    section.hidden = !made.length;
    // What the host sets comes first.
    const shown = [...made.filter(({ output }) => !output), ...made.filter(({ output }) => output)];
    section.querySelector(".rows").replaceChildren(...shown.map(({ element }) => element));
  }
  el("names").replaceChildren(...hello.channels.map((value) => node("option", { value })));
  if (!scopeNames.length) scopeNames = stored("scope", hello.outputs.slice(0, 2).map(({ name }) => name)).filter((name) => typeof name === "string");
  trend = { times: [], values: new Map(), begin: performance.now() };
  permit();
}

el("save").addEventListener("click", async () => {
  const answer = await attempt({ do: "save" });
  if (answer) save(`${hello.program.replace(/\.\w+$/, "")}.params.toml`, answer.file, "application/toml");
});
el("load-file").addEventListener("click", () => el("file").click());
el("file").addEventListener("change", async () => {
  const [file] = el("file").files;
  el("file").value = "";
  if (file) attempt({ do: "load", text: await file.text() });
});
for (const button of document.querySelectorAll("[data-control]")) {
  button.addEventListener("click", () => attempt({ do: "control", command: button.dataset.control }));
}

// ---- State ------------------------------------------------------------------------------------------------------------------

/** Reasons that are shown. */
let before = "";

function showState() {
  const { report, values, busy } = state, { safe, trips, cores } = report;
  const words = report.state.replace(/^the \w+ /, ""), faulty = cores.some(({ fault }) => fault !== null);
  el("state").className = faulty || trips.length ? "bad" : safe.length ? "idle" : "good";
  el("runs").textContent = words;
  el("drives").textContent = safe.length ? "outputs safe" : trips.length ? "tripped" : "outputs drive";
  const long = cores.map(({ name, cycles, most_cycles }) => `${name ? `${name}: ` : ""}${cycles.toLocaleString("en")} cycles (at most ${most_cycles.toLocaleString("en")})`);
  const missed = cores.reduce((sum, core) => sum + core.misses, 0);
  el("load").textContent = `period ${cores[0].periods.toLocaleString("en")} · ${long.join(", ")}${link.cycles ? ` of ${link.cycles.toLocaleString("en")}` : ""}${missed ? ` · ${plural(missed, "missed deadline")}` : ""}`;
  document.title = `${words} · ${hello?.program ?? ""}`;

  const reasons = [
    ...safe.map((reason) => ["bad", `The outputs are safe: ${reason}.`]),
    ...trips.map((trip) => ["bad", `${trip[0].toUpperCase()}${trip.slice(1)}.`]),
    ...cores.filter(({ fault }) => fault !== null).map(({ name, fault }) => ["bad", `${name ? `${name}: f` : "F"}ault at bundle ${fault}.`]),
    ...(missed ? [["warn", `${plural(missed, "deadline")} missed since the start.`]] : []),
    ...(busy ? [["warn", busy]] : []),
    ...report.fifos.map((fifo) => ["told", fifo]),
    ...(report.errors ? [["warn", `${plural(report.errors, "frame")} with errors on the line.`]] : []),
  ];
  if (!safe.length && !trips.length) reasons.unshift(["good", "The outputs drive."]);
  if (safe.length || trips.length) reasons.push(["told", `${report.runs && !faulty ? "Restart" : "Start"} runs the program from its beginning, with the parameters that it was loaded with, and clears the cause${trips.length ? "; the program may clear a trip itself" : ""}.`]);
  const lines = reasons.map(([kind, textContent]) => `${kind} ${textContent}`).join("\n");
  if (lines !== before) {
    before = lines;
    el("reasons").replaceChildren(...reasons.map(([className, textContent]) => node("li", { className, textContent })));
  }
  note(`${words}; ${safe.length ? `outputs safe: ${safe.join("; ")}` : "outputs drive"}${trips.map((trip) => `; ${trip}`).join("")}`);
  order.forEach((row, i) => values.length && row.show(values[i]));
  permit();
  follow(values);
  showPhase();
}

let noted = "";

/** Notes a change of state with its time. Counts within a reason do not make it another. */
function note(line) {
  const same = line.replace(/\d+/g, "#");
  if (same === noted) return;
  const first = noted === "";
  noted = same;
  if (first) return;
  el("log").prepend(node("li", {}, node("time", { textContent: new Date().toLocaleTimeString() }), ` ${line}`));
  while (el("log").children.length > LINES) el("log").lastChild.remove();
  el("log-box").hidden = false;
}

// ---- Trend ------------------------------------------------------------------------------------------------------------------

const stored = (key, otherwise) => {
  try {
    const value = JSON.parse(localStorage.getItem(`${hello.program} ${key}`));
    return Array.isArray(value) ? value : otherwise;
  } catch {
    return otherwise;
  }
};
const store = (key, value) => localStorage.setItem(`${hello.program} ${key}`, JSON.stringify(value));

const colours = new Colours(), trendChart = new Chart(el("trend"));
let trend = { times: [], values: new Map(), begin: 0 }, paused = false, picked = null;

const chosen = () => (picked ??= stored("trend", hello.outputs.slice(0, 2).map(({ name }) => name)));

function choose(name, on) {
  picked = chosen().filter((other) => other !== name).concat(on ? [name] : []);
  store("trend", picked);
  drawTrend();
}

/** Takes values into the trend; a moment without any leaves a gap. */
function follow(values) {
  const now = (performance.now() - trend.begin) / 1000;
  trend.times.push(now);
  order.forEach(({ name }, i) => {
    if (!trend.values.has(name)) trend.values.set(name, []);
    trend.values.get(name).push(values.length ? numeric(values[i]) : null);
  });
  if (trend.times[0] < now - KEPT - 30) {
    const from = trend.times.findIndex((time) => time >= now - KEPT);
    trend.times.splice(0, from);
    for (const list of trend.values.values()) list.splice(0, from);
  }
  if (!paused) drawTrend();
}

function drawTrend() {
  const names = chosen().filter((name) => rows.has(name)), now = trend.times.at(-1) ?? 0, wide = Number(el("window").value);
  el("trend-hint").hidden = names.length > 0;
  const from = Math.max(0, trend.times.findIndex((time) => time >= now - wide));
  trendChart.show({
    x: trend.times.slice(from), label: "s since the page was opened", range: now < wide ? [0, wide] : [now - wide, now], place: (i) => `${(trend.times[from + i] ?? 0).toFixed(1)} s`,
    curves: names.map((name) => {
      const { shown, whole } = rows.get(name);
      return { name, unit: shown.unit, stepped: whole, colour: colours.of(name), values: (trend.values.get(name) ?? []).slice(from) };
    }),
  });
}

el("window").addEventListener("change", drawTrend);
el("pause").addEventListener("click", () => {
  paused = !paused;
  el("pause").setAttribute("aria-pressed", paused);
  el("pause").textContent = paused ? "Go on" : "Pause";
});
el("trend-csv").addEventListener("click", () => {
  const names = chosen().filter((name) => trend.values.has(name)), quoted = (name) => (name.includes(",") ? `"${name}"` : name);
  const lines = trend.times.map((time, i) => [time.toFixed(3), ...names.map((name) => trend.values.get(name)[i] ?? "")].join(","));
  save("trend.csv", `${["s", ...names.map(quoted)].join(",")}\n${lines.join("\n")}\n`, "text/csv");
});

// ---- Scope ------------------------------------------------------------------------------------------------------------------

const scopeChart = new Chart(el("recording")), scopeColours = new Colours();
let scope = { phase: "rest", text: "", passed: 0, all: 0, request: null }, recording = null, scopeNames = [], fitted = null;

function showScope() {
  const size = link.scope;
  if (link.connected) {
    el("no-scope").hidden = Boolean(size);
    el("setup").hidden = !size;
    el("scope-size").textContent = size ? `${plural(size.channels, "channel")} of ${plural(size.depth, "sample")}` : "";
  }
  if (size && fitted !== size.depth) {
    fitted = size.depth;
    el("samples").max = size.depth;
    el("samples").value = Math.min(SAMPLES, size.depth);
    if (scope.request) fill(scope.request);
    scopeNames = scopeNames.slice(0, size.channels);
    showChannels();
  }
  showPhase();
}

/** Fills the form with a recording that was asked for. */
function fill({ channels, triggers, every, samples, before: earlier }) {
  scopeNames = channels;
  el("every").value = every;
  if (samples) el("samples").value = samples;
  el("before").value = earlier ?? "";
  el("trigger").value = triggers.length ? "events" : "";
  for (const box of document.querySelectorAll("#events input")) box.checked = false;
  for (const trigger of triggers) {
    const box = document.querySelector(`#events [value="${trigger}"]`), parts = trigger.match(/^(\S+) (\S+)(?: (\S+))?$/);
    if (box) box.checked = true;
    else if (parts) {
      el("trigger").value = parts[2];
      showChannels();
      el("trigger-channel").value = parts[1];
      if (parts[3]) el("level").value = parts[3];
    }
  }
}

function showChannels() {
  const most = link.scope?.channels ?? 8;
  const chips = scopeNames.map((name) => {
    const remove = node("button", { type: "button", textContent: "×", ariaLabel: `Remove ${name}`, title: "Remove" }), swatch = node("i");
    swatch.style.background = scopeColours.of(name);
    remove.addEventListener("click", () => setChannels(scopeNames.filter((other) => other !== name)));
    return node("span", { className: "chip" }, swatch, name, remove);
  });
  const add = node("input", { placeholder: "add a channel", ariaLabel: "Add a channel: a register or port, iq, or what a line writes, iq:57", autocomplete: "off", spellcheck: false });
  add.setAttribute("list", "names");
  const added = () => {
    const name = add.value.trim();
    if (name && !scopeNames.includes(name)) setChannels([...scopeNames, name], true);
  };
  add.addEventListener("change", added);
  add.addEventListener("keydown", (event) => {
    if (event.key !== "Enter") return;
    event.preventDefault();
    added();
  });
  el("channels").replaceChildren(...chips, ...(scopeNames.length < most ? [add] : [node("small", { textContent: "the scope has no more channels" })]));
  const kept = el("trigger-channel").value;
  el("trigger-channel").replaceChildren(...scopeNames.map((name) => node("option", { textContent: name })));
  if (scopeNames.includes(kept)) el("trigger-channel").value = kept;
  const kind = el("trigger").value, compares = kind !== "" && kind !== "events";
  el("trigger-channel").hidden = !compares;
  el("level").hidden = !compares || kind === "changes";
  el("before").disabled = kind === "";
  el("events").hidden = kind === "";
}

function setChannels(names, focus) {
  scopeNames = names;
  store("scope", names);
  showChannels();
  if (focus) el("channels").querySelector("input")?.focus();
}

el("trigger").addEventListener("change", showChannels);

function request(repeat) {
  const kind = el("trigger").value, triggers = [];
  if (kind !== "" && kind !== "events") triggers.push(`${el("trigger-channel").value} ${kind}${kind === "changes" ? "" : ` ${el("level").value.trim()}`}`);
  if (kind !== "") for (const box of document.querySelectorAll("#events :checked")) triggers.push(box.value);
  if (kind === "events" && !triggers.length) throw new Error("no event is ticked: choose some of fault, miss, trip, safe");
  if (!scopeNames.length) throw new Error("the scope needs a channel: add one by its name");
  const whole = (id) => {
    const { value, validity } = el(id);
    if (validity.badInput || (value !== "" && !/^\d+$/.test(value))) throw new Error(`${id}: expected a whole number`);
    return value === "" || el(id).disabled ? null : Number(value);
  };
  return { channels: scopeNames, triggers, every: whole("every") ?? 1, samples: whole("samples"), before: whole("before"), repeat };
}

async function arm(repeat) {
  try {
    await ask({ do: "arm", request: request(repeat) });
    notice("");
  } catch (error) {
    notice(error.message);
  }
}

el("setup").addEventListener("submit", (event) => {
  event.preventDefault();
  if (!el("single").disabled) arm(false);
});
el("repeat").addEventListener("click", () => arm(true));
el("end").addEventListener("click", () => attempt({ do: "end" }));
el("scope-csv").addEventListener("click", async () => {
  const answer = await attempt({ do: "csv" });
  if (answer) save("scope.csv", answer.file, "text/csv");
});

function showPhase() {
  const { phase, text: waits, passed, all, request: last } = scope, stopped = state && !state.report.runs;
  const again = last?.repeat ? ", again and again" : "";
  el("phase").textContent = {
    rest: waits,
    armed: stopped ? "armed: the program is stopped, and is recorded from its start" : waits === "now" ? `recording${again}` : `armed${again}: waits for ${waits}`,
    triggered: "triggered: recording what follows",
    reading: `reading${all ? ` ${Math.round((100 * passed) / all)} %` : ""}`,
  }[phase];
  el("phase").className = phase === "rest" && waits ? "bad" : phase;
  el("end").dataset.off = phase === "rest" ? "1" : "";
  el("end").disabled = phase === "rest" || !role.writer || !link.connected;
}

function showRecording() {
  const { periods, values, channels, trigger, seconds, summary } = recording;
  el("summary-line").textContent = summary;
  el("scope-csv").hidden = false;
  const from = periods[trigger ?? 0];
  // Periods are counted in 32 bits.
  const since = periods.map((period) => (period - from) | 0), span = (since.at(-1) - since[0]) * (seconds ?? 0);
  const [factor, unit] = seconds === null ? [1, "periods"] : span < 2e-3 ? [seconds * 1e6, "µs"] : span < 2 ? [seconds * 1e3, "ms"] : [seconds, "s"];
  scopeChart.show({
    x: since.map((period) => period * factor), label: `${unit} from the ${trigger === null ? "first sample" : "trigger"}`, marks: trigger === null ? [] : [0],
    dots: true, place: (i) => `period ${periods[i]}, ${text(since[i] * factor)} ${unit}`,
    curves: channels.map(({ name, type }, i) => ({ name, unit: rows.get(name)?.shown.unit, stepped: type !== "float", colour: scopeColours.of(name), values: values[i] })),
  });
}

connect();
