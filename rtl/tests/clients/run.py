"""Builds each circuit in Icarus Verilog and runs its client: run.py FOLDER. What is in FOLDER: tools/evidence/src/clients.rs."""

import json
import sys
from pathlib import Path

from cocotb.runner import get_results, get_runner

HERE = Path(__file__).parent


def run(folder, module, top, files, parameters=None):
    """Runs one client's tests, of a module with these parameters; the number of those that failed."""
    runner = get_runner("icarus")
    name = "_".join([module, *map(str, (parameters or {}).values())])
    build = folder / f"build_{name}"
    runner.build(
        verilog_sources=[folder / name for name in files],
        hdl_toplevel=top,
        build_args=["-g2005"],
        parameters=parameters or {},
        build_dir=build,
        always=True,
        timescale=("1ns", "1ps"),
    )
    # The simulator finds memory images in its working folder.
    results = runner.test(
        hdl_toplevel=top,
        test_module=module,
        build_dir=build,
        test_dir=folder,
        results_xml=f"{name}.xml",
        extra_env={"COCOTB_LOG_LEVEL": "WARNING", "PARAMETERS": json.dumps(parameters or {})},
    )
    tests, failed = get_results(Path(results))
    print(f"{name}: {tests} tests, {failed} failed")
    return failed + (tests == 0)


SSI = [
    {"HALF": 31, "BITS": 13, "TURN": 24, "GRAY": 0, "DOUBLE": 0, "PAUSE": 1300},
    {"HALF": 16, "BITS": 25, "TURN": 12, "GRAY": 1, "DOUBLE": 1, "PAUSE": 800},
    {"HALF": 20, "BITS": 36, "TURN": 32, "GRAY": 1, "DOUBLE": 0, "PAUSE": 1300},
]

BISS = [
    {"HALF": 4, "BITS": 18, "TURN": 24, "WAIT": 32, "TIMEOUT": 1300},
    {"HALF": 2, "BITS": 12, "TURN": 5, "WAIT": 20, "TIMEOUT": 400},
    {"HALF": 9, "BITS": 36, "TURN": 20, "WAIT": 16, "TIMEOUT": 800},
]


def main():
    folder = Path(sys.argv[1])
    sys.path.insert(0, str(HERE))

    def files(name):
        return (folder / name).read_text().split()

    core = folder / "core"
    failed = run(core, "wishbone_client", "takt_t1_wishbone", [*files("core/takt_t1.f"), "takt_t1_wishbone.v"])
    failed += run(core, "axi_client", "takt_t1_axi", [*files("core/takt_t1.f"), "takt_t1_wishbone.v", "takt_t1_axi.v"])
    failed += run(folder / "board", "uart_client", "takt_board", files("board/files.f"))
    for parameters in SSI:
        failed += run(folder / "board", "ssi_client", "takt_ssi", ["board/takt_ssi.v"], parameters)
    for parameters in BISS:
        failed += run(folder / "board", "biss_client", "takt_biss_c", ["board/takt_biss_c.v"], parameters)
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
