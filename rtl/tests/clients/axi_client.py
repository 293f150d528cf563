"""The AXI4-Lite slave with cocotbext-axi's master, with and without pauses."""

import itertools
import random

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import ClockCycles
from cocotbext.axi import AxiLiteBus, AxiLiteMaster, AxiResp

from position import described, load_and_run


async def start(dut):
    cocotb.start_soon(Clock(dut.aclk, 10, units="ns").start())
    master = AxiLiteMaster(AxiLiteBus.from_prefix(dut, "s_axi"), dut.aclk, dut.aresetn, reset_active_level=False)
    dut.aresetn.value = 0
    await ClockCycles(dut.aclk, 3)
    dut.aresetn.value = 1
    return master


def words(master):
    async def write(address, word):
        answer = await master.write(4 * address, word.to_bytes(4, "little"))
        assert answer.resp == AxiResp.OKAY

    async def read(address):
        answer = await master.read(4 * address, 4)
        assert answer.resp == AxiResp.OKAY
        return int.from_bytes(answer.data, "little")

    return write, read


@cocotb.test(timeout_time=20, timeout_unit="ms")
async def loads_and_runs(dut):
    await load_and_run(*words(await start(dut)))


@cocotb.test(timeout_time=20, timeout_unit="ms")
async def pauses_change_nothing(dut):
    master = await start(dut)
    random.seed(1)
    for channel in (
        master.write_if.aw_channel,
        master.write_if.w_channel,
        master.write_if.b_channel,
        master.read_if.ar_channel,
        master.read_if.r_channel,
    ):
        channel.set_pause_generator(itertools.cycle([random.random() < 0.5 for _ in range(97)]))
    await load_and_run(*words(master))


@cocotb.test(timeout_time=20, timeout_unit="ms")
async def writes_and_reads_at_once(dut):
    """Both sides are served, in whatever order they come, and answers are those of their own requests."""
    write, read = words(await start(dut))
    period = described()["registers"]["period"]

    async def writes():
        for i in range(50):
            await write(period, i)

    async def reads():
        seen = [await read(period) for _ in range(50)]
        assert seen == sorted(seen) and seen[-1] > 0, seen

    both = [cocotb.start_soon(writes()), cocotb.start_soon(reads())]
    for side in both:
        await side
    assert await read(period) == 49


@cocotb.test(timeout_time=20, timeout_unit="ms")
async def a_part_of_a_word_is_refused(dut):
    master = await start(dut)
    write, read = words(master)
    period = described()["registers"]["period"]
    await write(period, 0x12345678)
    answer = await master.write(4 * period, b"\x01")
    assert answer.resp == AxiResp.SLVERR
    assert await read(period) == 0x12345678
