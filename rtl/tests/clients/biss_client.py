"""A BiSS C encoder at the board's master, with times in nanoseconds: written from the interface's description, not from the master."""

import json
import os
import random

import cocotb
from cocotb.triggers import Edge, Timer, with_timeout

from master import MHZ, Master

OF = json.loads(os.environ["PARAMETERS"])
BITS, TURN, HALF = OF["BITS"], OF["TURN"], OF["HALF"]
BIT = 2 * HALF * 1000 / MHZ


def crc(word):
    """The remainder of the word, with six zeros behind, after division by x^6 + x + 1."""
    rest = word << 6
    for power in reversed(range(rest.bit_length())):
        if power >= 6 and rest >> power & 1:
            rest ^= 0x43 << (power - 6)
    return rest


class Encoder:
    """Holds its position at the first falling edge, answers the second rising edge, and gives a bit at each one after that."""

    def __init__(self, dut, delay):
        self.clock, self.line, self.delay = dut.pin_ma, dut.pin_slo, delay
        # µs without an edge behind which the line is 1 again; the master waits as long, and for the line.
        self.timeout = (OF["TIMEOUT"] - 4) / MHZ - 2 * delay / 1000
        self.position, self.error, self.warning = 0, 0, 0
        self.busy = 1
        self.spoils = lambda bits: bits
        self.latched = 0
        self.line.value = 1
        self.task = cocotb.start_soon(self.run())

    def bits(self):
        # Error and warning are reported by 0.
        word = self.position << 2 | (1 - self.error) << 1 | (1 - self.warning)
        frame = word << 6 | crc(word) ^ 0x3F
        bits = [frame >> bit & 1 for bit in reversed(range(BITS + 8))]
        return [0] * self.busy + [1, 0, *self.spoils(bits)]

    async def give(self, bit):
        if self.delay:
            await Timer(self.delay, units="ns")
        self.line.value = bit

    async def run(self):
        while True:
            await Edge(self.clock)
            assert self.clock.value == 0, "the clock rests high"
            self.latched += 1
            bits = self.bits()
            rises = 0
            while True:
                try:
                    await with_timeout(Edge(self.clock), int(self.timeout * 1000), "ns")
                except cocotb.result.SimTimeoutError:
                    cocotb.start_soon(self.give(1))
                    break
                if self.clock.value == 1:
                    rises += 1
                    if rises >= 2:
                        cocotb.start_soon(self.give(bits.pop(0) if bits else 0))


def expected(encoder):
    position = {"position": encoder.position & ((1 << TURN) - 1), "turns": encoder.position >> TURN}
    return {**position, "error": encoder.error, "warning": encoder.warning}


async def rest():
    await Timer((OF["TIMEOUT"] + HALF) * 1000 // MHZ + 50, units="ns")


@cocotb.test(timeout_time=50, timeout_unit="ms")
async def positions_come_through_every_line(dut):
    random.seed(BITS)
    master = await Master(dut, "pin_slo").ready()
    for share in [0, 0.25, 0.5, 1, 1.49, 4.5, 5, 5.51]:
        encoder = Encoder(dut, round(share * BIT))
        for number, position in enumerate([0, (1 << BITS) - 1, *(random.getrandbits(BITS) for _ in range(4))]):
            encoder.position, encoder.error, encoder.warning = position, number % 2, number // 2 % 2
            encoder.busy = 1 + number
            before = await master.registers()
            cycles = await master.frame()
            least = 2 * HALF * (BITS + 12 + number) + 3 + encoder.delay * MHZ / 1000
            assert least - 1 <= cycles <= least + 1, (cycles, least)
            now = await master.registers()
            delay = now["delay"]
            assert abs(delay - encoder.delay * MHZ / 1000) <= 1, (delay, share)
            assert now == {**before, **expected(encoder), "frames": before["frames"] + 1, "delay": delay}, share
            assert encoder.latched == number + 1
            await master.start()
            assert await master.registers() == {**now, "lost": now["lost"] + 1}
            await rest()
        encoder.task.kill()


@cocotb.test(timeout_time=50, timeout_unit="ms")
async def broken_frames_are_counted(dut):
    master = await Master(dut, "pin_slo").ready()
    encoder = Encoder(dut, round(0.6 * BIT))
    encoder.position = 0x5A5
    await master.frame()
    good = await master.registers()
    assert good["frames"] == 1
    await rest()
    # Each bit of the frame, its CRC among them.
    for number, bit in enumerate(range(BITS + 8)):
        encoder.spoils = lambda bits: [value ^ (at == bit) for at, value in enumerate(bits)]
        await master.frame()
        assert await master.registers() == {**good, "errors": number + 1}, bit
        await rest()
    encoder.spoils = lambda bits: bits
    # The encoder is busy for too long, and then just not.
    now = await master.registers()
    for busy, silent in [(OF["WAIT"] + 1, 1), (OF["WAIT"] - 2, 0)]:
        encoder.busy = busy
        await master.frame()
        then = await master.registers()
        assert then["silent"] == now["silent"] + 1, busy
        assert then["frames"] == now["frames"] + 1 - silent, busy
        await rest()
    # The cable is pulled, and the line is high or low: no frame is taken, and the position stays.
    encoder.task.kill()
    now = await master.registers()
    for level in [1, 0]:
        dut.pin_slo.value = level
        await Timer(100, units="ns")
        await master.frame()
        now["silent"] += 1
        assert await master.registers() == now, level
        await rest()
