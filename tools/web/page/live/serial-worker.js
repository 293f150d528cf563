// Worker that owns a board at a serial port: Takt as WebAssembly (`tools/live/src/exports.rs`), which is suspended while it waits for bytes.

/** Longest wait of a read; ms. */
const READ = 100;
/** Time from a request of the page to the next look at the board; ms. */
const SOON = 20;
/** Most bytes of a received message that wait. */
const WAITING = 1 << 20;

let takt, open, ask, poll, writer = null, wake = () => {};
/** Bytes that have come; messages of the page that wait. */
let chunks = [], kept = 0;
const asked = [];

const decoder = new TextDecoder(), encoder = new TextEncoder();
const view = (at, length) => new Uint8Array(takt.memory.buffer, at, length);

/** Puts a request into the module's buffer. */
function put(...parts) {
  const length = parts.reduce((sum, part) => sum + part.length, 0);
  const bytes = view(takt.live_input(length), length);
  let at = 0;
  for (const part of parts) {
    bytes.set(part, at);
    at += part.length;
  }
}

/** The port is gone: everything that waits for bytes fails, until the page opens it again. */
function lose(lost) {
  if (lost !== writer || !writer) return;
  writer = null;
  wake();
  self.postMessage({ lost: true });
}

/** Reads a port until it ends. */
async function follow(readable, writable) {
  const own = writable.getWriter();
  [writer, chunks, kept] = [own, [], 0];
  try {
    for (const reader = readable.getReader(); ; ) {
      const { value, done } = await reader.read();
      if (done) break;
      // Nobody reads: a board that streams must not fill the memory.
      if (kept < WAITING) {
        chunks.push(value);
        kept += value.length;
      }
      wake();
    }
  } catch {
    // Unplugged.
  }
  lose(own);
}

const page = {
  send(at, length) {
    if (!writer) return 0;
    const own = writer;
    own.write(view(at, length).slice()).catch(() => lose(own));
    return 1;
  },
  receive: new WebAssembly.Suspending(async (at, length) => {
    if (!chunks.length && writer) {
      await new Promise((resolve) => {
        wake = resolve;
        setTimeout(resolve, READ);
      });
    }
    if (!chunks.length) return writer ? 0 : -1;
    const bytes = chunks[0].subarray(0, length);
    if (bytes.length === chunks[0].length) chunks.shift();
    else chunks[0] = chunks[0].subarray(length);
    kept -= bytes.length;
    view(at, bytes.length).set(bytes);
    return bytes.length;
  }),
  time: () => performance.now(),
  tell: (at, length) => self.postMessage({ text: decoder.decode(view(at, length).slice()) }),
  is_asked: () => (asked.length ? 1 : 0),
};

/** Loads the module. */
async function load() {
  const packed = await fetch("live.wasm.gz");
  if (!packed.ok) throw new Error(`live.wasm.gz: ${packed.status} ${packed.statusText}`);
  const plain = new Response(packed.body.pipeThrough(new DecompressionStream("gzip")), { headers: { "Content-Type": "application/wasm" } });
  const { instance } = await WebAssembly.instantiateStreaming(plain, { page });
  takt = instance.exports;
  [open, ask, poll] = [takt.live_open, takt.live_ask, takt.live_poll].map(WebAssembly.promising);
}

/** A number of a request that differs from an earlier host's. */
const number = () => Math.floor(Math.random() * 256);

/** Opens the board, then looks after it: one call of the module at a time. */
async function run({ files, ...about }) {
  await load();
  const head = JSON.stringify({ ...about, number: number(), files: files.map(({ name, bytes }) => [name, bytes.length]) });
  put(encoder.encode(`${head}\n`), ...files.map(({ bytes }) => bytes));
  const length = await open();
  if (length) throw new Error(decoder.decode(view(takt.live_output(), length).slice()));
  for (let due = 0; ; ) {
    while (asked.length) {
      put(encoder.encode(asked.shift()));
      await ask();
      due = Math.min(due, performance.now() + SOON);
    }
    if (performance.now() >= due) due = performance.now() + (await poll(number()));
    await new Promise((resolve) => {
      wake = resolve;
      if (!asked.length) setTimeout(resolve, Math.max(0, due - performance.now()));
      else resolve();
    });
  }
}

self.addEventListener("message", ({ data }) => {
  if (data.readable) follow(data.readable, data.writable);
  if (data.open) run(data.open).catch((error) => self.postMessage({ error: error.message }));
  if (data.ask) {
    asked.push(data.ask);
    wake();
  }
});
