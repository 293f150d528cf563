// A playground in a thread of its own: requests come in, answers go out, in order. The page makes two, one for the language
// server and one for the machine, so that neither keeps the page or the other waiting.
import init, { Playground } from "takt-wasm";

let playground;
const ready = new Promise((resolve, reject) => {
  self.addEventListener("message", async ({ data }) => {
    if (data.module) {
      try {
        await init({ module_or_path: data.module });
        playground = new Playground();
        resolve();
      } catch (error) {
        reject(error);
      }
      return;
    }
    const { id, method, params } = data;
    try {
      await ready;
      if (method === "image") {
        self.postMessage({ id, ok: playground.image() });
      } else {
        const { ok, error } = JSON.parse(playground.call(method, JSON.stringify(params ?? null)));
        self.postMessage(error === undefined ? { id, ok } : { id, error });
      }
    } catch (error) {
      // A defect of ours: whoever asked is told, and starts another.
      self.postMessage({ id, error: `a defect in Takt: ${error.message ?? error}`, broken: true });
    }
  });
});
