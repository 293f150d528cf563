// The line to a board at a serial port that this page opens itself (Web Serial): a worker owns the board, with Takt as WebAssembly. The
// build puts this file in the place of line.js.
import { node } from "./parts.js";

/** Time until a lost port is opened again; ms. */
const RETRY = 1000;

const el = (id) => document.getElementById(id);

/** Reason why this browser cannot open a board; "" if it can. */
function missing() {
  if (!navigator.serial) return "This browser opens no serial port: Chrome, Edge, Opera and Chromium on a computer do, from pages over https.";
  if (!WebAssembly.Suspending) return "This browser cannot wait for a port in WebAssembly (JavaScript Promise Integration): Chrome and Edge can, from version 137 on.";
  return "";
}

/** Shows the form that opens the port; `events` are those of line.js. */
export function open(events) {
  const form = el("connect"), files = el("connect-files"), program = el("connect-program"), wiring = el("connect-wiring");
  let worker = null;
  form.hidden = false;
  document.body.classList.add("apart");
  const lacks = missing();
  tell(lacks || "");
  el("connect-open").disabled = Boolean(lacks);

  files.addEventListener("change", () => {
    const names = [...files.files].map(({ name }) => name);
    const options = (chosen) => chosen.map((name) => node("option", { value: name, textContent: name }));
    program.replaceChildren(...options(names));
    wiring.replaceChildren(node("option", { value: "", textContent: "none" }), ...options(names.filter((name) => name.endsWith(".toml"))));
    // A program or an image is no table; a system is one, and its sources are beside it.
    program.value = names.find((name) => !name.endsWith(".toml") && !name.endsWith(".inc")) ?? names[0] ?? "";
    wiring.value = names.find((name) => name.endsWith(".toml")) ?? "";
    el("connect-chosen").hidden = !names.length;
    if (!lacks) tell("");
  });

  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    try {
      if (!files.files.length) throw new Error("choose the program that runs on the board, with the files that it includes, or its image");
      // The browser asks the person which port.
      const port = await navigator.serial.requestPort();
      await begin(port);
    } catch (error) {
      // Nobody has chosen a port.
      tell(error.name === "NotFoundError" ? "" : error.message);
    }
  });

  async function begin(port) {
    const baud = Number(el("connect-baud").value);
    await port.open({ baudRate: baud });
    tell("reading the program…");
    el("connect-open").disabled = true;
    const chosen = await Promise.all([...files.files].map(async (file) => ({ name: file.name, bytes: new Uint8Array(await file.arrayBuffer()) })));
    const started = new Worker("serial-worker.js", { type: "module" });
    const stop = async (text) => {
      started.terminate();
      worker = null;
      tell(text);
      el("connect-open").disabled = false;
      await port.close().catch(() => {});
    };
    started.addEventListener("error", ({ message }) => stop(`a defect in Takt: ${message}`));
    started.addEventListener("message", ({ data }) => {
      if (data.error !== undefined) return stop(data.error);
      if (data.lost) return again(port, baud, started);
      // The first message comes once the board has answered.
      if (!worker) {
        worker = started;
        form.hidden = true;
        document.body.classList.remove("apart");
        events.opened();
      }
      events.message(data.text);
    });
    const about = port.getInfo?.() ?? {};
    const hex = (number) => number.toString(16).padStart(4, "0");
    const name = about.usbVendorId === undefined ? "serial port" : `USB ${hex(about.usbVendorId)}:${hex(about.usbProductId)}`;
    give(started, port, { open: { files: chosen, program: program.value, wiring: wiring.value || null, machine: el("connect-machine").value.trim(), port: name, baud } });
  }

  /** Gives a worker the streams of a port. */
  function give(started, port, more) {
    const { readable, writable } = port;
    started.postMessage({ readable, writable, ...more }, [readable, writable]);
  }

  /** Opens a port that was lost, as soon as that can be. */
  async function again(port, baud, started) {
    await port.close().catch(() => {});
    while (worker === started) {
      await new Promise((resolve) => setTimeout(resolve, RETRY));
      try {
        await port.open({ baudRate: baud });
        return give(started, port, {});
      } catch {
        // Not plugged in yet.
      }
    }
  }

  function tell(text) {
    el("connect-error").textContent = text;
    el("connect-error").hidden = !text;
  }

  return { isOpen: () => worker !== null, send: (text) => worker.postMessage({ ask: text }) };
}
