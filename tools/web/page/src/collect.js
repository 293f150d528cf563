// A run of periods, collected from the slices that the WebAssembly module answers; here and in the build, which runs some examples ahead.

/** Runs from the beginning. `call` asks the module; `told` hears each slice. */
export async function collect(call, periods, told = () => {}) {
  const whole = { cycles: [], inputs: {}, outputs: {} };
  for (let begin = true, over = false; !over; begin = false) {
    const part = await call("run", { begin, periods });
    whole.cycles.push(...part.cycles);
    for (const kind of ["inputs", "outputs"]) for (const [name, values] of Object.entries(part[kind])) (whole[kind][name] ??= []).push(...values);
    Object.assign(whole, { missed: part.missed, total: part.total, operations: part.operations });
    over = part.over;
    told(part);
  }
  whole.shortest = whole.cycles.reduce((a, b) => Math.min(a, b), Infinity);
  whole.longest = whole.cycles.reduce((a, b) => Math.max(a, b), 0);
  return whole;
}

/** Request for an example as it is shipped, on the default machine. */
export const shipped = ({ name, source, inputs, plant, periods }, usual) => ({
  name, source, machine: "t3", inputs: inputs ?? "", tick: 0, plant: plant ?? null, parameters: {}, changes: [], periods: periods ?? usual,
});

/** Default number of periods of a program without inputs. */
export const PERIODS = 20;

/** Period whose pipeline is drawn first: the one after the first, which may have waited. */
export const WHICH = 2;
