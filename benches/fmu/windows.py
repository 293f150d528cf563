#!/usr/bin/env python3
# SPDX-License-Identifier: MIT OR Apache-2.0
"""The library of FMUs for Windows, in Wine, beside that for Linux and `takt run`: every output of every period, bit for bit.

From the project's folder, as `cargo evidence check fmu-windows` calls it: `python3 benches/fmu/windows.py DLL`. Needs the compiler of MinGW,
Wine, and `cargo build --release -p takt --features full`."""

import csv
import os
import struct
import subprocess
import sys
from pathlib import Path

from run import PROGRAMS, Unpacked

FOLDER = Path("target/fmu-windows")
# The first with `cargo build -p takt-fmu`, the second with `-p takt` alone.
LIBRARIES = [Path("target/release/libtakt_fmu.so"), Path("target/release/deps/libtakt_fmu.so")]
# Periods of a run in which the emulator compiles the program to instructions of the host.
LONG = 50_000
WARNINGS = ["-O2", "-Wall", "-Wextra"]
# Wine's own messages, of a screen that is not there, are left out.
WINE = {"WINEPREFIX": str((FOLDER / "wine").resolve()), "WINEDEBUG": "-all"}


def printed(fmu: Unpacked, command: list[str | Path], resources: str, periods: int, *more: str) -> list[list[str]]:
    """Words of each line that the master prints."""
    command = [*command, *fmu.arguments(resources, periods), *more]
    done = subprocess.run(command, input=fmu.numbers(), capture_output=True, text=True, env=os.environ | WINE)
    if done.returncode != 0:
        sys.exit(f"{command[0]} {command[1]} fails: {done.stderr}")
    return [line.split() for line in done.stdout.splitlines()]


def compare(program: str, inputs: str, dll: str) -> None:
    libraries = [next(path for path in LIBRARIES if path.exists()), dll]
    fmu = Unpacked(FOLDER, program, inputs, *(part for library in libraries for part in ("--library", library)))
    resources = (fmu.folder / "resources").resolve()
    linux = next((fmu.folder / "binaries/linux64").iterdir()).resolve()
    windows = next((fmu.folder / "binaries/win64").iterdir()).resolve()
    periods = len(fmu.rows)
    on_linux = [FOLDER / "master", linux], resources.as_uri()
    # Wine shows the root as drive Z.
    on_windows = ["wine", FOLDER / "master.exe", f"Z:{windows}"], f"file:///Z:{resources}"
    here = printed(fmu, *on_linux, periods, "print")
    assert printed(fmu, *on_windows, periods, "print") == here, f"{program}: the outputs on Windows differ from those on Linux"
    # The compiled code of a long run: the sum of all outputs, of which a different bit makes another.
    sums = [printed(fmu, *platform, LONG)[0][1] for platform in (on_linux, on_windows)]
    assert sums[0] == sums[1], f"{program}: the sums of all outputs over {LONG} periods differ: {sums}"
    said = subprocess.run(["target/release/takt", "run", program, "--inputs", inputs, "--outputs", "-"], check=True, capture_output=True, text=True)
    expected = list(csv.DictReader(said.stdout.splitlines()))
    reals, integers = ([name for name, _ in group] for group in fmu.groups[2:])
    assert len(here) == len(expected) == periods > 0
    for number, (got, row) in enumerate(zip(here, expected)):
        for name, text in zip(reals + integers, got):
            if name in row:
                # A system's output without a value is 0.
                value = row[name] or "0"
                wanted = struct.pack(">f", float(value)).hex() if name in reals else str(int(value))
                assert text == wanted, f"{program}, period {number}, {name}: {text} in the FMU, {wanted} in `takt run`"
    print(f"{program}: {periods} periods, {len(reals + integers)} outputs: Windows, Linux and `takt run` agree; {LONG} more: Windows and Linux", flush=True)


def main(dll: str) -> None:
    FOLDER.mkdir(parents=True, exist_ok=True)
    source = "benches/fmu/master.c"
    subprocess.run(["cc", *WARNINGS, "-o", FOLDER / "master", source, "-ldl"], check=True)
    # MinGW's own functions read and print numbers; those of Windows are its old C library's.
    mingw = ["x86_64-w64-mingw32-gcc", *WARNINGS, "-static", "-D__USE_MINGW_ANSI_STDIO=1", "-o", FOLDER / "master.exe", source]
    subprocess.run(mingw, check=True)
    # Beside the master, where Windows and Wine look for libraries.
    stand_in = ["x86_64-w64-mingw32-gcc", *WARNINGS, "-shared", "-o", FOLDER / "bcryptprimitives.dll", "benches/fmu/bcryptprimitives.c"]
    subprocess.run([*stand_in, "-ladvapi32"], check=True)
    for program, inputs in PROGRAMS:
        compare(program, inputs, dll)


if __name__ == "__main__":
    main(sys.argv[1])
