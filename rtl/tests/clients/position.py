"""The program that all of them run, programs/examples/board/position.s: what it computes, without Takt."""

import json
import struct
from pathlib import Path


def single(value):
    """The nearest number of binary32. The product of two of them is exact in Python's numbers, so this rounds once."""
    return struct.unpack("<f", struct.pack("<f", value))[0]


def bits(value):
    return struct.unpack("<I", struct.pack("<f", value))[0]


def expected(n, wanted):
    """The output ports as words."""
    error = wanted - n
    duty = max(min(single(single(float(error)) * single(0.02)), 1.0), -1.0)
    return {"duty": bits(duty), "error": error & 0xFFFFFFFF}


def described():
    """Addresses and records, as tools/evidence/src/clients.rs writes them."""
    return json.loads(Path("core.json").read_text())


async def load_and_run(write, read):
    """Loads the program over a bus, runs periods and checks every output. write and read take addresses in words."""
    core = described()
    at = core["registers"]
    assert await read(at["control"]) == 0
    for space, slot, address, value in core["records"]:
        if space == 3:
            await write(core["input"] + address, value)
            continue
        await write(at["load_place"], slot << 18 | space << 16 | address)
        await write(at["load_high"], value >> 32)
        await write(at["load_low"], value & 0xFFFFFFFF)
    await write(at["period"], 0)
    await write(at["control"], 1)
    assert await read(at["control"]) == 1

    async def waits():
        for _ in range(2000):
            status = await read(at["status"])
            assert status & 0xE == 0, f"status {status:#x}"
            if status & 1:
                return
        raise AssertionError("the program does not wait")

    await waits()
    for n, wanted in [(0, 0), (3, 40), (-(2**31), 5), (40, 3), (1000, -1000), (7, 6)]:
        await write(core["inputs"]["n"], n & 0xFFFFFFFF)
        await write(core["inputs"]["wanted"], wanted & 0xFFFFFFFF)
        await write(at["tick"], 1)
        await waits()
        outputs = {name: await read(core["outputs"][name]) for name in ("duty", "error")}
        error = (wanted - n + 2**31) % 2**32 - 2**31  # as the integer unit wraps
        assert outputs == expected(wanted - error, wanted), (n, wanted, outputs)
    # An address without a register reads 0.
    assert await read(0x7FF0) == 0
