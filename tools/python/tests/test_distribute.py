"""Cases in other processes: results in order, errors as they are, HyperQueue as it is on PATH and installed nowhere."""

import functools
import os
import sys
from pathlib import Path

import pytest

import takt
from test_programs import GAIN

FAKE = Path(__file__).parents[2] / "work/tests/fake_hq.py"


def scaled(program, value):
    if value < 0:
        raise ValueError(f"{value} is negative")
    return os.getpid(), float(program.run({"x": [value]}).outputs["y"][0])


def ends(value):
    os._exit(value)


@pytest.fixture
def here(tmp_path, monkeypatch):
    (tmp_path / "bin").mkdir()
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_results_are_in_the_order_of_the_cases(here):
    results = takt.distribute(functools.partial(scaled, takt.assemble(GAIN)), [1.0, 2.0, 3.0], jobs=2)
    assert [value for _, value in results] == [0.5, 1.0, 1.5]
    assert os.getpid() not in {process for process, _ in results}
    # No files are left.
    assert [path.name for path in here.iterdir()] == ["bin"]


def test_errors_come_back(here):
    with pytest.raises(ValueError, match="-1.0 is negative") as raised:
        takt.distribute(functools.partial(scaled, takt.assemble(GAIN)), [1.0, -1.0])
    assert "in scaled" in str(raised.value.__cause__)
    with pytest.raises(RuntimeError, match="1 of 1 cases failed; case 0: it ended with exit status: 7"):
        takt.distribute(ends, [7])
    with pytest.raises(ValueError, match="one of both"):
        takt.distribute(ends, [7], hq=True, hq_server="there")


def test_a_script_without_a_guard_is_told(here):
    (here / "sweep.py").write_text("import takt\ndef f(x): return x\nprint(takt.distribute(f, [1]))\n")
    done = os.popen(f"{sys.executable} sweep.py 2>&1").read()
    assert "put the call below `if __name__ ==" in done


def test_hyperqueue_on_path_gets_the_units(here, monkeypatch):
    (here / "bin/hq").symlink_to(FAKE)
    monkeypatch.setenv("PATH", f"{here / 'bin'}:/usr/bin:/bin")
    (here / "server").mkdir()
    (here / "server/hq-current").touch()
    cases = [1.0, 2.0]
    program = functools.partial(scaled, takt.assemble(GAIN))
    assert [value for _, value in takt.distribute(program, cases, hq_server="server", seconds=90)] == [0.5, 1.0]
    assert 'time_request = "90s"' in (here / "server/jobs.toml").read_text()
    assert [value for _, value in takt.distribute(program, cases, hq=True, jobs=1)] == [0.5, 1.0]


def test_nothing_is_installed(here, monkeypatch):
    for name in ("python3", "hq"):
        (here / "bin" / name).write_text("#!/bin/sh\nexit 1\n")
        (here / "bin" / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{here / 'bin'}:/usr/bin:/bin")
    monkeypatch.setattr(sys, "executable", str(here / "bin/python3"))
    with pytest.raises(RuntimeError, match="HyperQueue is not on PATH.*pip install hyperqueue=="):
        takt.distribute(ends, [7], hq=True)
