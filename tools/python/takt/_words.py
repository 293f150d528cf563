"""Messages of the tools in Python's words: where they name an option or a command of the command line, the argument or method."""

from __future__ import annotations

import re

#: An option, alone or with its command: quoted with or without a value, or bare. Other quoted commands are kept whole.
_OPTION = re.compile(
    r"`(?:takt [a-z]+ )?--(?P<quoted>[a-z][a-z-]*)(?: (?P<value>[^\s`]+))?`"
    r"|`takt live PORT (?P<method>[a-z]+)`"
    r"|`takt [^`]*`"
    r"|(?<![\w`-])--(?P<bare>[a-z][a-z-]*)"
)

#: A source line, as shown in messages.
_SOURCE = re.compile(r"\s*\d+ │")

#: Options that correspond to arguments of the same name.
_ARGUMENTS = {"base", "contract", "effort", "exact", "floating", "include", "inputs", "output", "range", "schedule", "tip"}
#: Options and commands that have a different form in Python.
_OTHERS = {"deadline": "`program.bound()`", "status": "`board.status`"}


def _argument(found: re.Match[str]) -> str:
    name = found["quoted"] or found["bare"] or found["method"]
    if name is None:
        return found[0]
    if name in _OTHERS:
        return _OTHERS[name]
    if found["method"]:
        return f"`board.{name}()`"
    if name == "connect":
        signal, _, port = (found["value"] or "SIGNAL=PORT").partition("=")
        return f'`connect={{"{signal}": "{port}"}}`'
    if name.startswith("no-"):
        return f'`without=["{name[3:]}"]`'
    if name not in _ARGUMENTS:
        return f"`--{name}` on the command line"
    return f'`{name}="{found["value"]}"`' if found["value"] else f"`{name}=`"


def in_python(text: str) -> str:
    """A message with arguments (`tip=`) in the place of options (`--tip`). Lines of sources in it stay as they are."""
    lines = text.split("\n")
    return "\n".join(line if _SOURCE.match(line) else _OPTION.sub(_argument, line) for line in lines)
