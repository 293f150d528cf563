"""A SoC with VexRiscv and two Takts, on Wishbone and on AXI4-Lite, simulated in Verilator: run.py FOLDER.

FOLDER has the circuit, the program's C header, periods.h and expected.json (tools/evidence/src/litex.rs writes them).
"""

import json
import subprocess
import sys
from pathlib import Path

from litex.build.generic_platform import Pins, Subsignal
from litex.build.io import CRG
from litex.build.lattice import LatticeECP5Platform
from litex.build.sim import SimPlatform
from litex.soc.cores.cpu.vexriscv import core as vexriscv
from litex.soc.integration.builder import Builder
from litex.soc.integration.common import get_mem_data
from litex.soc.integration.soc_core import SoCCore
from litex import soc as litex_soc

from takt_litex import Takt, TaktError, add_takt

HERE = Path(__file__).parent
LITEX = Path(litex_soc.__file__).parent
COMPILER = "riscv64-unknown-elf-"

IO = [
    ("sys_clk", 0, Pins(1)),
    (
        "serial",
        0,
        Subsignal("source_valid", Pins(1)),
        Subsignal("source_ready", Pins(1)),
        Subsignal("source_data", Pins(8)),
        Subsignal("sink_valid", Pins(1)),
        Subsignal("sink_ready", Pins(1)),
        Subsignal("sink_data", Pins(8)),
    ),
]


class SoC(SoCCore):
    """CPU, ROM, RAM, console, and the same circuit twice."""

    def __init__(self, folder):
        platform = SimPlatform("SIM", IO)
        self.folder = folder
        self.crg = CRG(platform.request("sys_clk"))
        SoCCore.__init__(
            self,
            platform,
            clk_freq=int(1e6),
            cpu_type="vexriscv",
            cpu_variant="lite",
            integrated_rom_size=0x2_0000,
            uart_name="sim",
            with_timer=False,
            ident="Takt",
        )
        add_takt(self, "takt", folder / "core")
        add_takt(self, "takt_axi", folder / "core", standard="axi-lite")

    def init_mems(self, **_):
        """Called by the builder when the headers are written."""
        image = compiled(self, self.folder)
        self.init_rom("rom", get_mem_data(str(image), data_width=self.bus.data_width, endianness=self.cpu.endianness))


def compiled(soc, folder):
    """The firmware, with LiteX's start-up code and linker script."""
    include = folder / "soc/software/include"
    cpu = Path(vexriscv.__file__).parent
    elf, image = folder / "firmware.elf", folder / "firmware.bin"
    flags = [*soc.cpu.gcc_flags.split(), "-Os", "-Wall", "-Werror", "-ffreestanding", "-nostdlib", "-fno-builtin-printf"]
    # LiteX's headers include those of the compiler and compile without warnings under -Wall.
    folders = [f"-I{HERE}", f"-I{folder}", f"-I{include}", f"-I{cpu}", f"-I{LITEX / 'software/include'}"]
    script = [f"-L{include}", "-T", str(LITEX / "software/bios/linker.ld"), "-lgcc"]
    sources = [str(cpu / "crt0.S"), str(HERE / "firmware.c")]
    subprocess.run([f"{COMPILER}gcc", *flags, *folders, "-o", str(elf), *sources, *script], check=True)
    subprocess.run([f"{COMPILER}objcopy", "-O", "binary", str(elf), str(image)], check=True)
    return image


def simulated(soc, folder):
    """What the firmware writes."""
    Builder(soc, output_dir=str(folder / "soc"), compile_software=False, compile_gateware=False).build(interactive=False)
    gateware = folder / "soc/gateware"
    sources = [name for name, *_ in soc.platform.sources if not name.endswith(".init")]
    build = ["verilator", "--binary", "--top-module", "bench", "-Wno-fatal", "-Wno-lint", "-Wno-style", "-Wno-MULTIDRIVEN"]
    build += ["-O3", "-CFLAGS", "-O1", "-j", "2", "--Mdir", "obj_dir", "-o", "bench", str(HERE / "bench.sv"), *dict.fromkeys(sources)]
    done = subprocess.run(build, cwd=gateware, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"Verilator: {done.stdout}{done.stderr}")
    return subprocess.run(["obj_dir/bench"], cwd=gateware, capture_output=True, text=True, check=True).stdout


def compare(said, expected):
    """The mistakes."""
    lines = said.splitlines()
    wrong = []
    for which, name in enumerate(["Wishbone", "AXI4-Lite"]):
        for period, row in enumerate(expected):
            for output, bits in enumerate(row):
                start = f"{which:08x} {period:08x} {output:08x} "
                found = [line[len(start) :] for line in lines if line.startswith(start)]
                if found != [f"{bits:08x}"]:
                    wrong.append(f"{name}, period {period}, output {output}: {found}, the emulator {bits:08x}")
    # One interrupt per wait, the first one from the start; the byte write changed nothing.
    for line in (f"interrupts {len(expected) + 1:08x}", "word 12345678"):
        if lines.count(line) != 2:
            wrong.append(f"not twice: {line}")
    if "end" not in lines:
        wrong.append("the firmware did not end")
    return wrong


def refuses(folder):
    """Mistakes that the wrapper must report, and the files that it takes for an ECP5."""
    platform = LatticeECP5Platform("LFE5U-25F-6BG256C", IO, toolchain="trellis")
    Takt(platform, folder / "core")
    assert any(name.endswith("ecp5/takt_bank.v") for name, *_ in platform.sources), platform.sources
    for arguments, what in [
        ((folder / "nothing",), "there is no such folder"),
        ((folder / "soc",), "no circuit of a machine"),
        ((folder / "core", "avalon"), "there is no bus `avalon`"),
    ]:
        try:
            Takt(platform, *arguments)
        except TaktError as error:
            assert what in str(error), error
        else:
            raise AssertionError(f"accepted: {arguments}")


def main():
    folder = Path(sys.argv[1]).absolute()
    said = simulated(SoC(folder), folder)
    wrong = compare(said, json.loads((folder / "expected.json").read_text()))
    if wrong:
        sys.exit("\n".join([*wrong, "the firmware wrote:", said]))
    refuses(folder)
    cycles = next(line for line in said.splitlines() if line.startswith("cycles"))
    print(f"LiteX: two Takts in a SoC with VexRiscv, outputs as the emulator's, {cycles}")


if __name__ == "__main__":
    main()
