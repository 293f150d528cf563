"""An SSI encoder at the board's master, with times in nanoseconds: written from the interface's description, not from the master."""

import json
import os
import random

import cocotb
from cocotb.triggers import Edge, Timer, with_timeout

from master import MHZ, Master, gray

OF = json.loads(os.environ["PARAMETERS"])
BITS, TURN = OF["BITS"], OF["TURN"]
# µs for which the encoder waits for another edge, as long as the master's pause allows.
MONOFLOP = (OF["PAUSE"] - 3) / MHZ


class Encoder:
    """Holds its position at the first falling edge, gives a bit at each rising edge, and rests behind the monoflop's time."""

    def __init__(self, dut, delay):
        self.clock, self.data, self.delay = dut.pin_clock, dut.pin_data, delay
        self.position = 0
        self.spoils = lambda bits: bits
        self.latched = 0
        self.data.value = 1
        self.task = cocotb.start_soon(self.run())

    def bits(self):
        word = gray(self.position) if OF["GRAY"] else self.position
        bits = [word >> bit & 1 for bit in reversed(range(BITS))]
        return self.spoils([*bits, 0, *bits] if OF["DOUBLE"] else bits)

    async def give(self, bit):
        if self.delay:
            await Timer(self.delay, units="ns")
        self.data.value = bit

    async def run(self):
        while True:
            await Edge(self.clock)
            assert self.clock.value == 0, "the clock rests high"
            self.latched += 1
            left = self.bits()
            while True:
                try:
                    await with_timeout(Edge(self.clock), int(MONOFLOP * 1000), "ns")
                except cocotb.result.SimTimeoutError:
                    assert not left, f"{len(left)} bits were not asked for"
                    self.data.value = 1
                    break
                assert left, "an edge before the monoflop's end"
                if self.clock.value == 1:
                    cocotb.start_soon(self.give(left.pop(0)))


def expected(position):
    return {"position": position & ((1 << TURN) - 1), "turns": position >> TURN}


@cocotb.test(timeout_time=50, timeout_unit="ms")
async def positions_come_through(dut):
    random.seed(BITS)
    master = await Master(dut, "pin_data").ready()
    for share in [0, 0.5, 1]:
        # The line may be as late as half a bit, but for three cycles.
        encoder = Encoder(dut, int(share * (OF["HALF"] - 3) * 1000 / MHZ))
        for number, position in enumerate([0, (1 << BITS) - 1, *(random.getrandbits(BITS) for _ in range(6))]):
            encoder.position = position
            before = await master.registers()
            assert await master.frame() == 2 * OF["HALF"] * (2 * BITS + 1 if OF["DOUBLE"] else BITS), number
            now = await master.registers()
            assert now == {**before, **expected(position), "frames": before["frames"] + 1}, (share, position)
            assert encoder.latched == number + 1
            # A start during the monoflop's time is lost: the encoder sees no edge.
            await master.start()
            assert await master.registers() == {**now, "lost": now["lost"] + 1}
            await Timer(OF["PAUSE"] * 1000 // MHZ + 50, units="ns")
        encoder.task.kill()


@cocotb.test(timeout_time=50, timeout_unit="ms")
async def spoiled_frames_are_counted(dut):
    master = await Master(dut, "pin_data").ready()
    encoder = Encoder(dut, 40)
    encoder.position = 0x155
    await master.frame()
    good = await master.registers()
    assert good["frames"] == 1
    pause = OF["PAUSE"] * 1000 // MHZ + 50
    if OF["DOUBLE"]:
        for bit in [0, BITS - 1, BITS, BITS + 1, 2 * BITS]:
            encoder.spoils = lambda bits: [value ^ (at == bit) for at, value in enumerate(bits)]
            await Timer(pause, units="ns")
            await master.frame()
            now = await master.registers()
            assert now == {**good, "errors": now["errors"]} and now["errors"] > 0, bit
        encoder.spoils = lambda bits: bits
    # The cable is pulled: the line is low.
    await Timer(pause, units="ns")
    before = await master.registers()
    dut.pin_data.value = 0
    encoder.data = type("Nowhere", (), {})()
    await Timer(100, units="ns")
    await master.frame()
    assert await master.registers() == {**before, "errors": before["errors"] + 1}
