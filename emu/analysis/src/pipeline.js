// The pipeline's picture: one script for the page of `takt analyse --html`, the playground and the extension of VS Code.
// Time goes across, operations go down in the order of issue. Only what is in sight is drawn, so that long traces scroll.

const NS = "http://www.w3.org/2000/svg";
/** Pixels of a row at least and, where few rows leave room, at most, with everything in sight at least, and with its name at least; of the axis, the least and the largest of a column, before the first. */
const ROW = 18, TALL = 30, TINY = 0.3, NAMED = 11, AXIS = 22, NARROW = 0.7, WIDE = 48, GAP = 6;
/** Width of a telephone, and of a column there at least and at most until somebody zooms; elsewhere. */
const PHONE = 480, THIN = [2, 20], USUAL = [7, 20];
/** Part of the window's height that is in sight at once. */
const SIGHT = 0.8;
/** Pixels below the rows that are enough for the stalls. */
const ROOM = 200;
/** Rows that are drawn beyond the edges. */
const BEYOND = 3;
/**
 * Colours of units by name: numbers of the style sheet's `--u0` and so on, which also people with deuteranopia or protanopia tell apart.
 * Alternatives, of which a machine has one, share a number. Units of other names take the colours that are left.
 */
export const UNITS = { multiply: 0, add: 1, fused: 2, addmul: 2, alu: 3, alu_late: 3, divroot: 4, recurrence: 4, convert: 5, memory: 6, sequencer: 7, sine: 8, arctangent: 9, arccosine: 10 };
const COLOURS = 11;
/** Kinds of stalls, and what each means. */
export const KINDS = {
  operand: "waits for an operand", destination: "its register is still to be written", unit: "its unit is busy", drain: "earlier results first",
  "write port": "the bank's write port is taken", branch: "the front end refills", wait: "waits for the tick",
};

const plural = (count, noun) => `${count.toLocaleString("en")} ${noun}${count === 1 ? "" : "s"}`;

function node(name, attributes = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key === "text") made.textContent = value;
    else if (key.startsWith("on")) made.addEventListener(key.slice(2), value);
    else if (value !== undefined && value !== null) made.setAttribute(key, value);
  }
  made.append(...children);
  return made;
}

function shape(name, attributes) {
  const made = document.createElementNS(NS, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  return made;
}

/** Rows of the picture, where cycles begin anew, and how many columns there are. */
export function layout(bundles) {
  const rows = [], stretches = [], first = [];
  let start = 0, end = 0, last = 0;
  bundles.forEach((bundle, index) => {
    const from = bundle.from ?? "";
    // Cycles begin anew with a stretch, even if it is called as the one before.
    if (!stretches.length || stretches.at(-1).from !== from || bundle.cycle <= last) {
      start = end;
      stretches.push({ from, start, rows: [rows.length, rows.length] });
    }
    last = bundle.cycle;
    const column = start + bundle.cycle - 1;
    first.push(rows.length);
    for (const [i, operation] of (bundle.operations.length ? bundle.operations : [null]).entries()) {
      rows.push({ bundle, index, operation, first: i === 0, column, cycle: bundle.cycle });
      end = Math.max(end, column + Math.max(1, operation?.latency ?? 1));
    }
    stretches.at(-1).rows[1] = rows.length;
  });
  return { rows, stretches, first, columns: end };
}

/** What a row says when it is pointed at. */
export function explain({ bundle, operation }) {
  const place = operation?.place ?? bundle.place;
  const lines = [`cycle ${bundle.cycle}${bundle.from ? ` from ${bundle.from}` : ""}, bundle ${bundle.address}${operation ? `, slot ${operation.slot}` : ""}`];
  if (operation) {
    lines.push(operation.text);
    lines.push(`unit ${operation.unit}${operation.latency === null ? "" : `, result in cycle ${bundle.cycle + operation.latency} (${plural(operation.latency, "cycle")})`}`);
  }
  if (place) lines.push(place);
  for (const stall of bundle.stalls) lines.push(`${plural(stall.cycles, "cycle")} lost before: ${stall.text}`);
  if (operation?.critical) lines.push("on the longest chain");
  return lines.join("\n");
}

/** Cycles lost, by loop (or straight line of code) and by line: rows with a name, a place to go to, and the cycles. */
export function stalls(data) {
  const lost = (bundle) => bundle.stalls.reduce((sum, stall) => sum + (stall.cause === "wait" ? 0 : stall.cycles), 0);
  const kinds = {}, byLine = new Map(), byStretch = new Map();
  for (const bundle of data.bundles) {
    for (const stall of bundle.stalls) if (stall.cause !== "wait") kinds[stall.cause] = (kinds[stall.cause] ?? 0) + stall.cycles;
    const cycles = lost(bundle), operation = bundle.operations.find((one) => one.line !== undefined || one.place);
    const key = operation ? operation.place ?? `line ${operation.line + 1}` : bundle.place ?? `bundle ${bundle.address}`;
    const line = byLine.get(key) ?? { name: key, target: operation, cycles: 0, count: 0 };
    line.cycles += cycles;
    line.count += 1;
    byLine.set(key, line);
    const from = bundle.from ?? "";
    const stretch = byStretch.get(from) ?? { name: from, target: operation, cycles: 0, count: 0 };
    stretch.cycles += cycles;
    stretch.count += 1;
    byStretch.set(from, stretch);
  }
  const most = (a, b) => b.cycles - a.cycles;
  const loops = data.loops
    ? data.loops.map((one) => ({ name: one.label ?? `bundles ${one.first} to ${one.last}`, target: { place: one.place }, cycles: one.stalled, count: one.turns, all: one.cycles }))
    : [...byStretch.values()].filter((one) => one.name);
  const lines = [...byLine.values()].filter((line) => line.cycles).sort(most);
  return { kinds, loops: loops.sort(most), lines, total: Object.values(kinds).reduce((a, b) => a + b, 0) };
}

/** Sums over the columns from `low` to `high`: bundles and operations that issue there, these by unit, and stalled cycles by cause. */
export function sums(rows, low, high) {
  const found = { cycles: high - low + 1, bundles: 0, operations: 0, units: {}, stalled: {} };
  for (const { bundle, operation, first, column } of rows) {
    const here = column >= low && column <= high;
    if (here && operation) {
      found.operations += 1;
      found.units[operation.unit] = (found.units[operation.unit] ?? 0) + 1;
    }
    if (!first) continue;
    found.bundles += here ? 1 : 0;
    let at = column;
    for (const { cause, cycles } of [...bundle.stalls].reverse()) {
      at -= cycles;
      const inside = Math.min(at + cycles - 1, high) - Math.max(at, low) + 1;
      if (inside > 0) found.stalled[cause] = (found.stalled[cause] ?? 0) + inside;
    }
  }
  return found;
}

export class Pipeline {
  /**
   * @param parent where it goes
   * @param reveal called with an operation whose line is to be shown
   */
  constructor(parent, reveal) {
    Object.assign(this, { parent, reveal, width: 10, row: ROW, fits: "new", rows: [], stretches: [], chain: [], first: [], columns: 0, longest: 0, marked: new Set(), follows: true });
    this.legend = node("div", { class: "tp-legend" });
    const button = (text, title, act) => node("button", { type: "button", text, title, "aria-label": title, onclick: act });
    this.tools = node("div", { class: "tp-tools", role: "toolbar", "aria-label": "Zoom" },
      button("−", "Narrower columns (-)", () => this.zoom(1 / 1.4)), button("+", "Wider columns (+)", () => this.zoom(1.4)), button("Fit", "All cycles in sight (0)", () => this.fit()));
    this.sizer = node("div", { class: "tp-sizer" });
    this.view = node("div", { class: "tp-view" });
    this.svg = shape("svg", { class: "tp-chart", role: "img", "aria-label": "When each operation issues" });
    this.axis = shape("svg", { class: "tp-axis", "aria-hidden": "true" });
    this.labels = node("div", { class: "tp-labels", role: "list", "aria-label": "Operations in the order of issue" });
    this.corner = node("div", { class: "tp-corner", text: "cycle" });
    this.view.append(this.svg, this.axis, this.labels, this.corner);
    this.sizer.append(this.view);
    this.scroll = node("div", { class: "tp-scroll", tabindex: "0", role: "region", "aria-label": "Pipeline: arrows scroll, plus and minus zoom, brackets begin and end a range" }, this.sizer);
    this.tip = node("div", { class: "tp-tip", role: "tooltip" });
    this.stalls = node("details", { class: "tp-stalls" });
    this.sums = node("div", { class: "tp-sums", role: "status" });
    parent.classList.add("tp");
    parent.replaceChildren(node("div", { class: "tp-head" }, this.legend, this.tools), this.sums, this.scroll, this.stalls, this.tip);
    this.listen();
  }

  listen() {
    const { scroll } = this;
    let left = 0, top = 0;
    scroll.addEventListener("scroll", () => {
      // Scrolling down moves to where those operations issue, until somebody scrolls sideways.
      if (scroll.scrollLeft !== left && scroll.scrollTop === top) this.follows = false;
      if (scroll.scrollTop !== top && this.follows) this.toDiagonal();
      [left, top] = [scroll.scrollLeft, scroll.scrollTop];
      this.paint();
    });
    scroll.addEventListener("wheel", (event) => {
      if (!event.ctrlKey && !event.metaKey) return;
      event.preventDefault();
      this.zoom(event.deltaY < 0 ? 1.15 : 1 / 1.15, event.clientX - scroll.getBoundingClientRect().left - this.labelWidth);
    }, { passive: false });
    scroll.addEventListener("keydown", (event) => this.key(event));
    scroll.addEventListener("focusin", (event) => {
      if (event.target.dataset?.row === undefined) return;
      this.at = Number(event.target.dataset.row);
      this.tabStop();
    });
    scroll.addEventListener("click", (event) => this.clicked(event.target));
    scroll.addEventListener("pointerdown", (event) => this.drag(event));
    scroll.addEventListener("mousemove", (event) => this.point(event));
    scroll.addEventListener("mouseleave", () => (this.tip.style.display = "none"));
    new ResizeObserver(() => this.resize()).observe(scroll);
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const to = this.rows[this.at]?.column ?? 0, [low, high] = this.range ?? [to, to];
    const act = { "[": () => this.choose(to, Math.max(to, high)), "]": () => this.choose(Math.min(to, low), to), Escape: this.range && (() => this.choose()), "+": () => this.zoom(1.4), "=": () => this.zoom(1.4), "-": () => this.zoom(1 / 1.4), 0: () => this.fit() }[event.key];
    const step = { ArrowDown: 1, ArrowUp: -1 }[event.key], at = Number(event.target.dataset?.row ?? NaN);
    if (act) act();
    else if ((event.key === "Enter" || event.key === " ") && event.target !== this.scroll) this.clicked(event.target);
    else if (step && !Number.isNaN(at)) this.focus(at + step);
    else return;
    event.preventDefault();
  }

  /** Selects a range of cycles by dragging along the axis, or with the shift key anywhere. */
  drag(event) {
    if (event.button || !this.columns || (!event.shiftKey && !this.axis.contains(event.target))) return;
    event.preventDefault();
    const { scroll } = this, column = ({ clientX }) => {
      const x = clientX - scroll.getBoundingClientRect().left - this.labelWidth - GAP + scroll.scrollLeft;
      return Math.max(0, Math.min(this.columns - 1, Math.floor(x / this.width)));
    };
    const from = column(event), move = (event) => this.choose(Math.min(from, column(event)), Math.max(from, column(event)));
    move(event);
    scroll.setPointerCapture(event.pointerId);
    scroll.addEventListener("pointermove", move);
    scroll.addEventListener("lostpointercapture", () => scroll.removeEventListener("pointermove", move), { once: true });
  }

  /** Selects the columns from `low` to `high`, or none, and says their sums. */
  choose(low, high) {
    this.range = low === undefined ? null : [low, high];
    const { range, stretches, rows } = this, box = this.sums;
    box.replaceChildren();
    if (range) {
      const { cycles, bundles, operations, units, stalled } = sums(rows, low, high), list = (of) => Object.entries(of).sort((a, b) => b[1] - a[1]).map(([name, count]) => `${name} ${count}`).join(", ");
      const cycle = (column) => column + 1 - (stretches.findLast(({ start }) => start <= column)?.start ?? 0), lost = Object.values(stalled).reduce((a, b) => a + b, 0);
      box.append(node("b", { text: `cycles ${cycle(low)} to ${cycle(high)}: ${cycles}` }), ` · ${plural(bundles, "bundle")}, ${plural(operations, "operation")}${operations ? ` (${list(units)})` : ""} · ${plural(lost, "cycle")} stalled${lost ? ` (${list(stalled)})` : ""}`,
        node("button", { type: "button", text: "×", title: "No range (Escape)", "aria-label": "No range", onclick: () => this.choose() }));
    } else if (rows.length) box.append(node("span", { class: "tp-how", text: "drag along the cycles to sum a range" }));
    this.paint();
  }

  focus(index) {
    if (!this.rows[index]) return;
    this.into(index);
    this.labels.querySelector(`[data-row="${index}"]`)?.focus();
  }

  /** Of all rows one is a stop of the tab key, the one that was there last if it is in sight: arrows go on to the others. */
  tabStop() {
    const rows = [...this.labels.children], top = Math.ceil(this.scroll.scrollTop / this.row);
    const stop = rows.find((one) => Number(one.dataset.row) === this.at) ?? rows.find((one) => Number(one.dataset.row) >= top);
    for (const one of rows) one.tabIndex = one === stop ? 0 : -1;
  }

  clicked(target) {
    const row = this.rows[Number(target.closest?.("[data-row]")?.dataset.row ?? -1)];
    if (row?.operation) this.reveal(row.operation);
  }

  point(event) {
    const text = event.target.closest?.("[data-tip]")?.dataset.tip ?? this.told(event.target.closest?.("[data-row]")?.dataset.row);
    this.tip.style.display = text ? "block" : "none";
    if (!text) return;
    this.tip.textContent = text;
    this.tip.style.left = `${Math.max(4, Math.min(event.clientX + 14, innerWidth - this.tip.offsetWidth - 8))}px`;
    this.tip.style.top = `${Math.max(4, Math.min(event.clientY + 14, innerHeight - this.tip.offsetHeight - 8))}px`;
  }

  told(row) {
    if (row === undefined) return null;
    const ends = this.chain.filter((link) => link.to === Number(row)).map((link) => link.tip);
    return [explain(this.rows[row]), ...ends].join("\n");
  }

  /**
   * Draws a picture: `takt analyse --json`, or the language server's answer to `takt/pipeline`.
   * Where one of the same shape was shown before, it stays in place.
   */
  show(data) {
    const before = this.data;
    this.data = data;
    Object.assign(this, layout(data?.bundles ?? []));
    this.chain = this.joined(data?.critical_path ?? data?.chain ?? []);
    const names = [...new Set(this.rows.flatMap(({ operation }) => operation?.unit ?? []))];
    const free = [...Array(COLOURS).keys()].filter((number) => !names.some((name) => UNITS[name] === number));
    const rest = names.filter((name) => !(name in UNITS));
    const number = (name) => UNITS[name] ?? (free.length ? free[rest.indexOf(name) % free.length] : rest.indexOf(name) % COLOURS);
    this.colours = new Map(names.map((name) => [name, `var(--u${number(name)})`]));
    this.longest = this.rows.reduce((most, { operation }) => Math.max(most, operation?.text.length ?? 3), 3);
    // Beside a stretch's first operation stands its name.
    for (const { from, rows: [first] } of this.stretches) this.longest = Math.max(this.longest, (this.rows[first]?.operation?.text.length ?? 3) + from.length + 1);
    this.marked = new Set();
    this.showLegend();
    this.showStalls();
    // A range of another picture is none of this.
    this.choose();
    if (!before || before.bundles.length !== data?.bundles.length) {
      Object.assign(this.scroll, { scrollLeft: 0, scrollTop: 0 });
      this.follows = true;
      this.fits = "new";
      this.at = undefined;
      // A longer picture needs the room that a short one left to the stalls.
      if (this.opened) this.stalls.open = this.opened = false;
    }
    this.resize();
  }

  /**
   * The edges of the chain between rows. Where no single operation is the reason, as where one bundle just follows another, an edge
   * begins where the one before ends and ends where the next begins, or else at the bundle's first operation.
   */
  joined(links) {
    const row = (index, slot) => {
      const first = this.first[index] ?? 0, at = this.rows.slice(first, first + 16).findIndex((row) => row.index === index && row.operation?.slot === slot);
      return slot && at >= 0 ? first + at : undefined;
    };
    const found = links.map(({ from, to, from_slot, to_slot }) => ({ from: row(from, from_slot), to: row(to, to_slot) }));
    return links.map(({ from, to, cycles, text, register, through }, i) => {
      const before = i > 0 && links[i - 1].to === from ? found[i - 1].to : undefined, next = links[i + 1]?.from === to ? found[i + 1].from : undefined;
      found[i].from ??= before ?? this.first[from] ?? 0;
      found[i].to ??= next ?? this.first[to] ?? 0;
      return { ...found[i], tip: `${plural(cycles, "cycle")} of it: ${text ?? (register ? `${register} through ${through}` : through)}` };
    });
  }

  showLegend() {
    const entry = (swatch, text) => node("span", {}, swatch, text);
    const counts = new Map();
    for (const { operation } of this.rows) if (operation) counts.set(operation.unit, (counts.get(operation.unit) ?? 0) + 1);
    const { kinds } = stalls(this.data ?? { bundles: [] });
    const units = [...this.colours].map(([name, colour]) => entry(node("i", { class: "tp-unit", style: `--fill:${colour}` }), `${name} ${counts.get(name)}`));
    const lost = Object.keys(KINDS).filter((kind) => kinds[kind]).map((kind) => entry(node("i", { class: `tp-swatch tp-k-${kind.replace(" ", "-")}` }), `${KINDS[kind]} (${plural(kinds[kind], "cycle")})`));
    const chain = this.chain.length ? [entry(node("i", { class: "tp-swatch tp-chain" }), "longest chain")] : [];
    this.legend.replaceChildren(...(this.rows.length ? [...units, entry(node("i", { class: "tp-swatch tp-late" }), "pale: until the result"), ...lost, ...chain] : []));
  }

  showStalls() {
    const { stalls: box } = this;
    box.hidden = !this.rows.length;
    const { total, kinds, loops, lines } = stalls(this.data ?? { bundles: [] });
    const named = Object.entries(kinds).sort((a, b) => b[1] - a[1]).map(([kind, cycles]) => `${kind} ${cycles}`).join(", ");
    const table = (head, list, cells) => {
      const row = (one) => node("tr", {}, ...cells(one).map((cell, i) => (i ? node("td", { text: cell }) : node("td", {}, node("button", { type: "button", text: cell, title: "Go to the line", onclick: () => one.target && this.reveal(one.target) })))));
      return node("table", {}, node("thead", {}, node("tr", {}, ...head.map((text) => node("th", { text })))), node("tbody", {}, ...list.map(row)));
    };
    const shown = loops.length
      ? [this.data.loops
        ? table(["loop", "turns", "cycles", "lost"], loops, (one) => [one.name, one.count, one.all, one.cycles])
        : table(["code after", "bundles", "lost"], loops, (one) => [one.name, one.count, one.cycles])]
      : [];
    if (lines.length) shown.push(table(["line", "bundles", "lost"], lines.slice(0, 30), (one) => [one.name, one.count, one.cycles]));
    box.replaceChildren(node("summary", { text: total ? `Stalls: ${plural(total, "cycle")} lost (${named})` : "Stalls: no cycle lost" }), node("div", { class: "tp-tables" }, ...shown));
  }

  /** Marks the operations for which `wanted` holds, and with `show` brings the first into sight. */
  mark(wanted, show) {
    this.marked = new Set(this.rows.flatMap(({ operation }, i) => (operation && wanted(operation) ? [i] : [])));
    const [first] = this.marked;
    if (show && first !== undefined) this.into(first);
    this.paint();
  }

  /** Brings a row into sight. */
  into(index) {
    const { scroll } = this, y = index * this.row, x = this.rows[index].column * this.width;
    const tall = scroll.clientHeight - AXIS, wide = scroll.clientWidth - this.labelWidth;
    if (y < scroll.scrollTop || y > scroll.scrollTop + tall - 2 * this.row) scroll.scrollTop = Math.max(0, y - tall / 3);
    if (x < scroll.scrollLeft || x > scroll.scrollLeft + wide - 4 * this.width) scroll.scrollLeft = Math.max(0, x - wide / 3);
    this.paint();
  }

  toDiagonal() {
    const row = this.rows[Math.floor(this.scroll.scrollTop / this.row)];
    if (row) this.scroll.scrollLeft = Math.max(0, row.column * this.width - 40);
  }

  zoom(factor, at = (this.scroll.clientWidth - this.labelWidth) / 3) {
    const cycle = (this.scroll.scrollLeft + at) / this.width;
    this.width = Math.min(WIDE, Math.max(NARROW, this.width * factor));
    this.fits = "";
    this.shared = null;
    this.resize();
    this.scroll.scrollLeft = cycle * this.width - at;
    this.paint();
  }

  /** Brings everything into sight; `shared`: the width of columns that another picture has, too, and whether both have names. */
  fit(shared = null) {
    this.fits = "all";
    this.shared = shared;
    this.resize();
  }

  resize() {
    const { scroll, sizer } = this;
    if (!scroll.clientWidth) return;
    // With everything in sight, rows may be too low for their names. On a telephone, the picture is as tall as its content.
    const height = this.fits === "all" ? Math.min(scroll.clientHeight, SIGHT * innerHeight) : scroll.clientHeight;
    const room = (height - AXIS - 8) / Math.max(1, this.rows.length), isAll = this.fits === "all" && room < ROW;
    this.row = isAll ? Math.max(TINY, room) : Math.floor(Math.min(TALL, Math.max(ROW, room)));
    const isNamed = this.row >= NAMED && (this.shared?.named ?? true);
    this.parent.classList.toggle("tp-tiny", !isNamed);
    // As wide as the longest label asks for, but no wider than leaves the chart its room.
    this.labelWidth = isNamed ? Math.round(Math.min(this.longest * 7.3 + 18, 430, 0.42 * scroll.clientWidth)) : 0;
    // Until somebody zooms, the picture follows the size: a new one fills the width, as far as its columns can be told apart and are no bars.
    const [least, most] = { new: scroll.clientWidth < PHONE ? THIN : USUAL, all: [NARROW, WIDE] }[this.fits] ?? [this.width, this.width];
    this.width = this.shared?.width ?? Math.min(most, Math.max(least, (scroll.clientWidth - this.labelWidth - 4 * GAP) / Math.max(1, this.columns)));
    // Where the rows leave room, the stalls have it.
    if (this.fits === "new" && this.rows.length && !this.stalls.open && scroll.clientHeight - AXIS - this.rows.length * this.row > ROOM) this.stalls.open = this.opened = true;
    this.parent.style.setProperty("--row", `${this.row}px`);
    sizer.style.width = `${this.labelWidth + this.columns * this.width + 24}px`;
    sizer.style.height = `${AXIS + this.rows.length * this.row + 8}px`;
    this.paint();
  }

  paint() {
    const { scroll, view, svg, axis, labels, rows, width: w } = this;
    const wide = scroll.clientWidth, tall = scroll.clientHeight;
    if (!wide || this.labelWidth === undefined) return;
    view.style.width = `${wide}px`;
    view.style.height = `${tall}px`;
    labels.style.width = this.corner.style.width = `${this.labelWidth}px`;
    const left = scroll.scrollLeft, top = scroll.scrollTop;
    const from = Math.max(0, Math.floor(top / this.row) - BEYOND), to = Math.min(rows.length, Math.ceil((top + tall) / this.row) + BEYOND);
    const x = (column) => this.labelWidth + GAP + column * w - left, y = (row) => AXIS + row * this.row - top;
    const [low, high] = [Math.floor(left / w) - 1, Math.ceil((left + wide) / w) + 1];
    for (const one of [svg, axis]) one.replaceChildren();
    svg.setAttribute("width", wide);
    svg.setAttribute("height", tall);
    axis.setAttribute("width", wide);
    axis.setAttribute("height", AXIS);
    for (const [one, height] of this.range ? [[svg, tall], [axis, AXIS]] : []) {
      one.append(shape("rect", { class: "tp-range", x: x(this.range[0]), y: 0, width: (this.range[1] - this.range[0] + 1) * w, height }));
    }
    this.paintAxis(from, to, low, high, x, y);
    const focused = document.activeElement?.dataset?.row;
    const shown = [];
    for (let i = from; i < to; i++) {
      this.paintRow(i, x, y);
      shown.push(this.label(i, y));
    }
    labels.replaceChildren(...shown);
    this.tabStop();
    if (focused !== undefined) labels.querySelector(`[data-row="${focused}"]`)?.focus({ preventScroll: true });
    for (const link of this.chain) {
      if (Math.max(link.from, link.to) < from || Math.min(link.from, link.to) > to) continue;
      const [x1, y1, x2, y2] = [x(rows[link.from].column) + w / 2, y(link.from) + this.row / 2, x(rows[link.to].column) + w / 2, y(link.to) + this.row / 2];
      const path = shape("path", { class: "tp-link", d: `M${x1} ${y1} H${x2} V${y2}` });
      path.dataset.tip = link.tip;
      svg.append(path);
    }
  }

  paintAxis(from, to, low, high, x, y) {
    const { svg, axis, stretches, width: w } = this;
    // A label needs some 34 pixels.
    const step = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000].find((step) => step * w >= 34) ?? 2000;
    for (const { start, rows: [first, last] } of stretches) {
      // No other stretch has its columns: each has its own numbers on the axis.
      const end = stretches[stretches.findIndex((one) => one.start > start)]?.start ?? this.columns;
      if (end < low || start > high) continue;
      for (let cycle = step; start + cycle - 1 < end; cycle += step) {
        const column = start + cycle - 1;
        if (column < low || column > high) continue;
        const at = x(column) + w / 2;
        svg.append(shape("line", { class: "tp-grid", x1: at, x2: at, y1: Math.max(AXIS, y(first)), y2: Math.max(AXIS, y(last)) }));
        const text = shape("text", { x: at, y: 15, "text-anchor": "middle" });
        text.textContent = cycle;
        axis.append(text, shape("line", { class: "tp-grid", x1: at, x2: at, y1: AXIS - 5, y2: AXIS }));
      }
      axis.append(shape("line", { class: "tp-stretch", x1: x(start) - GAP / 2, x2: x(start) - GAP / 2, y1: 0, y2: AXIS }));
      if (last > from && first < to) svg.append(shape("line", { class: "tp-stretch", x1: 0, x2: this.scroll.clientWidth, y1: y(first), y2: y(first) }));
    }
  }

  paintRow(i, x, y) {
    const { svg, width: w } = this, row = this.rows[i], { bundle, operation, column } = row, top = y(i);
    if (this.marked.has(i)) svg.append(shape("rect", { class: "tp-band", x: 0, width: "100%", y: top, height: this.row }));
    if (row.first) {
      let at = column;
      for (const stall of [...bundle.stalls].reverse()) {
        at -= stall.cycles;
        const box = shape("rect", { class: `tp-stall tp-k-${stall.cause.replace(" ", "-")}`, x: x(at), y: top + 0.28 * this.row, width: stall.cycles * w, height: Math.max(1, 0.44 * this.row) });
        box.dataset.tip = `${plural(stall.cycles, "cycle")} lost before cycle ${bundle.cycle}: ${KINDS[stall.cause] ?? stall.cause}\n${stall.text}`;
        svg.append(box);
      }
    }
    const group = shape("g", { class: operation ? "tp-operation" : "tp-idle", "data-row": i });
    if (operation) group.style.setProperty("--fill", this.colours.get(operation.unit));
    const latency = operation?.latency ?? 1;
    if (latency > 1) group.append(shape("rect", { class: "tp-run", x: x(column + 1), y: top + 0.22 * this.row, width: (latency - 1) * w, height: Math.max(1, 0.56 * this.row) }));
    group.append(shape("rect", { class: "tp-issue", x: x(column), y: top + 0.11 * this.row, width: Math.max(w, 2), height: Math.max(1, 0.78 * this.row), rx: 1 }));
    if (operation?.critical) group.append(shape("rect", { class: "tp-critical", x: x(column) - 0.5, y: top + 0.08 * this.row, width: Math.max(w, 2) + 1, height: 0.84 * this.row, rx: 1.5 }));
    svg.append(group);
  }

  label(i, y) {
    const row = this.rows[i], { operation } = row;
    const label = node("div", { class: "tp-label", role: "listitem", "data-row": i }, operation?.text ?? "nop");
    label.style.top = `${y(i)}px`;
    const stretch = this.stretches.find(({ from, rows: [first] }) => from && first === i);
    if (stretch) label.append(node("span", { class: "tp-from", text: stretch.from }));
    if (row.first) label.classList.add("tp-first");
    if (operation?.critical) label.classList.add("tp-on-chain");
    if (this.marked.has(i)) label.classList.add("tp-marked");
    return label;
  }
}
