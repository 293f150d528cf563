// Worker that runs a playground and answers requests in order. The page has two, for the language server and for the machine, so that
// neither blocks the other or the page.

let takt;

/** Calls a function of the WebAssembly module (`tools/web/src/exports.rs`) with bytes as input and output. */
function ask(request, call) {
  const bytes = new TextEncoder().encode(request);
  const at = takt.takt_input(bytes.length);
  new Uint8Array(takt.memory.buffer, at, bytes.length).set(bytes);
  const length = call();
  return new Uint8Array(takt.memory.buffer, takt.takt_output(), length);
}

const ready = new Promise((resolve, reject) => {
  self.addEventListener("message", async ({ data }) => {
    if (data.module) {
      // The module has no imports: if the build adds one by mistake, instantiation fails here.
      WebAssembly.instantiate(data.module, {}).then(({ exports }) => resolve((takt = exports)), reject);
      return;
    }
    const { id, method, params } = data;
    try {
      await ready;
      if (method === "image") {
        self.postMessage({ id, ok: ask("", takt.takt_image).slice() });
      } else {
        const answer = ask(`${method}\n${JSON.stringify(params ?? null)}`, takt.takt_call);
        const { ok, error } = JSON.parse(new TextDecoder().decode(answer));
        self.postMessage(error === undefined ? { id, ok } : { id, error });
      }
    } catch (error) {
      // A defect in Takt: report it to the caller, which starts another worker.
      self.postMessage({ id, error: `a defect in Takt: ${error.message ?? error}`, broken: true });
    }
  });
});
