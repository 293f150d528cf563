"""Machines are for one thread at a time: a second thread gets an error that says so."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterator
from typing import Any, TypeVar

T = TypeVar("T")

#: Messages of the extension module when two threads use one object.
_BORROWED = {"Already borrowed", "Already mutably borrowed"}


def exclusive(mend: str) -> Callable[[type[T]], type[T]]:
    """A decorator of classes whose methods and properties are for one thread at a time; `mend` says what a second thread does instead."""

    def decorate(kind: type[T]) -> type[T]:
        def shared(error: RuntimeError) -> RuntimeError | None:
            if str(error) not in _BORROWED:
                return None
            return RuntimeError(f"another thread is using this {kind.__name__}, which is for one thread at a time: {mend}")

        def guarded(method: Callable[..., Any]) -> Callable[..., Any]:
            @functools.wraps(method)
            def call(*args: Any, **more: Any) -> Any:
                try:
                    return method(*args, **more)
                except RuntimeError as error:
                    if told := shared(error):
                        raise told from None
                    raise

            @functools.wraps(method)
            def iterate(*args: Any, **more: Any) -> Iterator[Any]:
                try:
                    yield from method(*args, **more)
                except RuntimeError as error:
                    if told := shared(error):
                        raise told from None
                    raise

            return iterate if inspect.isgeneratorfunction(method) else call

        for name, member in list(vars(kind).items()):
            if isinstance(member, property) and member.fget is not None:
                setattr(kind, name, property(guarded(member.fget), member.fset, member.fdel, member.__doc__))
            elif inspect.isgeneratorfunction(member) or (
                callable(member) and (not name.startswith("_") or name in {"__copy__", "__reduce__", "__repr__"})
            ):
                setattr(kind, name, guarded(member))
        return kind

    return decorate
