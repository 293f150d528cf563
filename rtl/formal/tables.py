# SPDX-License-Identifier: MIT OR Apache-2.0
"""Compares a unit's table, word by word, with the specification's.

The words are those that yosys reads in the table's file. `cargo evidence tables` tells the specification's, and checks the bounds that
other proofs assume of them.
"""

import functools
import hashlib
import json
import os
import subprocess
from dataclasses import dataclass

from circuit import Failure, write_units, yosys

# Program that prints the specification's words: cargo's path of the binary `evidence`.
TELLER = os.environ.get("TAKT_ENUMERATOR")


@dataclass(frozen=True)
class Words:
    """The memories of a table: name of the output -> (name of the address, words from address 0 on)."""

    table: str
    memories: dict

    @property
    def key(self):
        """A hash of the words."""
        return hashlib.sha256(repr(sorted(self.memories.items())).encode()).hexdigest()[:16]


def read(folder, texts, table):
    """The words of a table. Raises Failure unless every output is a memory's word at an address, a cycle later."""
    script = write_units(folder, texts, table)
    script += [f"hierarchy -check -top {table}", "proc -norom", "flatten", "opt_clean", "memory_collect", "opt_clean"]
    yosys(folder, [*script, "write_json table.json"])
    module = json.loads((folder / "table.json").read_text())["modules"][table]
    ports = {name: port["bits"] for name, port in module["ports"].items()}
    name_of = lambda bits, direction: next(
        (name for name, port in module["ports"].items() if port["bits"] == bits and port["direction"] == direction), None
    )
    cells = list(module["cells"].values())
    registers = {
        tuple(cell["connections"]["D"]): cell["connections"]
        for cell in cells
        if cell["type"] == "$dff" and int(cell["parameters"]["CLK_POLARITY"], 2) == 1
    }
    memories = {}
    for cell in cells:
        if cell["type"] != "$mem_v2":
            continue
        of, pins = cell["parameters"], cell["connections"]
        number = lambda parameter: int(of[parameter], 2)
        register = registers.pop(tuple(pins["RD_DATA"]), None)
        output = register and register["CLK"] == ports["clk"] and name_of(register["Q"], "output")
        address = name_of(pins["RD_ADDR"], "input")
        width, size = number("WIDTH"), number("SIZE")
        plain = number("RD_PORTS") == 1 and number("WR_PORTS") == 0 and number("RD_CLK_ENABLE") == 0 and number("OFFSET") == 0
        if not (plain and output and address and size == 1 << len(ports[address])):
            raise Failure(f"{table}: a memory is not read as a table's: a word at an address, in a register")
        bits = of["INIT"]
        words = [bits[len(bits) - width * (i + 1) : len(bits) - width * i] for i in range(size)]
        unset = next((i for i, word in enumerate(words) if set(word) - {"0", "1"}), None)
        if unset is not None:
            raise Failure(f"{table}: {output} has no word at {unset:#x}")
        memories[output] = (address, [int(word, 2) for word in words])
    others = [name for name, port in module["ports"].items() if port["direction"] == "output" and name not in memories]
    if others or len(cells) != 2 * len(memories):
        raise Failure(f"{table}: there is more than memories and their registers: {others or [cell['type'] for cell in cells]}")
    return Words(table, memories)


@functools.cache
def specified():
    """The specification's tables by name."""
    if not TELLER:
        raise Failure("the variable TAKT_ENUMERATOR does not name the program: use `cargo evidence formal --units`")
    done = subprocess.run([TELLER, "tables"], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise Failure(f"the specification's tables are not within their bounds:\n{done.stderr}")
    return {
        table: {output: (memory["address"], memory["words"]) for output, memory in memories.items()}
        for table, memories in json.loads(done.stdout).items()
    }


class Comparison:
    """A table, of which no word may differ from the specification's."""

    def __init__(self, words):
        self.found = words
        self.expected = specified()[words.table]

    @staticmethod
    def key(words):
        """A hash of all that the outcome depends on."""
        return words.key + Words(words.table, specified()[words.table]).key

    def counterexample(self, number=None):
        """The first address, by bits, of a word that differs; None if there is none."""
        if self.found.memories.keys() != self.expected.keys():
            raise Failure(f"{self.found.table} has the outputs {', '.join(self.found.memories)}")
        for output, (address, words) in self.expected.items():
            if self.found.memories[output][0] != address or len(self.found.memories[output][1]) != len(words):
                raise Failure(f"{self.found.table}: {output} is another memory")
            for at, (found, word) in enumerate(zip(self.found.memories[output][1], words)):
                if found != word:
                    return {f"{address}[{i}]": at >> i & 1 for i in range(len(words).bit_length() - 1)}
        return None

    def uncovered(self, parts):
        """None: every address is compared."""
        assert parts == 1
