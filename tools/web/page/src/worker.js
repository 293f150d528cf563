// A playground in a thread of its own: requests come in, answers go out, in order. The page makes two, one for the language
// server and one for the machine, so that neither keeps the page or the other waiting.

let takt;

/** Asks the WebAssembly (`tools/web/src/exports.rs`): what goes in and comes out are bytes. */
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
      // It asks nothing of its host: an import would be a mistake of the build, and fails here.
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
      // A defect of ours: whoever asked is told, and starts another.
      self.postMessage({ id, error: `a defect in Takt: ${error.message ?? error}`, broken: true });
    }
  });
});
