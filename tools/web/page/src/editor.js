// Editor: CodeMirror as a client of Takt's language server, which provides everything that depends on the language, including colours.
import { autocompletion, closeBrackets, closeBracketsKeymap, completionKeymap } from "@codemirror/autocomplete";
import { defaultKeymap, history, historyKeymap } from "@codemirror/commands";
import { bracketMatching, foldGutter, foldKeymap, foldService } from "@codemirror/language";
import { lintGutter, lintKeymap, setDiagnostics } from "@codemirror/lint";
import { highlightSelectionMatches, searchKeymap } from "@codemirror/search";
import { Compartment, EditorState, RangeSet, StateEffect, StateField } from "@codemirror/state";
import {
  Decoration, EditorView, GutterMarker, WidgetType, drawSelection, gutter, highlightActiveLine, highlightActiveLineGutter,
  highlightSpecialChars, keymap, lineNumbers, rectangularSelection,
} from "@codemirror/view";
import {
  LSPClient, LSPPlugin, findReferencesKeymap, formatKeymap, hoverTooltips, jumpToDefinitionKeymap, renameKeymap, serverCompletion,
} from "@codemirror/lsp-client";
import { REPLACED, Stopped } from "./thread.js";

/** Pauses of the user after which the program is read, and after which it is scheduled; ms. */
const PAUSE = 60, LONG_PAUSE = 350;
/** Time limit for an answer, after which the server is stopped; twice as long whenever somebody asks again; ms. */
export const LANGUAGE_LIMIT = 20_000;

/** Distance of the debugger's line from the editor's edges in pixels. */
const MARGIN = 60;
/** Changes by the sliders. */
const TUNE = "input.tune";

// ---- Colours, from semantic tokens.

const setColours = StateEffect.define();
const colours = StateField.define({
  create: () => Decoration.none,
  update(value, tr) {
    value = value.map(tr.changes);
    for (const effect of tr.effects) if (effect.is(setColours)) value = effect.value;
    return value;
  },
  provide: (field) => EditorView.decorations.from(field),
});

function decorations(doc, data, legend) {
  const marks = [];
  let line = 0, character = 0;
  for (let i = 0; i + 4 < data.length; i += 5) {
    const [lines, start, length, type] = data.slice(i, i + 5);
    line += lines;
    character = lines ? start : character + start;
    if (line >= doc.lines) break;
    const from = doc.line(line + 1).from + character, to = Math.min(from + length, doc.length);
    if (from < to) marks.push(Decoration.mark({ class: `tok-${legend[type]}` }).range(from, to));
  }
  return Decoration.set(marks, true);
}

// ---- Cycles: inlay hints after lines, lenses above them.

class Hint extends WidgetType {
  constructor(text, more, lens) {
    super();
    Object.assign(this, { text, more, lens });
  }
  eq(other) {
    return other.text === this.text && other.lens === this.lens && other.more === this.more;
  }
  toDOM() {
    const element = document.createElement(this.lens ? "div" : "span");
    element.className = this.lens ? "lens" : "hint";
    element.textContent = this.text;
    if (this.more) element.title = this.more;
    return element;
  }
  // A click on a hint puts the cursor into its line, as one on the text would.
  ignoreEvent() {
    return false;
  }
}

const setHints = StateEffect.define();
const hints = StateField.define({
  create: () => Decoration.none,
  update(value, tr) {
    value = value.map(tr.changes);
    for (const effect of tr.effects) if (effect.is(setHints)) value = effect.value;
    return value;
  },
  provide: (field) => EditorView.decorations.from(field),
});

// ---- Folds: end of each fold by its visible line.

const setFolds = StateEffect.define();
const folds = StateField.define({
  create: () => RangeSet.empty,
  update(value, tr) {
    value = value.map(tr.changes);
    for (const effect of tr.effects) if (effect.is(setFolds)) value = effect.value;
    return value;
  },
});
const mark = Decoration.mark({});
const folding = foldService.of((state, start, end) => {
  let found = null;
  // If several folds begin on a line, take the longest.
  state.field(folds).between(start, end, (from, to) => {
    if (from >= start && from <= end && to > end && to > (found?.to ?? 0)) found = { from: end, to };
  });
  return found;
});

/** CodeMirror's own extensions. Folds are known once the server has answered. */
const base = [
  lineNumbers(), highlightActiveLineGutter(), highlightSpecialChars(), history(), drawSelection(), bracketMatching(), closeBrackets(),
  foldGutter({ foldingChanged: (update) => update.transactions.some((tr) => tr.effects.some((effect) => effect.is(setFolds))) }),
  autocompletion(), rectangularSelection(), highlightActiveLine(), highlightSelectionMatches(), EditorState.allowMultipleSelections.of(true),
  keymap.of([...closeBracketsKeymap, ...defaultKeymap, ...searchKeymap, ...historyKeymap, ...foldKeymap, ...completionKeymap, ...lintKeymap]),
];

// ---- Breakpoints: lines that are passed to each new debugger.

class Stop extends GutterMarker {
  toDOM() {
    const element = document.createElement("span");
    element.className = "stop";
    element.textContent = "●";
    element.title = "a breakpoint; click to remove it";
    return element;
  }
}
const stop = new Stop();
const setStops = StateEffect.define();
const stops = StateField.define({
  create: () => RangeSet.empty,
  update(value, tr) {
    value = value.map(tr.changes);
    for (const effect of tr.effects) if (effect.is(setStops)) value = RangeSet.of(effect.value.map((line) => stop.range(tr.state.doc.line(line).from)));
    return value;
  },
});

// ---- Position of the debugger.

class Arrow extends GutterMarker {
  toDOM() {
    const element = document.createElement("span");
    element.textContent = "▶";
    element.title = "issues next";
    return element;
  }
}
const arrow = new Arrow();
const setPlace = StateEffect.define();
const place = StateField.define({
  create: () => ({ lines: Decoration.none, markers: RangeSet.empty }),
  update(value, tr) {
    if (tr.docChanged) value = { lines: value.lines.map(tr.changes), markers: value.markers.map(tr.changes) };
    for (const effect of tr.effects) if (effect.is(setPlace)) value = effect.value;
    return value;
  },
  provide: (field) => EditorView.decorations.from(field, (value) => value.lines),
});

// ---- Colours of lines, as those of the bundles.

const setHues = StateEffect.define();
const hues = StateField.define({
  create: () => Decoration.none,
  update(value, tr) {
    value = value.map(tr.changes);
    for (const effect of tr.effects) if (effect.is(setHues)) value = effect.value;
    return value;
  },
  provide: (field) => EditorView.decorations.from(field),
});

const theme = EditorView.theme({
  "&": { height: "100%", fontSize: "13px", backgroundColor: "var(--bg)", color: "var(--fg)" },
  ".cm-scroller": { fontFamily: "ui-monospace, 'DejaVu Sans Mono', Menlo, Consolas, monospace", lineHeight: "1.5" },
  ".cm-content": { caretColor: "var(--fg)" },
  ".cm-cursor": { borderLeftColor: "var(--fg)" },
  ".cm-gutters": { backgroundColor: "var(--panel)", color: "var(--dim)", border: "none" },
  ".cm-activeLine, .cm-activeLineGutter": { backgroundColor: "var(--line)" },
  "&.cm-focused > .cm-scroller > .cm-selectionLayer .cm-selectionBackground, .cm-selectionBackground": { backgroundColor: "var(--select)" },
  ".cm-tooltip": { backgroundColor: "var(--panel)", color: "var(--fg)", border: "1px solid var(--edge)", maxWidth: "min(44em, 92vw)" },
  ".cm-tooltip-autocomplete ul li[aria-selected]": { backgroundColor: "var(--accent)", color: "var(--on-accent)" },
  ".cm-panels": { backgroundColor: "var(--panel)", color: "var(--fg)" },
  ".cm-lsp-documentation": { padding: "2px 8px" },
});

/** Creates a read-only view in the editor's style. */
export function reader(parent, text, about) {
  return new EditorView({
    parent,
    state: EditorState.create({ doc: text, extensions: [base, theme, EditorState.readOnly.of(true), EditorView.contentAttributes.of({ "aria-label": about })] }),
  });
}

export class Editor {
  /**
   * @param parent element that receives the editor
   * @param thread worker of the language server
   * @param told called with an error message
   * @param late called with the seconds after which the server was stopped
   * @param diagnosed called with the mistakes of the text: `line` and `message`
   * @param changed called after a change of the text
   * @param stopped called with a line whose breakpoint is to be toggled
   * @param showFile called with the name of another file; returns the view that shows it, if any
   * @param moved called with the new line of the cursor
   */
  constructor(parent, { thread, told, late, diagnosed, changed, stopped, showFile, moved }) {
    Object.assign(this, { thread, told, late, tellsMistakes: diagnosed, showFile });
    this.stopped = stopped;
    this.server = new Compartment();
    this.limit = LANGUAGE_LIMIT;
    this.version = 0;
    this.scheduled = 0;
    /** Places of the constants' values by name; they move with the text. */
    this.places = new Map();
    // Columns of the comments behind constants: as they were, and as they were left.
    this.columns = new Map();
    const follow = EditorView.updateListener.of((update) => {
      if (update.selectionSet && !update.docChanged) moved(this.line);
      if (!update.docChanged) return;
      this.version++;
      for (const place of this.places.values()) Object.assign(place, { from: update.changes.mapPos(place.from, -1), to: update.changes.mapPos(place.to, 1) });
      changed(update.transactions.every((tr) => tr.isUserEvent(TUNE)) ? "tune" : undefined);
      this.later();
    });
    this.view = new EditorView({
      parent,
      state: EditorState.create({
        extensions: [
          base, lintGutter(), theme, colours, hues, hints, place, stops, folds, folding, follow,
          gutter({
            class: "cm-arrow", markers: (view) => [view.state.field(place).markers, view.state.field(stops)], initialSpacer: () => arrow,
            domEventHandlers: { mousedown: (view, line) => (stopped(view.state.doc.lineAt(line.from).number), true) },
          }),
          EditorView.contentAttributes.of({ "aria-label": "Takt source", spellcheck: "false", autocorrect: "off", autocapitalize: "off" }),
          this.server.of([]),
        ],
      }),
    });
  }

  get text() {
    return this.view.state.doc.toString();
  }

  /** Constants of the text as it was in a version. If the text has changed since, the places of before have moved with it. */
  know(constants, version) {
    if (version === this.version) this.places = new Map(constants.map(({ name, from, to }) => [name, { from, to }]));
  }

  /** Text of a constant's value. */
  valueOf(name) {
    const place = this.places.get(name);
    return place && this.view.state.sliceDoc(place.from, place.to);
  }

  /** Gives constants other values: a map from names to texts. */
  tune(texts) {
    const changes = [...texts].filter(([name]) => this.places.has(name)).flatMap(([name, insert]) => [{ ...this.places.get(name), insert }, ...this.aligned(name, insert)]);
    this.view.dispatch({ changes, userEvent: TUNE });
  }

  /** Change of the blanks behind a value, so that the comment keeps its column, or comes back to it from behind a long value. */
  aligned(name, text) {
    const { doc } = this.view.state, { from, to } = this.places.get(name), line = doc.lineAt(to), [blanks] = /^ +(?=;)/.exec(doc.sliceString(to, line.to)) ?? [""];
    if (!blanks) return [];
    const at = to + blanks.length - line.from, before = this.columns.get(name), column = before?.left === at ? before.column : at;
    const end = from - line.from + text.length, more = Math.max(1, column - end) - blanks.length;
    this.columns.set(name, { column, left: end + blanks.length + more });
    return more > 0 ? [{ from: line.from + at, insert: " ".repeat(more) }] : more < 0 ? [{ from: line.from + at + more, to: line.from + at }] : [];
  }

  /** Opens a text under a name, for a machine. */
  async open(name, text, machine) {
    Object.assign(this, { name, machine, limit: LANGUAGE_LIMIT });
    this.columns.clear();
    this.close();
    this.view.dispatch({ changes: { from: 0, to: this.view.state.doc.length, insert: text }, selection: { anchor: 0 } });
    await this.connect();
  }

  async use(machine) {
    this.machine = machine;
    this.close();
    await this.connect();
  }

  close() {
    clearTimeout(this.pause);
    clearTimeout(this.longPause);
    // What the server still does is about the text before, and the next text would wait for it.
    if (this.thread.busy) this.thread.stop(REPLACED);
    if (!this.client) return;
    this.view.dispatch({ effects: [this.server.reconfigure([]), setHints.of(Decoration.none)] });
    this.client.disconnect();
    this.client = null;
  }

  /** Connects to the server; nothing is said of a connection that another one replaces. */
  async connect() {
    try {
      await this.connected();
    } catch (error) {
      if (!(error instanceof Stopped)) this.told(error.message);
    }
  }

  async connected() {
    const client = new LSPClient({
      timeout: this.limit,
      notificationHandlers: {
        "textDocument/publishDiagnostics": (_, params) => this.diagnosed(params),
        "window/logMessage": (_, params) => (this.told(params.message), true),
      },
      extensions: [
        { clientCapabilities: { textDocument: { publishDiagnostics: {}, inlayHint: {}, semanticTokens: { requests: { full: true }, tokenTypes: [], tokenModifiers: [], formats: ["relative"] } } } },
        serverCompletion(), hoverTooltips(),
        keymap.of([...formatKeymap, ...renameKeymap, ...jumpToDefinitionKeymap, ...findReferencesKeymap]),
      ],
    });
    this.client = client;
    // The URI of another file is its URI-encoded name: `%3Cmath.s%3E`.
    client.workspace.displayFile = async (uri) => (uri === this.name ? this.view : this.showFile(decodeURIComponent(uri)));
    await this.ask("lsp.start", { machine: this.machine });
    if (this.client !== client) return;
    this.handlers = new Set();
    client.connect({
      send: (message) => {
        this.ask("lsp", JSON.parse(message)).then((said) => this.said(client, said), () => {});
      },
      subscribe: (handler) => this.handlers.add(handler),
      unsubscribe: (handler) => this.handlers.delete(handler),
    });
    try {
      await client.initializing;
    } catch (error) {
      if (this.client === client) throw error;
    }
    if (this.client !== client) return;
    this.view.dispatch({ effects: this.server.reconfigure(client.plugin(this.name, "takt")) });
    await this.read();
    clearTimeout(this.longPause);
    this.longPause = setTimeout(() => this.count(), 0);
  }

  /** Passes messages of the server to a client, if it still exists. */
  said(client, messages) {
    if (this.client !== client) return;
    for (const message of messages ?? []) for (const handler of this.handlers) handler(JSON.stringify(message));
  }

  /** Calls the worker; restarts it after a timeout. */
  async ask(method, params) {
    const limit = setTimeout(() => {
      this.lost = true;
      this.late(this.limit / 1000);
      this.thread.stop();
    }, this.limit);
    try {
      return await this.thread.call(method, params);
    } finally {
      clearTimeout(limit);
    }
  }

  later() {
    clearTimeout(this.pause);
    clearTimeout(this.longPause);
    if (this.lost) return void this.again();
    if (!this.client) return;
    this.pause = setTimeout(() => this.read(), PAUSE);
    this.longPause = setTimeout(() => this.count(), LONG_PAUSE);
  }

  /** Begins again with a server that was stopped; `patient`: with more time. */
  again(patient) {
    this.lost = false;
    if (patient) this.limit *= 2;
    this.close();
    return this.connect();
  }

  /** Fetches results that need no scheduling: diagnostics and colours. */
  async read() {
    const { client, version } = this;
    if (!client?.serverCapabilities) return;
    try {
      client.sync();
      this.said(client, await this.ask("lsp.check"));
      const document = { textDocument: { uri: this.name } };
      const [tokens, ranges] = await Promise.all([
        client.request("textDocument/semanticTokens/full", document),
        client.request("textDocument/foldingRange", document),
      ]);
      if (this.client !== client || this.version !== version) return;
      const legend = client.serverCapabilities.semanticTokensProvider.legend.tokenTypes, { doc } = this.view.state;
      const fold = ({ startLine, endLine }) => mark.range(doc.line(startLine + 1).from, doc.line(endLine + 1).to);
      const there = ranges.filter(({ endLine }) => endLine < doc.lines).map(fold);
      this.view.dispatch({ effects: [setColours.of(decorations(doc, tokens.data, legend)), setFolds.of(RangeSet.of(there, true))] });
    } catch {
      // The server was restarted, or the text has changed.
    }
  }

  /** Fetches results of scheduling: cycles. */
  async count() {
    const { client, version } = this;
    if (!client?.serverCapabilities) return;
    try {
      for (let more = true; more && this.client === client; ) {
        const answer = await this.ask("lsp.schedule");
        this.said(client, answer.messages);
        more = answer.more;
      }
      const doc = this.view.state.doc, document = { textDocument: { uri: this.name } };
      const range = { start: { line: 0, character: 0 }, end: { line: doc.lines, character: 0 } };
      const [found, lenses] = await Promise.all([
        client.request("textDocument/inlayHint", { ...document, range }),
        client.request("textDocument/codeLens", document),
      ]);
      if (this.client !== client || this.version !== version) return;
      const at = (position) => Math.min(doc.line(Math.min(position.line + 1, doc.lines)).from + position.character, doc.length);
      const widgets = [
        ...found.map((hint) => Decoration.widget({ widget: new Hint(hint.label, hint.tooltip?.value), side: 1 }).range(at(hint.position))),
        ...lenses.map((lens) => Decoration.widget({ widget: new Hint(lens.command.title, "", true), block: true, side: -1 }).range(doc.lineAt(at(lens.range.start)).from)),
      ];
      this.scheduled = version;
      this.view.dispatch({ effects: setHints.of(Decoration.set(widgets, true)) });
    } catch {
      // The server was restarted, or the text has changed.
    }
  }

  diagnosed(params) {
    if (params.uri !== this.name) return true;
    const plugin = LSPPlugin.get(this.view);
    if (!plugin) return true;
    const place = (position) => Math.min(plugin.unsyncedChanges.mapPos(plugin.fromPosition(position, plugin.syncedDoc)), this.view.state.doc.length);
    const severities = ["error", "error", "warning", "info", "hint"];
    const show = (fixes) => {
      const diagnostics = params.diagnostics.map((item) => ({
        from: place(item.range.start), to: place(item.range.end), severity: severities[item.severity ?? 1], message: item.message,
        actions: fixes(item).map((fix) => ({ name: fix.title, apply: (view) => this.apply(view, fix) })),
      }));
      this.view.dispatch(setDiagnostics(this.view.state, diagnostics));
    };
    show(() => []);
    this.tellsMistakes(params.diagnostics.filter(({ severity }) => (severity ?? 1) === 1).map(({ range, message }) => ({ line: range.start.line + 1, message: message.split("\n")[0] })));
    if (params.diagnostics.length) this.fixes(params, show);
    return true;
  }

  async fixes(params, show) {
    const { client, version } = this;
    const range = { start: { line: 0, character: 0 }, end: { line: this.view.state.doc.lines, character: 0 } };
    try {
      const found = await client.request("textDocument/codeAction", { textDocument: { uri: this.name }, range, context: { diagnostics: params.diagnostics } });
      if (this.client !== client || this.version !== version) return;
      const same = (a, b) => a.message === b.message && JSON.stringify(a.range) === JSON.stringify(b.range);
      show((item) => found.filter((fix) => fix.diagnostics?.some((one) => same(one, item))));
    } catch {
      // Show the diagnostics without fixes.
    }
  }

  apply(view, fix) {
    const plugin = LSPPlugin.get(view);
    const edits = Object.entries(fix.edit?.changes ?? {}).filter(([uri]) => uri === this.name).flatMap(([, edits]) => edits);
    view.dispatch({ changes: edits.map((edit) => ({ from: plugin.fromPosition(edit.range.start), to: plugin.fromPosition(edit.range.end), insert: edit.newText })), userEvent: "input.fix" });
  }

  /** Shows the debugger's position: the line that issues next, and the other lines of the same bundle. */
  stand(line, part = []) {
    const doc = this.view.state.doc;
    const exists = (number) => number >= 1 && number <= doc.lines;
    const lines = [...new Set(part)].filter(exists).filter((number) => number !== line).map((number) => Decoration.line({ class: "cm-part" }).range(doc.line(number).from));
    if (exists(line)) lines.push(Decoration.line({ class: "cm-next" }).range(doc.line(line).from));
    const markers = exists(line) ? RangeSet.of(arrow.range(doc.line(line).from)) : RangeSet.empty;
    const effects = [setPlace.of({ lines: Decoration.set(lines, true), markers })];
    this.view.dispatch({ effects });
    // Until somebody steps, the text is to be read from its beginning.
    if (!exists(line) || !document.body.classList.contains("steps")) return;
    // Only the editor scrolls: on a telephone, the page stays at the picture above.
    const { scrollDOM } = this.view, block = this.view.lineBlockAt(doc.line(line).from), { scrollTop, clientHeight } = scrollDOM;
    if (block.top < scrollTop + MARGIN) scrollDOM.scrollTop = block.top - MARGIN;
    else if (block.bottom > scrollTop + clientHeight - MARGIN) scrollDOM.scrollTop = block.bottom - clientHeight + MARGIN;
  }

  /** Colours lines: a map from their numbers to hues. */
  paint(map) {
    const { doc } = this.view.state, lines = [...map].filter(([line]) => line <= doc.lines);
    const marks = lines.map(([line, hue]) => Decoration.line({ class: "cm-hue", attributes: { style: `--hue:${hue}` } }).range(doc.line(line).from));
    this.view.dispatch({ effects: setHues.of(Decoration.set(marks, true)) });
  }

  /** Moves the cursor to a line (from 1) and a column (from 0). */
  goTo(line, column) {
    this.view.dispatch({ selection: { anchor: this.view.state.doc.line(line).from + column }, scrollIntoView: true });
    this.focus();
  }

  /** Line of the cursor, from 1. */
  get line() {
    return this.view.state.doc.lineAt(this.view.state.selection.main.head).number;
  }

  /** Current lines of the breakpoints. */
  get stops() {
    const { doc } = this.view.state, lines = [];
    this.view.state.field(stops).between(0, doc.length, (from) => void lines.push(doc.lineAt(from).number));
    return [...new Set(lines)];
  }

  set stops(lines) {
    this.view.dispatch({ effects: setStops.of(lines.filter((line) => line >= 1 && line <= this.view.state.doc.lines).sort((a, b) => a - b)) });
  }

  focus() {
    this.view.focus();
  }
}
