"""Calls of a function in other processes, on this computer or on others."""

from __future__ import annotations

import os
import pickle
import shutil
import sys
import tempfile
import traceback
from collections.abc import Callable, Iterable
from multiprocessing.spawn import get_preparation_data, prepare
from pathlib import Path
from typing import Any, TypeVar

from takt import _takt
from takt._ports import AnyPath, count_of, path_of

C = TypeVar("C")
R = TypeVar("R")

#: This process runs a unit of work.
_is_unit = False


class _Remote(Exception):
    """The traceback of another process."""

    def __str__(self) -> str:
        return str(self.args[0])


def distribute(
    function: Callable[[C], R],
    cases: Iterable[C],
    *,
    hq: bool = False,
    hq_server: AnyPath | None = None,
    jobs: int | None = None,
    seconds: float = 600,
    folder: AnyPath | None = None,
) -> list[R]:
    """A function's results for cases, each computed in a process of its own: a case is work of some seconds, as a batch of runs.

    As with `multiprocessing`, the function is one of a module, cases and results can be pickled, and a script calls this below
    `if __name__ == "__main__":`. docs/campaigns.md says how workers come to other computers.

    Args:
        function: A function of one case; `functools.partial` gives it a program and more.
        cases: The cases.
        hq: A HyperQueue server and workers are started for this call.
        hq_server: The folder of a running HyperQueue server, whose workers do the work.
        jobs: Processes at a time here, or workers that `hq` starts; without, as many as there are cores.
        seconds: The time that a case takes, or more: a worker of which less is left of its allocation is not given it.
        folder: Where cases and results lie for a while, seen by all workers; without, the current folder.

    Returns:
        The results, in the order of the cases.

    Raises:
        RuntimeError: a process failed three times, there is no server, or HyperQueue is not installed.
        Exception: whatever the function raised, the first in the order of the cases, with its traceback as the cause.
    """
    if _is_unit:
        raise RuntimeError('the script calls takt.distribute while it is imported: put the call below `if __name__ == "__main__":`')
    if hq and hq_server is not None:
        raise ValueError("hq starts a server, hq_server uses one that runs: one of both")
    at = Path(os.path.abspath(path_of("folder", "." if folder is None else folder)))
    below = Path(tempfile.mkdtemp(prefix="takt-units-", dir=at))
    try:
        units, results = [], []
        data = get_preparation_data("takt")
        # Remove data that only multiprocessing itself needs.
        data.pop("authkey", None)
        for number, case in enumerate(cases):
            file, result = below / f"{number:06}.case", below / f"{number:06}.result"
            file.write_bytes(pickle.dumps((data, pickle.dumps((function, case)))))
            command = [sys.executable, "-m", "takt._unit", str(file), str(result)]
            units.append((f"case {number}", command, os.getcwd(), str(result)))
            results.append(result)
        workers = count_of("jobs", jobs) or os.cpu_count() or 1
        server = None if hq_server is None else os.path.abspath(path_of("hq_server", hq_server))
        failed = _takt.run_units(units, max(0, int(seconds)), workers, hq, server, str(below), sys.executable)
        if failed:
            name, reason = failed[0]
            raise RuntimeError(f"{len(failed)} of {len(units)} cases failed; {name}: {reason}")
        return [_value(result) for result in results]
    finally:
        shutil.rmtree(below, ignore_errors=True)


def _value(result: Path) -> Any:
    is_error, value, text = pickle.loads(result.read_bytes())
    if is_error:
        raise value from _Remote(f"\n{text}")
    return value


def unit(file: str, result: str) -> None:
    """Does a unit: the case of a file, and its result in another one, whole or not at all."""
    global _is_unit
    _is_unit = True
    data, call = pickle.loads(Path(file).read_bytes())
    prepare(data)
    try:
        function, case = pickle.loads(call)
        outcome = (False, function(case), "")
        text = pickle.dumps(outcome)
    except Exception as error:
        text = pickle.dumps((True, error, traceback.format_exc()))
    partial = Path(f"{result}.{os.getpid()}.partial")
    partial.write_bytes(text)
    partial.replace(result)
