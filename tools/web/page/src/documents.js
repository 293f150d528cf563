// Documents that the page keeps in the browser, each under its own key, so that two open pages do not overwrite each other's.
// A link or an example opens as an additional document.

const PREFIX = "takt-playground:";
/** Key of the single document of earlier versions. */
const OLD = "takt-playground";
/** Key of the document that this page shows, for a reload. */
const HERE = "takt-playground-here";
/** Maximum number of unchanged documents; beyond it, those unused for longest are dropped. */
const MOST = 12;

export class Documents {
  constructor() {
    const old = this.read(OLD);
    if (old) {
      this.write({ ...old, id: crypto.randomUUID?.() ?? `${Date.now()}`, from: "own", changed: true, used: Date.now() });
      localStorage.removeItem(OLD);
    }
    /** Documents in memory, for browsers without storage. */
    this.here = new Map();
  }

  read(key) {
    try {
      const document = JSON.parse(localStorage.getItem(key));
      return typeof document?.source === "string" ? document : null;
    } catch {
      return null;
    }
  }

  /** Stores a document; returns false if the browser does not permit it. */
  write(document) {
    try {
      localStorage.setItem(PREFIX + document.id, JSON.stringify(document));
      return true;
    } catch {
      this.here?.set(document.id, document);
      return false;
    }
  }

  get(id) {
    return this.read(PREFIX + id) ?? this.here.get(id) ?? null;
  }

  /** All documents, in order of opening. */
  list() {
    const found = new Map(this.here);
    try {
      for (const key of Object.keys(localStorage)) {
        const document = key.startsWith(PREFIX) && this.read(key);
        if (document) found.set(document.id, document);
      }
    } catch {
      // The browser has no storage.
    }
    return [...found.values()].sort((a, b) => a.made - b.made);
  }

  /** Document to show at the start: after a reload, the page's previous document, otherwise the last used. */
  last() {
    const all = this.list();
    let here = null;
    try {
      here = sessionStorage.getItem(HERE);
    } catch {
      // The browser has no storage.
    }
    return { reloaded: all.find(({ id }) => id === here) ?? null, last: all.reduce((a, b) => (a && a.used > b.used ? a : b), null) };
  }

  /**
   * Document for a program from a link or an example: an unchanged one from the same origin, for an example also that of another example
   * which nobody changed, otherwise a new one. `from` is `link` or `example`; `key` identifies the origin.
   */
  open({ name, machine, source, inputs, periods, plant, parameters, changes }, from, key) {
    const idle = this.list().filter((document) => !document.changed);
    const known = idle.find((document) => document.key === key) ?? (from === "example" ? idle.find((document) => document.from === from) : undefined);
    const document = { id: known?.id ?? `${Date.now()}-${Math.random().toString(36).slice(2)}`, made: known?.made ?? Date.now(), name: name || "main.s", machine: machine || "", source, inputs: inputs ?? "", periods, plant: plant ?? null, parameters: parameters ?? {}, changes: changes ?? [], from, key, changed: false };
    this.use(document);
    this.forget(document.id);
    return document;
  }

  /** Shows a list of the documents, each with buttons to open and close; `here` is the one on display. */
  show(parent, here, open, close) {
    const all = this.list(), button = (set) => Object.assign(document.createElement("button"), set);
    parent.replaceChildren(...all.map((one) => {
      const origin = { link: "from a link", example: "example" }[one.from] ?? "";
      const name = button({ textContent: one.name, title: `${one.name}${origin && `, ${origin}`}${one.changed ? ", changed by you" : ""}`, onclick: () => one.id === here || open(one) });
      const alike = all.filter(({ name, changed }) => changed && name === one.name), number = alike.indexOf(one) + 1;
      name.append(" ", Object.assign(document.createElement("small"), { textContent: !one.changed ? origin : number > 1 ? `yours, ${number}` : "yours" }));
      if (one.id === here) name.setAttribute("aria-current", "true");
      const entry = document.createElement("span");
      entry.className = one.id === here ? "here" : "";
      entry.append(name, button({ textContent: "×", title: `Close ${one.name}`, ariaLabel: `Close ${one.name}`, className: "close", onclick: () => close(one) }));
      return entry;
    }));
  }

  /** Records that a document is on display now. */
  use(document) {
    document.used = Date.now();
    try {
      sessionStorage.setItem(HERE, document.id);
    } catch {
      // The browser has no storage.
    }
    return this.write(document);
  }

  remove(id) {
    this.here.delete(id);
    try {
      localStorage.removeItem(PREFIX + id);
    } catch {
      // The browser has no storage.
    }
  }

  forget(keep) {
    const idle = this.list().filter((document) => !document.changed && document.id !== keep).sort((a, b) => a.used - b.used);
    for (const { id } of idle.slice(0, Math.max(0, idle.length - MOST))) this.remove(id);
  }
}
