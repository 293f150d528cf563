"""The Wishbone slave with cocotbext-wishbone's master."""

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import ClockCycles
from cocotbext.wishbone.driver import WBOp, WishboneMaster

from position import load_and_run

SIGNALS = {
    "cyc": "cyc_i",
    "stb": "stb_i",
    "we": "we_i",
    "adr": "adr_i",
    "datwr": "dat_i",
    "datrd": "dat_o",
    "ack": "ack_o",
}


@cocotb.test(timeout_time=20, timeout_unit="ms")
async def loads_and_runs(dut):
    cocotb.start_soon(Clock(dut.clk_i, 10, units="ns").start())
    master = WishboneMaster(dut, None, dut.clk_i, width=32, timeout=200, signals_dict=SIGNALS)
    dut.rst_i.value = 1
    await ClockCycles(dut.clk_i, 3)
    dut.rst_i.value = 0

    # The first load waits for a whole reset, which writes the kept words again.
    async def write(address, word):
        await master.send_cycle([WBOp(address, word, acktimeout=5000)])

    async def read(address):
        [result] = await master.send_cycle([WBOp(address, acktimeout=50)])
        assert result.ack == 1
        return int(result.datrd)

    await load_and_run(write, read)
