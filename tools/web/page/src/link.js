// Links with a program in the URL's fragment: compressed, in base64url. Browsers do not send fragments to servers.

/** Maximum length of a generated link, which browsers and mail programs support. */
export const LINK_CHARACTERS = 100_000;
/** Maximum size of an unpacked link, in bytes. */
const UNPACKED_BYTES = 8 << 20;

const through = (bytes, stream) => new Response(new Blob([bytes]).stream().pipeThrough(stream)).arrayBuffer();

export async function pack(program) {
  const bytes = new TextEncoder().encode(JSON.stringify(program));
  const packed = new Uint8Array(await through(bytes, new CompressionStream("deflate")));
  let text = "";
  for (const byte of packed) text += String.fromCharCode(byte);
  const fragment = "p1=" + btoa(text).replaceAll("+", "-").replaceAll("/", "_").replace(/=+$/, "");
  if (fragment.length > LINK_CHARACTERS) {
    throw new Error(`the link would have ${fragment.length} characters, more than the ${LINK_CHARACTERS} that browsers carry: export the source instead`);
  }
  return fragment;
}

/** Unpacks the program in a fragment; null if there is none. */
export async function unpack(fragment) {
  const text = fragment.replace(/^#/, "");
  if (text === "") return null;
  if (/^example=/.test(text)) return { example: decodeURIComponent(text.slice(8)) };
  if (!text.startsWith("p1=")) throw new Error("it does not begin with `p1=`, as Takt's links do");
  let packed;
  // Four digits encode three bytes, so a single remaining digit is an error.
  if (/^[\w-]*$/.test(text.slice(3)) && text.slice(3).length % 4 === 1) throw new Error("a part of it is missing or was changed on the way");
  try {
    packed = Uint8Array.from(atob(text.slice(3).replaceAll("-", "+").replaceAll("_", "/")), (c) => c.charCodeAt(0));
  } catch {
    throw new Error("it has characters that no link has");
  }
  let bytes;
  try {
    // The checksum of the compressed data detects lost or changed characters.
    bytes = await unpackBounded(packed);
  } catch (error) {
    throw new Error(error instanceof RangeError ? error.message : "a part of it is missing or was changed on the way");
  }
  const program = JSON.parse(new TextDecoder("utf-8", { fatal: true }).decode(bytes));
  if (typeof program?.source !== "string") throw new Error("it holds no source");
  const word = (value) => (typeof value === "string" ? value : "");
  return { name: word(program.name), machine: word(program.machine), inputs: word(program.inputs), source: program.source, ...(Number.isInteger(program.periods) && { periods: program.periods }), ...(program.plant && { plant: plantOf(program.plant) }), parameters: numbers(program.parameters), changes: changesOf(program.changes) };
}

/** Changes of parameters in a link. */
function changesOf(all) {
  const isChange = (one) => Number.isInteger(one?.period) && one.period > 0 && typeof one.name === "string" && Number.isFinite(one.value);
  return (Array.isArray(all) ? all : []).filter(isChange).map(({ period, name, value }) => ({ period, name, value }));
}

/** The plant in a link: a name, and numbers for parameters. */
function plantOf({ name, parameters }) {
  return typeof name === "string" ? { name, parameters: numbers(parameters) } : null;
}

/** Numbers by name, of what is in a link. */
const numbers = (all) => Object.fromEntries(Object.entries(all ?? {}).filter(([, value]) => Number.isFinite(value)));

async function unpackBounded(packed) {
  const reader = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate")).getReader();
  const parts = [];
  let length = 0;
  for (;;) {
    const { done, value } = await reader.read();
    if (done) break;
    length += value.length;
    if (length > UNPACKED_BYTES) throw new RangeError(`it unpacks to more than ${UNPACKED_BYTES >> 20} MiB`);
    parts.push(value);
  }
  return new Uint8Array(await new Blob(parts).arrayBuffer());
}
