// The documents that the page keeps in the browser, each under a key of its own: two pages that are open at once do not overwrite
// one another's. A link or an example opens beside what is there.

const PREFIX = "takt-playground:";
/** Where the only document was kept before there were several. */
const OLD = "takt-playground";
/** Which document this page shows, for a reload. */
const HERE = "takt-playground-here";
/** Documents that nobody has changed are forgotten beyond so many, the longest unused first. */
const MOST = 12;

export class Documents {
  constructor() {
    const old = this.read(OLD);
    if (old) {
      this.write({ ...old, id: crypto.randomUUID?.() ?? `${Date.now()}`, from: "own", changed: true, used: Date.now() });
      localStorage.removeItem(OLD);
    }
    /** Documents of a browser that keeps nothing. */
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

  /** Keeps a document; false if the browser does not. */
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

  /** All documents, in the order in which they were opened. */
  list() {
    const found = new Map(this.here);
    try {
      for (const key of Object.keys(localStorage)) {
        const document = key.startsWith(PREFIX) && this.read(key);
        if (document) found.set(document.id, document);
      }
    } catch {
      // It keeps nothing.
    }
    return [...found.values()].sort((a, b) => a.made - b.made);
  }

  /** The document to show when the page opens: that of this page before a reload, else the one used last. */
  last() {
    const all = this.list();
    let here = null;
    try {
      here = sessionStorage.getItem(HERE);
    } catch {
      // As above.
    }
    return { reloaded: all.find(({ id }) => id === here) ?? null, last: all.reduce((a, b) => (a && a.used > b.used ? a : b), null) };
  }

  /**
   * The document for a program from elsewhere: one that was opened from the same place and not changed since, else a new one.
   * `from` is `link` or `example`, `key` says which.
   */
  open({ name, machine, source, inputs, periods }, from, key) {
    const known = this.list().find((document) => document.key === key && !document.changed);
    const document = { id: known?.id ?? `${Date.now()}-${Math.random().toString(36).slice(2)}`, made: known?.made ?? Date.now(), name: name || "main.s", machine: machine || "", source, inputs: inputs ?? "", periods, from, key, changed: false };
    this.use(document);
    this.forget(document.id);
    return document;
  }

  /** Shows the documents by name, where there are several: each can be opened and closed. `here` is the one that is shown. */
  show(parent, here, open, close) {
    const all = this.list(), button = (set) => Object.assign(document.createElement("button"), set);
    parent.hidden = all.length < 2;
    parent.replaceChildren(...all.map((one) => {
      const origin = { link: "from a link", example: "example" }[one.from] ?? "";
      const name = button({ textContent: one.name, title: `${one.name}${origin && `, ${origin}`}${one.changed ? ", changed by you" : ""}`, onclick: () => one.id === here || open(one) });
      name.append(" ", Object.assign(document.createElement("small"), { textContent: one.changed ? "yours" : origin }));
      if (one.id === here) name.setAttribute("aria-current", "true");
      const entry = document.createElement("span");
      entry.className = one.id === here ? "here" : "";
      entry.append(name, button({ textContent: "×", title: `Close ${one.name}`, ariaLabel: `Close ${one.name}`, className: "close", onclick: () => close(one) }));
      return entry;
    }));
  }

  /** Notes that a document is shown now. */
  use(document) {
    document.used = Date.now();
    try {
      sessionStorage.setItem(HERE, document.id);
    } catch {
      // As above.
    }
    return this.write(document);
  }

  remove(id) {
    this.here.delete(id);
    try {
      localStorage.removeItem(PREFIX + id);
    } catch {
      // As above.
    }
  }

  forget(keep) {
    const idle = this.list().filter((document) => !document.changed && document.id !== keep).sort((a, b) => a.used - b.used);
    for (const { id } of idle.slice(0, Math.max(0, idle.length - MOST))) this.remove(id);
  }
}
