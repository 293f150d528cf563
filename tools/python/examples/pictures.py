# SPDX-License-Identifier: MIT OR Apache-2.0
"""Figures of matplotlib as small SVG files that are the same in every run.

    python3 tools/python/examples/pictures.py FILE.svg ...       shrink files that matplotlib wrote
"""

from __future__ import annotations

import io
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np

#: Width in inches and size of the type in points: on a telephone, 390 pixels wide, the type keeps seven eighths of its size.
WIDTH, TYPE = 4.6, 8.5
#: Style of all figures, with the colours of the playground's plots (`COLOURS` in tools/web/page/src/parts.js).
STYLE: dict[Any, Any] = {
    "font.size": TYPE, "axes.titlesize": TYPE, "axes.titlelocation": "left", "legend.fontsize": TYPE, "legend.frameon": False, "legend.handlelength": 1.4,
    "axes.spines.top": False, "axes.spines.right": False, "axes.edgecolor": "0.6", "axes.grid": True, "grid.color": "0.88", "grid.linewidth": 0.6,
    "lines.linewidth": 1.2,
}
COLOURS = ["#2f6fbf", "#d9534f", "#5aa469", "#b07cd8", "#d98a1f", "#26a0a8", "#a3156b", "#8d6e63"]

#: Decimal places of coordinates, in points: a twentieth of a point is smaller than a pixel.
DIGITS = 1


def number(text: str) -> str:
    return f"{round(float(text), DIGITS) + 0.0:g}"


def path(found: re.Match[str]) -> str:
    """Path data with rounded coordinates; points that rounding makes equal are one, and the letter of repeated lines is left out."""
    parts: list[str] = []
    last = ""
    for letter, numbers in re.findall(r"([A-Za-z])([^A-Za-z]*)", found[1]):
        step = letter + " ".join(number(text) for text in numbers.split())
        if letter == "L" and last in ("M", "L"):
            step = " " + step[1:]
            if parts[-1].lstrip("M ") == step[1:]:
                continue
        parts.append(step)
        last = letter
    return f'd="{"".join(parts)}"'


def shrink(svg: str) -> str:
    """The same picture: without description, comments and invisible digits, and with one line for each named group."""
    svg = re.sub(r"<!--.*?-->|<metadata>.*?</metadata>|<!DOCTYPE.*?>", "", svg, flags=re.S)
    svg = re.sub(r'\bd="([^"]*)"', path, svg)
    svg = re.sub(r'\b([xy])="([-\d.e]+)"', lambda found: f'{found[1]}="{number(found[2])}"', svg)
    svg = re.sub(r"translate\(([-\d.e]+)[ ,]+([-\d.e]+)\)", lambda found: f"translate({number(found[1])} {number(found[2])})", svg)
    return re.sub(r">\s+<", "><", svg).replace("<g id=", "\n<g id=").strip() + "\n"


def subplots(rows: int, height: float, **options: Any) -> tuple[Any, Any]:
    """A figure with axes below one another, `height` inches tall. Titles say the quantity: beside the axis they would take its width."""
    import matplotlib.pyplot as plt
    from cycler import cycler

    plt.rcParams.update({**STYLE, "axes.prop_cycle": cycler("color", COLOURS)})
    return plt.subplots(rows, 1, figsize=(WIDTH, height), layout="constrained", **options)


def compare(file: str, times: Any, cases: dict[str, tuple[Any, ...]], quantities: dict[str, str], limits: dict[int, tuple[float, float]] | None = None) -> None:
    """Draws each quantity of the first case, and below it how far the others are from it: their own curves would lie over one another.

    A case has an array for each quantity, which is named with its unit; `limits` are those of differences that begin with a peak.
    """
    figure, axes = subplots(2 * len(quantities), 3.1 * len(quantities), sharex=True)
    (first, base), *others = cases.items()
    for row, (quantity, unit) in enumerate(quantities.items()):
        axes[2 * row].plot(times, base[row], label=first)
        axes[2 * row].set_title(f"{quantity}, {unit}")
        for colour, (name, curves) in enumerate(others, 1):
            axes[2 * row + 1].plot(times, curves[row] - base[row], color=f"C{colour}", label=name, lw=0.9)
        axes[2 * row + 1].set(title=f"difference from {first}, {unit}", ylim=(limits or {}).get(row))
    axes[-1].set(xlabel="time, s", xlim=(0, times[-1]))
    legend(figure, axes[:2], 2)
    save(figure, file)


def legend(figure: Any, axes: Any, columns: int) -> None:
    """One legend for all axes, below them, where it covers no curve. It names the lines of `axes`, which may be an array."""
    lines = [line for axis in np.atleast_1d(axes) for line in axis.get_lines()]
    figure.legend(lines, [line.get_label() for line in lines], loc="outside lower left", ncols=columns)


# On a dark page the picture is negative, with its hues.
DARK = "<style>@media (prefers-color-scheme:dark){svg:root{filter:invert(.9) hue-rotate(180deg)}}</style>"


def save(figure: Any, file: str | Path) -> None:
    """Writes a figure as SVG."""
    import matplotlib

    text = io.StringIO()
    with matplotlib.rc_context({"svg.hashsalt": "takt"}):
        figure.savefig(text, format="svg", metadata={"Date": None})
    Path(file).write_text(shrink(text.getvalue()).replace("<defs>", DARK + "<defs>", 1))


if __name__ == "__main__":
    for name in sys.argv[1:]:
        Path(name).write_text(shrink(Path(name).read_text()))
