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


def measure(folder: Path, program: str, inputs: str) -> tuple[int, int, float]:
    """Numbers of inputs and outputs, and the best rate of some rounds: other processes share the host."""
    file = folder / (Path(program).stem + ".fmu")
    # A system's base tick is in its file, 1 ms as well.
    period = [] if program.endswith(".toml") else PERIOD
    subprocess.run(["target/release/takt", "fmu", program, *period, "-o", file], check=True, stdout=subprocess.DEVNULL)
    unpacked = folder / file.stem
    zipfile.ZipFile(file).extractall(unpacked)
    root = ElementTree.parse(unpacked / "modelDescription.xml").getroot()
    named = {(v.get("causality"), v[0].tag): [] for v in root.iter("ScalarVariable")}
    for variable in root.iter("ScalarVariable"):
        named[variable.get("causality"), variable[0].tag].append((variable.get("name"), variable.get("valueReference")))
    groups = [named.get((causality, tag), []) for causality in ("input", "output") for tag in ("Real", "Integer")]
    rows = list(csv.DictReader(Path(inputs).read_text().splitlines()))
    numbers = [reference for group in groups for _, reference in group]
    numbers += [row[name] for row in rows for name, _ in groups[0] + groups[1]]
    library = next((unpacked / "binaries/linux64").iterdir())
    resources = (unpacked / "resources").resolve().as_uri()
    command = [folder / "master", library, resources, root.get("guid"), str(1e-3), str(PERIODS), str(len(rows)), *(str(len(g)) for g in groups)]
    text = "\n".join(numbers)
    said = [subprocess.run(command, input=text, check=True, capture_output=True, text=True).stdout.split() for _ in range(ROUNDS)]
    return len(groups[0] + groups[1]), len(groups[2] + groups[3]), max(float(rate) for rate, _ in said)


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        subprocess.run(["cc", "-O2", "-Wall", "-Wextra", "-o", folder / "master", "benches/fmu/master.c", "-ldl"], check=True)
        for program, inputs in PROGRAMS:
            ins, outs, rate = measure(folder, program, inputs)
            print(f"| `{Path(program).name}` | {ins}, {outs} | {rate / 1e6:.2f}·10⁶ |", flush=True)


main()
