// The WebAssembly module in Node, for the build.

/** Function that asks the module, as worker.js does. */
export async function asking(bytes) {
  const { takt_input, takt_output, takt_call, memory } = (await WebAssembly.instantiate(bytes, {})).instance.exports;
  return (method, params = null) => {
    const request = new TextEncoder().encode(`${method}\n${JSON.stringify(params)}`);
    // The memory may grow, and its buffer be another then.
    const at = takt_input(request.length);
    new Uint8Array(memory.buffer, at, request.length).set(request);
    const length = takt_call(), { ok, error } = JSON.parse(new TextDecoder().decode(new Uint8Array(memory.buffer, takt_output(), length)));
    if (error !== undefined) throw new Error(`${method}: ${error}`);
    return ok;
  };
}
