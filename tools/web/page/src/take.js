// Downloads: source, image, listing, circuit, headers.
import { zipSync, strToU8 } from "fflate";
import { save } from "./parts.js";

/** Creates the function that saves a download by name; main.js describes the arguments. */
export function taker({ machine, work, current, state, editor }) {
  const stem = () => state.name.replace(/\.(s|tks)$/, "");
  return (what) => {
    document.getElementById("export").open = false;
    return work(async () => {
      if (what === "source") return save(state.name, editor.text, "text/plain");
      await current();
      if (what === "image") return save(`${stem()}.takt`, await machine.call("image"), "application/octet-stream");
      if (what === "listing") return save(`${stem()}.lst`, await machine.call("listing"), "text/plain");
      if (what === "verilog") {
        const { top, files } = await machine.call("verilog");
        const zipped = zipSync(Object.fromEntries(files.map((file) => [`${top}/${file.name}`, strToU8(file.text)])));
        return save(`${stem()}-${top}.zip`, zipped, "application/zip");
      }
      const ending = { c: ".h", rust: ".rs", json: ".json", svd: ".svd" }[what];
      return save(stem() + ending, await machine.call("header", { language: what }), "text/plain");
    });
  };
}
