# SPDX-License-Identifier: MIT OR Apache-2.0
"""Counts the cycles of kernels.c on other processors: run.py CORE FOLDER prints {kernel: {column: cycles}}.

CORE is the folder of CV32E40P's sources, FOLDER is for what is built.

riscv: CV32E40P, a RISC-V core with a floating-point unit (one pipeline register in it), in Verilator, with a memory
that answers in the next cycle: its cycles, exactly.
arm: a model of a Cortex-M7. QEMU counts how often each block of instructions is executed; llvm-mca gives the cycles
that its scheduling model of the Cortex-M7 takes for the block, repeated, with perfect caches and branch prediction.

Both compilers may reorder sums (-O3 -ffast-math). The results are compared with those of the host's compiler, which may not.
"""

import json
import os
import re
import struct
import subprocess
import sys
from collections import Counter
from pathlib import Path

HERE = Path(__file__).parent
KERNELS = ["cosf", "deg2rad", "fir2dim", "iir", "lms", "ludcmp", "minver", "st"]
CLANG = "clang-16"
CORTEX = ["--target=armv7em-none-eabihf", "-mcpu=cortex-m7", "-mfloat-abi=hard"]
RISCV = ["-march=rv32imfc_zicsr", "-mabi=ilp32f"]
FREE = ["-O3", "-ffast-math", "-fno-math-errno", "-fomit-frame-pointer", "-ffreestanding", "-nostdlib", "-static"]

# Relative tolerance of results against the host, which sums in another order.
TOLERANCE = 1e-4

# Repetitions of a block in the performance model.
REPEATED = 100


def run(*command, **options):
    """Runs a program, and returns its output."""
    done = subprocess.run([str(word) for word in command], capture_output=True, **options)
    if done.returncode != 0:
        said = (done.stderr or done.stdout).decode(errors="replace")
        sys.exit(f"{command[0]} failed ({done.returncode}):\n{said[-4000:]}")
    return done.stdout


def floats(data):
    return struct.unpack(f"<{len(data) // 4}f", data)


def native(kernel, folder):
    """Results of the kernel on the host, computed without reordering."""
    program = folder / f"{kernel}-native"
    run("gcc", "-O1", "-fno-math-errno", "-ffp-contract=off", f"-DKERNEL_{kernel}", HERE / "kernels.c", "-o", program)
    return floats(run(program))


def compare(kernel, what, results, expected):
    """Exits with a message if results differ from the expected ones."""
    scale = max(abs(value) for value in expected)
    if len(results) != len(expected) or any(
        not abs(a - b) <= TOLERANCE * scale for a, b in zip(results, expected)
    ):
        sys.exit(f"{kernel}: {what} computes {results[:4]} …, the host {expected[:4]} …")


def simulator(core, folder):
    """Simulator of CV32E40P, built with Verilator."""
    sources = core / "rtl"
    files = [
        "--cc", "--exe", "--build", "-O3", "-Wno-fatal", "-Wno-lint", "-Wno-style", "-Wno-MULTIDRIVEN", "-Wno-UNOPTFLAT",
        "-Wno-BLKANDNBLK", "-Wno-COMBDLY", "-DADDMUL=1", "-DOTHERS=1", "--top-module", "others", "--Mdir", folder / "core",
        "-f", core / "cv32e40p_fpu_manifest.flist", HERE / "core.sv", HERE / "driver.cpp",
    ]  # fmt: skip
    run("verilator", *files, env={**os.environ, "DESIGN_RTL_DIR": str(sources)})
    return folder / "core/Vothers"


def riscv(kernel, program, folder, expected):
    """Cycles of the kernel on the simulated core."""
    work = folder / kernel
    work.mkdir(parents=True, exist_ok=True)
    linked = work / "program.elf"
    script = ["-T", HERE / "core.ld", "-Wl,--no-warn-rwx-segments"]
    run("riscv64-unknown-elf-gcc", *RISCV, *FREE, f"-DKERNEL_{kernel}", *script, HERE / "kernels.c", "-lgcc", "-o", linked)
    run("riscv64-unknown-elf-objcopy", "-O", "binary", linked, work / "program.bin")
    data = (work / "program.bin").read_bytes()
    data += bytes(-len(data) % 4)
    words = struct.unpack(f"<{len(data) // 4}I", data)
    (work / "program.hex").write_text("".join(f"{word:08x}\n" for word in words))
    lines = [line.split() for line in run(program.resolve(), cwd=work).decode().splitlines()]
    results = b"".join(struct.pack("<I", int(value, 16)) for name, value in lines if name == "result")
    compare(kernel, "CV32E40P", floats(results), expected)
    return next(int(value) for name, value in lines if name == "cycles")


def executed(program, log):
    """Execution counts of the kernel's blocks: {(addresses of its instructions): count}."""
    run("qemu-arm", "-cpu", "max", "-d", "in_asm,exec,nochain", "-D", log, program)
    blocks, times, own = {}, Counter(), None
    for line in log.read_text(errors="replace").splitlines():
        if line.startswith("IN:"):
            own = []
        elif found := re.match(r"0x([0-9a-f]+):", line):
            if own is not None:
                own.append(int(found[1], 16))
                blocks[own[0]] = own
        elif found := re.match(r"Trace.*\[[0-9a-f]+/([0-9a-f]+)/", line):
            own = None
            times[int(found[1], 16)] += 1
    return {tuple(blocks[address]): count for address, count in times.items() if address in blocks}


def arm(kernel, folder, expected):
    """Cycles of the kernel in the model of a Cortex-M7."""
    program = folder / f"{kernel}-arm"
    run(CLANG, *CORTEX, *FREE, "-fuse-ld=lld", f"-DKERNEL_{kernel}", HERE / "kernels.c", "-o", program)
    compare(kernel, "the Cortex-M7's program", floats(run("qemu-arm", "-cpu", "max", program)), expected)
    listed = run("llvm-objdump-16", "-d", "--mcpu=cortex-m7", "--no-show-raw-insn", program).decode()
    instructions, function = {}, ""
    for line in listed.splitlines():
        if found := re.match(r"[0-9a-f]+ <(\w+)>:", line):
            function = found[1]
        elif found := re.match(r"\s*([0-9a-f]+):\s+(\S.*)", line):
            text = found[2].split("@")[0].split("<")[0].strip()
            # Drop the branch target, which the performance model cannot resolve.
            text = re.sub(r"^(b\w*|cbn?z)(\.\w)?(\s.*?)?0x[0-9a-f]+$", lambda m: f"{m[1]}{m[2] or ''}{m[3] or ' '}.", text)
            instructions[int(found[1], 16)] = (function, text)
    blocks = executed(program, folder / f"{kernel}.log")
    own = {
        addresses: times
        for addresses, times in blocks.items()
        if instructions.get(addresses[0], ("",))[0] == "kernel"
    }
    if not own:
        sys.exit(f"{kernel}: QEMU executes no block of the kernel")
    blocks = [bare([instructions[address][1] for address in addresses]) for addresses in own]
    unknown = set()
    while (cycles := modelled(blocks, unknown, folder / f"{kernel}.s")) is None:
        pass
    return round(sum(count * times for count, times in zip(cycles, own.values())))


def mnemonic(instruction):
    return instruction.split()[0]


def bare(block):
    """A block without IT instructions and the conditions that they imply: the model supports neither."""
    left, covered = [], 0
    for instruction in block:
        if found := re.match(r"i(t[te]*)\s", instruction):
            covered = len(found[1])
        elif covered:
            covered -= 1
            name, *rest = instruction.split(None, 1)
            head, dot, tail = name.partition(".")
            left.append(" ".join([head[:-2] + dot + tail, *rest]))
        else:
            left.append(instruction)
    return left


def modelled(blocks, unknown, source):
    """Cycles of each block. None if the model lacks an instruction, which is added to `unknown`: each then counts one cycle."""
    text = ""
    for number, block in enumerate(blocks):
        lines = "\n".join(line for line in block if mnemonic(line) not in unknown)
        text += f"@ LLVM-MCA-BEGIN {number}\n{lines or 'nop'}\n@ LLVM-MCA-END\n"
    source.write_text(text)
    model = ["-mtriple=thumbv7em-none-eabihf", "-mcpu=cortex-m7", f"-iterations={REPEATED}", "--json"]
    done = subprocess.run(["llvm-mca-16", *model, str(source)], capture_output=True, text=True)
    if done.returncode != 0:
        found = re.search(r"unsupported instruction.*\n.*instruction:\s+(\S+)", done.stderr)
        if not found or found[1] in unknown:
            sys.exit(f"llvm-mca-16 failed:\n{done.stderr[-2000:]}")
        unknown.add(found[1])
        return None
    regions = json.loads(done.stdout)["CodeRegions"]
    cycles = {int(region["Name"]): region["SummaryView"]["TotalCycles"] / REPEATED for region in regions}
    missing = [sum(mnemonic(line) in unknown for line in block) for block in blocks]
    return [cycles[number] + missing[number] for number in range(len(blocks))]


def main():
    core, folder = (Path(path) for path in sys.argv[1:])
    folder.mkdir(parents=True, exist_ok=True)
    program = simulator(core, folder)
    table = {}
    for kernel in KERNELS:
        expected = native(kernel, folder)
        table[kernel] = {
            "riscv": riscv(kernel, program, folder, expected),
            "arm": arm(kernel, folder, expected),
        }
    print(json.dumps(table))


main()
