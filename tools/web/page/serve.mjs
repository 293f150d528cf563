// A plain file server that supports neither WebAssembly types nor compression, for tests and pictures, and for people:
// `node serve.mjs PORT FOLDER`.
import { createReadStream, existsSync } from "node:fs";
import { createServer } from "node:http";
import { extname, join, normalize } from "node:path";

const TYPES = { ".html": "text/html", ".js": "text/javascript", ".css": "text/css" };

/** Serves a folder; `asked` hears the path of each request. Port 0 is one that is free. */
export async function serve(folder, asked = () => {}, port = 0) {
  const server = createServer((request, response) => {
    const path = normalize(new URL(request.url, "http://x").pathname).replace(/^\/$/, "/index.html");
    const file = join(folder, path);
    asked(path);
    if (!existsSync(file)) return response.writeHead(404).end();
    response.writeHead(200, { "content-type": TYPES[extname(file)] ?? "application/octet-stream" });
    createReadStream(file).pipe(response);
  });
  await new Promise((resolve, reject) => server.on("error", reject).listen(port, "127.0.0.1", resolve));
  return { server, address: `http://127.0.0.1:${server.address().port}/` };
}

if (process.argv[1] === import.meta.filename) {
  const [port, folder] = process.argv.slice(2);
  try {
    await serve(folder, undefined, Number(port));
    console.log(`the playground is on http://localhost:${port}; Ctrl-C ends it`);
  } catch (error) {
    console.error(`port ${port} cannot be used: ${error.message}`);
    process.exitCode = 1;
  }
}
