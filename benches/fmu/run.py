#!/usr/bin/env python3
# SPDX-License-Identifier: MIT OR Apache-2.0
"""Periods a second of FMUs in a master in C (`master.c`), of CPU time. From the project's folder, after `cargo build --release -p takt
--features full`: `python3 benches/fmu/run.py`. Needs a C compiler and nothing of Python's packages."""

import csv
import subprocess
import tempfile
import xml.etree.ElementTree as ElementTree
import zipfile
from pathlib import Path

PROGRAMS = [
    ("programs/examples/pi.s", "programs/examples/pi.csv"),
    ("programs/examples/foc.s", "programs/examples/foc.csv"),
    ("programs/hybrid/tracking.s", "programs/hybrid/tracking.csv"),
    ("programs/systems/speed.toml", "programs/systems/speed.csv"),
]
PERIODS, ROUNDS, PERIOD = 300_000, 3, ["--period", "1ms"]


class Unpacked:
    """An FMU of a program, with what `master.c` wants to know."""

    def __init__(self, folder: Path, program: str, inputs: str, *options: str | Path) -> None:
        file = folder / (Path(program).stem + ".fmu")
        # A system's base tick is in its file, 1 ms as well.
        period = [] if program.endswith(".toml") else PERIOD
        command = ["target/release/takt", "fmu", program, *period, "-o", file, *options]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        self.folder = folder / file.stem
        zipfile.ZipFile(file).extractall(self.folder)
        root = ElementTree.parse(self.folder / "modelDescription.xml").getroot()
        named: dict[tuple[str | None, str], list[tuple[str, str]]] = {}
        for variable in root.iter("ScalarVariable"):
            listed = named.setdefault((variable.get("causality"), variable[0].tag), [])
            listed.append((variable.get("name", ""), variable.get("valueReference", "")))
        self.groups = [named.get((causality, tag), []) for causality in ("input", "output") for tag in ("Real", "Integer")]
        self.token = root.get("guid", "")
        self.rows = list(csv.DictReader(Path(inputs).read_text().splitlines()))

    def arguments(self, resources: str, periods: int) -> list[str]:
        """Arguments of the master behind the library; `resources` is their address."""
        return [resources, self.token, str(1e-3), str(periods), str(len(self.rows)), *(str(len(group)) for group in self.groups)]

    def numbers(self) -> str:
        """What the master reads: value references, then rows of inputs."""
        numbers = [reference for group in self.groups for _, reference in group]
        numbers += [row[name] for row in self.rows for name, _ in self.groups[0] + self.groups[1]]
        return "\n".join(numbers)


def measure(folder: Path, program: str, inputs: str) -> tuple[int, int, float]:
    """Numbers of inputs and outputs, and the best rate of some rounds: other processes share the host."""
    fmu = Unpacked(folder, program, inputs)
    library = next((fmu.folder / "binaries/linux64").iterdir())
    command = [folder / "master", library, *fmu.arguments((fmu.folder / "resources").resolve().as_uri(), PERIODS)]
    said = [subprocess.run(command, input=fmu.numbers(), check=True, capture_output=True, text=True).stdout.split() for _ in range(ROUNDS)]
    groups = fmu.groups
    return len(groups[0] + groups[1]), len(groups[2] + groups[3]), max(float(rate) for rate, _ in said)


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        subprocess.run(["cc", "-O2", "-Wall", "-Wextra", "-o", folder / "master", "benches/fmu/master.c", "-ldl"], check=True)
        for program, inputs in PROGRAMS:
            ins, outs, rate = measure(folder, program, inputs)
            print(f"| `{Path(program).name}` | {ins}, {outs} | {rate / 1e6:.2f}·10⁶ |", flush=True)


if __name__ == "__main__":
    main()
