"""Progress of work that takes a while: a line in a terminal or a notebook, or calls of a function of the user's."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

#: Seconds before the first message, and between messages.
_QUIET, _EVERY = 1.0, 0.5

#: Callback with the name of the activity and the elapsed seconds.
Listener = Callable[[str, float], None]

_listener: Listener | None = None


def set_progress(listener: Listener | None) -> None:
    """Chooses who hears of building that takes more than a second.

    Args:
        listener: A function of the work, as `building policy.s`, and the seconds so far; it is called every half second, in a thread of
            its own. None: a line on standard error, if that is a terminal or a notebook's.
    """
    global _listener
    _listener = listener


def _is_watched() -> bool:
    """Somebody sees standard error now: a terminal, or a notebook, whose kernel replaces the stream."""
    stream = sys.stderr
    return stream is not None and (type(stream).__module__.startswith("ipykernel") or stream.isatty())


class _Line:
    """A line on standard error that is written again and again, and is gone in the end."""

    def __init__(self) -> None:
        self._length = 0

    def show(self, text: str) -> None:
        # Notebooks support `\r`, but no control sequences that clear a line.
        sys.stderr.write("\r" + text.ljust(self._length))
        sys.stderr.flush()
        self._length = len(text)

    def clear(self) -> None:
        if self._length:
            self.show("")
            sys.stderr.write("\r")
            sys.stderr.flush()


@contextmanager
def progress(what: str) -> Iterator[None]:
    """Says what is being done while the body runs, if it takes a while."""
    listener, line = _listener, _Line()
    if listener is None and not _is_watched():
        yield
        return
    done, begin = threading.Event(), time.monotonic()

    def tell() -> None:
        wait = _QUIET
        while not done.wait(wait):
            wait, seconds = _EVERY, time.monotonic() - begin
            if listener is None:
                line.show(f"{what} … {seconds:.0f} s")
            else:
                listener(what, seconds)

    thread = threading.Thread(target=tell, name="takt-progress", daemon=True)
    thread.start()
    try:
        yield
    finally:
        done.set()
        thread.join()
        line.clear()
