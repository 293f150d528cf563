# SPDX-License-Identifier: MIT OR Apache-2.0
"""Takt as a peripheral of a LiteX SoC.

The circuit is a folder that ``takt rtl -o FOLDER --program PROGRAM`` wrote, or an unpacked archive of ``cargo xtask release --archives``.

    from takt_litex import add_takt
    add_takt(soc, "takt", "FOLDER")

This adds a memory region (``TAKT_BASE`` in the SoC's mem.h: the ``bus`` of the C header that ``takt asm --header c`` writes), an
event with its CSRs (``takt_ev_pending`` …) and its interrupt (``TAKT_INTERRUPT``): the program waits, its outputs stand.
"""

from pathlib import Path

from litex.build.lattice.trellis import LatticeTrellisToolchain
from litex.gen import LiteXModule
from litex.soc.integration.soc import SoCRegion
from litex.soc.interconnect import axi, wishbone
from litex.soc.interconnect.csr_eventmanager import EventManager, EventSourceProcess
from migen import ClockSignal, Instance, ResetSignal

__all__ = ["REGION_SIZE", "Takt", "TaktError", "add_takt", "machine_of"]

#: Size of the memory region in bytes: the slave decodes 16 bits of word addresses.
REGION_SIZE = 0x4_0000

_STANDARDS = ("wishbone", "axi-lite")


class TaktError(Exception):
    """The folder holds no circuit that can be a peripheral, or an argument is wrong."""


def machine_of(folder):
    """The name of the machine whose circuit is in a folder, as ``t3``.

    Raises TaktError if there is none, or several.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise TaktError(f"{folder}: there is no such folder; `takt rtl -o {folder} --program PROGRAM` writes one")
    end = "_wishbone.v"
    names = sorted(path.name[len("takt_") : -len(end)] for path in folder.glob(f"takt_*{end}"))
    if not names:
        raise TaktError(
            f"{folder}: no circuit of a machine, which `takt rtl -o {folder} --program PROGRAM` writes (a system has no bus slave)"
        )
    if len(names) > 1:
        raise TaktError(f"{folder}: circuits of several machines, {', '.join(names)}; write each to a folder of its own")
    return names[0]


def _sources(folder, machine, ecp5):
    """The paths of the core's Verilog files, from the list beside them."""
    name = folder / f"takt_{machine}{'_ecp5' if ecp5 else ''}.f"
    try:
        files = [folder / line for line in name.read_text().split()]
    except FileNotFoundError:
        raise TaktError(f"{name} is missing: the folder is not complete") from None
    slaves = [folder / f"takt_{machine}_{bus}.v" for bus in ("wishbone", "axi")]
    for file in [*files, *slaves]:
        if not file.is_file():
            raise TaktError(f"{file} is missing: the folder is not complete")
    return files + slaves


class Takt(LiteXModule):
    """The core behind a bus slave.

    platform: where the Verilog files are added; with Trellis for ECP5, those for ECP5's own multipliers and block RAMs.
    folder: the circuit.
    standard: "wishbone" or "axi-lite": the slave's bus, ``self.bus``, of 32 bits.
    latched: how many input ports are latched; as the circuit's program says unless stated.
    restore: whether a reset writes again what was loaded, from a block RAM of its own.

    The core writes words only. A write with fewer than four bytes changes nothing and is answered with the bus' error.

    ``self.waiting`` is 1 while the program waits for its tick; its rise is the event ``self.ev.waiting``.
    """

    def __init__(self, platform, folder, standard="wishbone", latched=None, restore=True):
        if standard not in _STANDARDS:
            raise TaktError(f"there is no bus `{standard}` here; there are {', '.join(_STANDARDS)}")
        folder = Path(folder)
        self.machine = machine_of(folder)
        ecp5 = isinstance(getattr(platform, "toolchain", None), LatticeTrellisToolchain)
        for file in _sources(folder, self.machine, ecp5):
            platform.add_source(str(file.absolute()))

        self.ev = EventManager()
        self.ev.waiting = EventSourceProcess(edge="rising", description="The program waits: its outputs stand.")
        self.ev.finalize()
        self.waiting = self.ev.waiting.trigger

        parameters = {"p_RESTORE": int(restore)}
        if latched is not None:
            parameters["p_LATCHED"] = latched
        connect = self._wishbone if standard == "wishbone" else self._axi_lite
        self.specials += connect(parameters)

    def _wishbone(self, parameters):
        self.bus = bus = wishbone.Interface(data_width=32, address_width=32, addressing="word")
        # The slave does not support byte enables.
        refused = bus.we & (bus.sel != 0b1111)
        self.sync += bus.err.eq(bus.cyc & bus.stb & refused & ~bus.err)
        return Instance(
            f"takt_{self.machine}_wishbone",
            **parameters,
            i_clk_i=ClockSignal(),
            i_rst_i=ResetSignal(),
            i_cyc_i=bus.cyc,
            i_stb_i=bus.stb & ~refused,
            i_we_i=bus.we,
            i_adr_i=bus.adr[:16],
            i_dat_i=bus.dat_w,
            o_dat_o=bus.dat_r,
            o_ack_o=bus.ack,
            o_waiting=self.waiting,
        )

    def _axi_lite(self, parameters):
        self.bus = bus = axi.AXILiteInterface(data_width=32, address_width=32)
        return Instance(
            f"takt_{self.machine}_axi",
            **parameters,
            i_aclk=ClockSignal(),
            i_aresetn=~ResetSignal(),
            i_s_axi_awaddr=bus.aw.addr[:18],
            i_s_axi_awprot=0,
            i_s_axi_awvalid=bus.aw.valid,
            o_s_axi_awready=bus.aw.ready,
            i_s_axi_wdata=bus.w.data,
            i_s_axi_wstrb=bus.w.strb,
            i_s_axi_wvalid=bus.w.valid,
            o_s_axi_wready=bus.w.ready,
            o_s_axi_bresp=bus.b.resp,
            o_s_axi_bvalid=bus.b.valid,
            i_s_axi_bready=bus.b.ready,
            i_s_axi_araddr=bus.ar.addr[:18],
            i_s_axi_arprot=0,
            i_s_axi_arvalid=bus.ar.valid,
            o_s_axi_arready=bus.ar.ready,
            o_s_axi_rdata=bus.r.data,
            o_s_axi_rresp=bus.r.resp,
            o_s_axi_rvalid=bus.r.valid,
            i_s_axi_rready=bus.r.ready,
            o_waiting=self.waiting,
        )


def add_takt(soc, name, folder, standard=None, origin=None, **options):
    """Adds a Takt to a SoC: the module, its memory region at `origin` (where there is room unless stated), its interrupt.

    standard: the slave's bus; AXI4-Lite unless the SoC's bus is Wishbone. `options`: as of Takt.

    Returns the module.
    """
    if standard is None:
        standard = "wishbone" if soc.bus.standard == "wishbone" else "axi-lite"
    takt = Takt(soc.platform, folder, standard=standard, **options)
    soc.add_module(name=name, module=takt)
    soc.bus.add_slave(name=name, slave=takt.bus, region=SoCRegion(origin=origin, size=REGION_SIZE, cached=False))
    if soc.irq.enabled:
        soc.irq.add(name, use_loc_if_exists=True)
    return takt
