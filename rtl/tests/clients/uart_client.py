"""A board's UART with cocotbext-uart's ends: the frames of docs/protocol.md, with Python's own CRC."""

import binascii
import json
import struct
from pathlib import Path

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import Timer, with_timeout
from cocotbext.uart import UartSink, UartSource

from position import expected


def request(number, command, address, words, count=None):
    body = struct.pack("<BBBH", number, command, len(words) if count is None else count, address)
    body += b"".join(struct.pack("<I", word) for word in words)
    return b"\xa5" + body + struct.pack("<H", binascii.crc_hqx(body, 0xFFFF))


@cocotb.test(timeout_time=20, timeout_unit="ms")
async def frames_are_answered(dut):
    board = json.loads(Path("board.json").read_text())
    at = board["registers"]
    # The clock has 25 MHz.
    cocotb.start_soon(Clock(dut.clk_in, 40, units="ns").start())
    dut.button.value = board["released"]
    dut.encoder_a.value = 0
    dut.encoder_b.value = 0
    source = UartSource(dut.uart_receive, baud=board["baud"])
    sink = UartSink(dut.uart_send, baud=board["baud"])
    await Timer(100, units="us")

    async def answer(number):
        async def frame():
            got = b""
            while len(got) < 4 or len(got) < 6 + 4 * got[3]:
                got += bytes(await sink.read(1))
            return got

        got = await with_timeout(frame(), 2, "ms")
        assert got[:3] == bytes([0x5A, number, 0]), got.hex()
        assert struct.unpack("<H", got[-2:])[0] == binascii.crc_hqx(got[1:-2], 0xFFFF), got.hex()
        return list(struct.unpack(f"<{got[3]}I", got[4:-2]))

    async def read(number, address, count=1):
        await source.write(request(number, 1, address, [], count))
        return await answer(number)

    async def write(number, address, words):
        await source.write(request(number, 2, address, words))
        assert await answer(number) == []

    assert await read(1, at["id"]) == [0x544B0201]
    # A frame with a wrong checksum is no request, and counts as an error.
    [before] = await read(2, at["errors"])
    broken = bytearray(request(3, 2, at["period"], [5]))
    broken[-1] ^= 0x10
    await source.write(broken)
    await source.wait()
    await Timer(100, units="us")
    assert sink.empty()
    assert await read(4, at["errors"]) == [before + 1]
    assert await read(5, at["period"]) == [board["period"]]
    # The program runs, and answers the inputs that the host sets.
    await write(6, board["inputs"]["wanted"], [33])
    await Timer(250, units="us")
    outputs = expected(0, 33)
    assert await read(7, board["outputs"]["error"]) == [outputs["error"]]
    assert await read(8, board["outputs"]["duty"]) == [outputs["duty"]]
    # The board answers a repeated write of the last number again, but does not do it again.
    await write(9, at["control"], [0b111])
    [held] = await read(10, at["periods"])
    for _ in range(3):
        await write(11, at["step"], [1])
    await Timer(20, units="us")
    assert await read(12, at["periods"]) == [held + 1]
