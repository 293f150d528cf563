#!/usr/bin/env python3
# SPDX-License-Identifier: MIT OR Apache-2.0
"""Loads a program into a core at the processors' bus, over a UIO device of Linux, and runs periods of it.

    python3 takt_uio.py DEVICE PERIODS [NAME=VALUE ...]

An input or parameter without a value keeps that of the program. Each period's outputs are printed in a line. `program.json`, beside this
file, has ports, registers and what is loaded (docs/headers.md in Takt's repository). As a module: `Core(Bus(DEVICE))`, its `load`, `start`,
`set` and `period`. Never tried on a board by us.
"""

import json
import mmap
import os
import struct
import sys
from pathlib import Path

BYTES = 1 << 18  # of the core's addresses
INPUTS = 0x1000  # address of input port 0, in words
POLLS = 1_000_000  # reads of `status` after which a program does not wait any more


class Bus:
    """Words of a UIO device, by their addresses in words."""

    def __init__(self, path):
        file = os.open(path, os.O_RDWR | os.O_SYNC)
        try:
            self.memory = mmap.mmap(file, BYTES)
        finally:
            os.close(file)
        # The core refuses writes of parts of a word: a view of words writes whole ones.
        self.words = memoryview(self.memory).cast("I")

    def write(self, address, word):
        self.words[address] = word

    def read(self, address):
        return self.words[address]


class CoreError(Exception):
    """The program does not run, or there is no such port or value."""


class Core:
    """A core with its program, at a bus with methods `write(address, word)` and `read(address)`."""

    def __init__(self, bus, header=None):
        path = Path(__file__).with_name("program.json")
        self.bus, self.header = bus, header or json.loads(path.read_text(encoding="utf-8"))
        self.at = {register["name"]: register["address"] for register in self.header["registers"]}
        status = next(register for register in self.header["registers"] if register["name"] == "status")
        self.bits = {field["name"]: ((1 << field["width"]) - 1) << field["low"] for field in status["fields"]}
        inputs = [*self.header["inputs"], *self.header.get("parameters", [])]
        self.inputs = {port["name"]: port for port in inputs}

    def load(self):
        """Stops the core and loads the program."""
        bus, at, load = self.bus, self.at, self.header["load"]
        bus.write(at["control"], 0)
        bus.write(at["load_high"], 0)
        # The place moves on by itself. Word 0 of a program is illegal: execution past the end stops.
        for slot in range(load["slots"]):
            bus.write(at["load_place"], slot << 18)
            for _ in range(load["bundles"]):
                bus.write(at["load_low"], 0)
        bus.write(at["load_place"], 1 << 16)
        for _ in range(load["data_words"]):
            bus.write(at["load_low"], 0)
        for record in load["records"]:
            if record["space"] == 3:
                bus.write(INPUTS + record["address"], record["value"])
                continue
            bus.write(at["load_place"], record["address"] | record["space"] << 16 | record["slot"] << 18)
            bus.write(at["load_high"], record["value"] >> 32)
            bus.write(at["load_low"], record["value"] & 0xFFFFFFFF)

    def set(self, name, value):
        """Writes a number to an input port or a parameter."""
        port = self.inputs.get(name)
        if port is None:
            raise CoreError(f"{name}: expected the name of an input: {' '.join(self.inputs)}")
        try:
            form = {"float": "<f", "int": "<i", "bits": "<I"}[port["type"]]
            (word,) = struct.unpack("<I", struct.pack(form, value))
        except (struct.error, OverflowError):
            raise CoreError(f"{name}={value}: not a value of `{name}`") from None
        self.bus.write(port["address"], word)

    def start(self):
        """Starts the program, and returns once it waits for the first tick."""
        self.bus.write(self.at["period"], 0)  # a tick is a write of this program
        self.bus.write(self.at["control"], 1)
        self.wait()

    def wait(self):
        """Returns once the program waits for a tick."""
        for _ in range(POLLS):
            status = self.bus.read(self.at["status"])
            if status & (self.bits["fault"] | self.bits["halted"]):
                what = "a fault" if status & self.bits["fault"] else "halted"
                raise CoreError(f"the program has {what}, status {status:#010x} (docs/hardware.md)")
            if status & self.bits["waiting"]:
                return
        raise CoreError("the program does not wait for a tick")

    def period(self):
        """Runs a period, and returns its outputs by name."""
        self.bus.write(self.at["tick"], 1)
        self.wait()
        return {port["name"]: self.output(port) for port in self.header["outputs"]}

    def output(self, port):
        word = struct.pack("<I", self.bus.read(port["address"]))
        return struct.unpack({"float": "<f", "int": "<i", "bits": "<I"}[port["type"]], word)[0]

    def stop(self):
        """Holds the core in reset."""
        self.bus.write(self.at["control"], 0)


def text(port, value):
    form = {"float": "%s=%.9g", "int": "%s=%d", "bits": "%s=0x%08x"}[port["type"]]
    return form % (port["name"], value)


def main(arguments, bus=None):
    if len(arguments) < 2 or not arguments[1].isdecimal():
        print("usage: takt_uio.py DEVICE PERIODS [NAME=VALUE ...]", file=sys.stderr)
        return 2
    try:
        core = Core(bus or Bus(arguments[0]))
        core.load()
        for setting in arguments[2:]:
            name, _, value = setting.partition("=")
            is_float = core.inputs.get(name, {}).get("type") == "float"
            try:
                number = float(value) if is_float else int(value, 0)
            except ValueError:
                raise CoreError(f"{setting}: not a value of `{name}`") from None
            core.set(name, number)
        core.start()
        for number in range(1, int(arguments[1]) + 1):
            outputs = core.period()
            line = [text(port, outputs[port["name"]]) for port in core.header["outputs"]]
            print(" ".join([str(number), *line]))
        core.stop()
    except (CoreError, OSError) as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
