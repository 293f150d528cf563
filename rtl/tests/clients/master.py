"""The side of a master of an encoder that a board has: starts, and registers."""

import re

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import ReadOnly, RisingEdge, Timer

# Frequency of the clock, in MHz.
MHZ = 62.5


def gray(number):
    return number ^ number >> 1


class Master:
    def __init__(self, dut, data):
        self.dut = dut
        names = [name for name in dir(dut) if re.fullmatch(r"r_[a-z]+", name)]
        self.names = [name[2:] for name in names]
        self.clock = cocotb.start_soon(Clock(dut.clk, 16, units="ns").start())
        getattr(dut, data).value = 1

    async def ready(self):
        """Resets the master, and waits until its first frame may start."""
        dut = self.dut
        dut.rst.value, dut.start.value, dut.take.value = 1, 0, 0
        for _ in range(5):
            await RisingEdge(dut.clk)
        dut.rst.value = 0
        await Timer(60, units="us")
        return self

    async def start(self):
        """A pulse of start; returns in the cycle after it."""
        await RisingEdge(self.dut.clk)
        self.dut.start.value = 1
        await RisingEdge(self.dut.clk)
        self.dut.start.value = 0
        await ReadOnly()

    async def registers(self):
        """The registers, taken now."""
        dut = self.dut
        await RisingEdge(dut.clk)
        dut.take.value = 1
        await RisingEdge(dut.clk)
        dut.take.value = 0
        await ReadOnly()
        values = {name: int(getattr(dut, f"r_{name}").value) for name in self.names}
        await RisingEdge(dut.clk)
        return values

    async def frame(self, most=100_000):
        """Starts a frame; the cycles from the next one until a register changes."""
        dut = self.dut
        counters = [dut.frames, dut.errors, *([dut.silent] if "silent" in self.names else [])]
        await ReadOnly()
        before = [int(counter.value) for counter in counters]
        await self.start()
        for cycles in range(most):
            if [int(counter.value) for counter in counters] != before:
                return cycles
            await RisingEdge(dut.clk)
            await ReadOnly()
        raise AssertionError("the frame does not end")
