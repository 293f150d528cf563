// Worker whose answers are promises, and which can be stopped and restarted.

/** Bytes of a file that may be compressed. */
export async function fetched(url) {
  const answer = await fetch(url);
  if (!answer.ok) throw new Error(`${url} cannot be had: ${answer.status} ${answer.statusText}`);
  let bytes = await answer.arrayBuffer();
  const head = new Uint8Array(bytes, 0, 2);
  // Decompress the data, unless the server declared the encoding and the browser has decompressed it.
  if (head[0] === 0x1f && head[1] === 0x8b) {
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    bytes = await new Response(stream).arrayBuffer();
  }
  return bytes;
}

/** Loads the compiled WebAssembly, which is fetched once and shared by the workers. */
export const load = async (url) => WebAssembly.compile(await fetched(url));

export class Stopped extends Error {}

/** Reason given for stopping a worker when what it does is about another program than the page's. */
export const REPLACED = "another program was opened";

export class Thread {
  constructor(module, url) {
    this.module = module;
    this.url = url;
    this.start();
  }

  start() {
    this.next = 0;
    this.waiting = new Map();
    this.worker = new Worker(this.url, { type: "module" });
    this.worker.addEventListener("message", ({ data }) => {
      const asked = this.waiting.get(data.id);
      if (!asked) return;
      this.waiting.delete(data.id);
      if (data.error === undefined) asked.resolve(data.ok);
      else asked.reject(new Error(data.error));
      if (data.broken) this.stop("it was begun again");
    });
    this.worker.addEventListener("error", (event) => this.stop(event.message));
    this.worker.postMessage({ module: this.module });
  }

  get busy() {
    return this.waiting.size > 0;
  }

  call(method, params) {
    const id = this.next++;
    return new Promise((resolve, reject) => {
      this.waiting.set(id, { resolve, reject });
      this.worker.postMessage({ id, method, params });
    });
  }

  /** Terminates the worker; its state is lost. */
  stop(why = "stopped") {
    this.worker.terminate();
    const waiting = [...this.waiting.values()];
    this.start();
    for (const { reject } of waiting) reject(new Stopped(why));
  }
}
