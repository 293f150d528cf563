# SPDX-License-Identifier: MIT OR Apache-2.0
"""What runs of LinuxCNC with a board have brought: tables for docs/linuxcnc.md, and a picture.

    report.py FOLDER [--document FILE] [--picture FILE.svg]

FOLDER has a folder for each run of `cargo evidence linuxcnc`: record.txt is LinuxCNC's side, of halsampler (record.hal), sim.csv the
robot's, of `takt board sim --record`, result.json what run.py saw.
"""

import argparse
import json
import re
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

#: Tick in s, and ticks per knot.
TICK, EVERY = 1e-4, 10
STEP = TICK * EVERY
#: LinuxCNC's units, in SI units.
SI = np.array([1e-3, 1e-3, 1e-3, np.pi / 180, np.pi / 180])
JOINTS = ["X", "Y", "Z", "A (tilt)", "C (rotation)"]


@dataclass
class Moves:
    """A G-code program's moves: start and end (m) by line, whether it cuts, and an arc's centre and direction."""

    lines: dict

    @staticmethod
    def read(path):
        lines, at, motion = {}, np.zeros(3), 0
        for number, text in enumerate(path.read_text().splitlines(), 1):
            words = re.findall(r"([A-Z])\s*(-?[\d.]+)", text.split(";")[0].upper())
            for letter, value in words:
                motion = int(float(value)) if letter == "G" and float(value) <= 3 else motion
            values = {letter: float(value) for letter, value in words}
            if not values.keys() & set("XYZAC"):
                continue
            to = np.array([values[axis] * 1e-3 if axis in values else at[i] for i, axis in enumerate("XYZ")])
            centre = at[:2] + 1e-3 * np.array([values.get("I", 0.0), values.get("J", 0.0)])
            lines[number] = (motion, at, to, centre)
            at = to
        return Moves(lines)

    def cuts(self, line):
        return line in self.lines and self.lines[line][0] > 0

    def distance(self, line, points):
        """Distances of points (n, 3) from a move's path, m."""
        motion, start, end, centre = self.lines[line]
        if motion < 2:
            way = end - start
            length = way @ way
            along = np.clip((points - start) @ way / length, 0, 1) if length > 0 else np.zeros(len(points))
            return np.linalg.norm(points - start - along[:, None] * way, axis=1)
        # An arc in the XY plane, with Z linear along it: the angle gives the position along the arc.
        sign = -1 if motion == 2 else 1
        begin = angles(start, centre)
        is_circle = np.linalg.norm((end - start)[:2]) < 1e-9
        sweep = 2 * np.pi if is_circle else sign * (angles(end, centre) - begin) % (2 * np.pi)
        along = sign * (angles(points, centre) - begin) % (2 * np.pi)
        along = np.where(along > (sweep + 2 * np.pi) / 2, along - 2 * np.pi, along) / sweep
        along = np.clip(along, 0, 1)
        radius = np.linalg.norm(start[:2] - centre)
        phi = begin + sign * along * sweep
        nearest = np.stack([centre[0] + radius * np.cos(phi), centre[1] + radius * np.sin(phi), start[2] + along * (end - start)[2]], axis=1)
        return np.linalg.norm(points - nearest, axis=1)


def angles(points, centre):
    """Directions of points (…, 2) seen from a centre, rad."""
    return np.arctan2(points[..., 1] - centre[1], points[..., 0] - centre[0])


class Run:
    """A run: what LinuxCNC commanded, and what the robot did, at the ticks in which the outputs drove."""

    def __init__(self, folder):
        self.result = json.loads((folder / "result.json").read_text())
        self.moves = Moves.read(folder / "program.ngc")
        rows = [line.split() for line in (folder / "record.txt").read_text().splitlines()]
        if any(len(row) != 21 for row in rows):
            raise SystemExit(f"{folder}: halsampler has lost samples")
        rows = np.array(rows, dtype=float)
        # Start from the last start of the board.
        knot = rows[:, 11]
        first = int(np.flatnonzero(knot == 1)[-1])
        rows, knot = rows[first:], knot[first:]
        new = np.flatnonzero(np.diff(knot, prepend=0) > 0)
        assert (knot[new] == np.arange(1, len(new) + 1)).all(), "a knot without a sample"
        self.position, self.velocity = rows[new, 1:6] * SI, rows[new, 6:11] * SI
        self.velocity[0] = 0
        self.line = rows[new, 15].astype(int)
        # Ticks at which the board began a knot: their distance is constant unless it has lost one.
        period, taken, phase = rows[:, 12], rows[:, 13], rows[:, 14]
        moving = (taken > 1) & (period > 0)
        offsets = np.unique(period[moving] - EVERY * taken[moving] - phase[moving])
        self.offsets = offsets
        self.queue = (knot - taken)[moving]
        states = np.genfromtxt(folder / "sim.csv", delimiter=",", names=True)
        self.states = states
        # Last stretch of time in which the outputs drove.
        last = np.flatnonzero(states["drive"])[-1]
        off = np.flatnonzero(states["drive"][:last] == 0)
        driven = np.arange(off[-1] + 1 if len(off) else 0, last + 1)
        self.driven = driven
        self.tool = np.stack([states[axis][driven] for axis in ("x", "y", "z", "alpha", "gamma")], axis=1)
        self.tick = states["tick"][driven]
        # Interpolates between knots at the ticks, as interpolation.s does: u = 0 is knot 1.
        u = (self.tick - offsets[0]) / EVERY - 1
        u = np.clip(u, 1, len(new) - 1.001)
        k = u.astype(int)
        s = (u - k)[:, None]
        p, q, v, w = self.position[k - 1], self.position[k], self.velocity[k - 1] * STEP, self.velocity[k] * STEP
        d = q - p
        self.point = p + s * (v + s * (3 * d - 2 * v - w + s * (v + w - 2 * d)))
        self.at_line = self.line[k]
        self.cutting = np.array([self.moves.cuts(line) for line in range(self.at_line.max() + 1)])[self.at_line]
        self.known = (self.tick - offsets[0]) / EVERY - 1 < len(new) - 1

    def errors(self):
        """Figures of a run that came to its end."""
        known = self.known
        error = (self.tool - self.point)[known]
        tool = np.linalg.norm(error[:, :3], axis=1)
        cutting = self.cutting[known]
        path = np.full(len(tool), np.inf)
        for line in np.unique(self.at_line[known]):
            here = (self.at_line[known] == line) & cutting
            for near in (line - 1, line, line + 1):
                if here.any() and self.moves.cuts(near):
                    path[here] = np.minimum(path[here], self.moves.distance(near, self.tool[known][here, :3]))
        return {
            "seconds": len(self.tick) * TICK,
            "periods": len(self.tick),
            "cutting": tool[cutting].max(),
            "overall": tool.max(),
            "rms": np.sqrt((tool[cutting] ** 2).mean()),
            "path": path[cutting].max(),
            "path rms": np.sqrt((path[cutting] ** 2).mean()),
            "joints": np.abs(error).max(axis=0),
            "joints rms": np.sqrt((error**2).mean(axis=0)),
            "queue": (self.queue.min(), self.queue.max()),
            "lost": len(self.offsets) - 1,
        }

    def ending(self, event):
        """From an event, in driven periods (None: the last command), to safe outputs."""
        states, last = self.states, self.driven[-1]
        begin = self.driven[event - 1] if event else None
        tool = np.stack([states[axis] for axis in "xyz"], axis=1)
        speed = np.linalg.norm(np.diff(tool, axis=0), axis=1) / TICK
        after = states[last + 1 :]
        lit = int(after["pins"][2:].max()) if len(after) > 2 else 1
        return {
            "time": (last - begin) * TICK if event else None,
            "way": np.linalg.norm(tool[last] - tool[begin]) if event else None,
            "speed before": speed[begin - 2] if event else speed[last - 2],
            "speed": speed[last - 1],
            "pins": lit,
            "rows": len(after),
            "message": next(iter(self.result["messages"]), ""),
            "line": self.result["line"],
            "end": self.result["end"],
        }


def cut_table(runs):
    head = "| | " + " | ".join(name for name, _ in runs) + " |\n|---|" + "---|" * len(runs)
    figures = [run.errors() for _, run in runs]
    um = lambda key: [f"{f[key] * 1e6:.2f}" for f in figures]
    rows = [
        ("time on the board, s (periods of 100 µs)", [f"{f['seconds']:.2f} ({f['periods']})" for f in figures]),
        ("tool from LinuxCNC's point of the same instant, while cutting, µm: largest", um("cutting")),
        ("rms", um("rms")),
        ("largest, with positioning", um("overall")),
        ("tool from the programmed path, while cutting, µm: largest", um("path")),
        ("rms", um("path rms")),
    ]
    for i, joint in enumerate(JOINTS):
        unit, scale = ("µm", 1e6) if i < 3 else ("µrad", 1e6)
        rows.append((f"following error of {joint}, {unit}: largest (rms)", [f"{f['joints'][i] * scale:.2f} ({f['joints rms'][i] * scale:.2f})" for f in figures]))
    takt = [run.result["takt"] for _, run in runs]
    rows += [
        ("deadlines missed on the board", [t["misses"] for t in takt]),
        ("knots missing on the board (`starved`); periods out of step", [f"{t['starved']}; {f['lost']}" for t, f in zip(takt, figures)]),
        ("frames of the board missing in LinuxCNC (`skipped`)", [t["skipped"] for t in takt]),
        ("knots on their way or waiting", [f"{int(f['queue'][0])} to {int(f['queue'][1])}" for f in figures]),
    ]
    return "\n".join([head, *(f"| {name} | " + " | ".join(values) + " |" for name, values in rows)])


def end_table(runs):
    rows = ["| event | time to safe outputs, ms | way, mm | speed before, and when outputs became safe, mm/s | motor pins then | LinuxCNC |", "|---|---|---|---|---|---|"]
    for name, run, event in runs:
        e = run.ending(event)
        number = lambda value, scale, digits: "–" if value is None else f"{value * scale:.{digits}f}"
        pins = f"0 in all {e['rows'] - 2} periods recorded" if e["pins"] == 0 else "**not 0**"
        message = e["message"].split("; outputs")[0] or "emergency stop"
        rows.append(
            f"| {name}, line {e['line']} | {number(e['time'], 1e3, 1)} | {number(e['way'], 1e3, 3)} | "
            f"{e['speed before'] * 1e3:.1f}, {e['speed'] * 1e3:.1f} | {pins} | {e['end']}: “{message}” |"
        )
    return "\n".join(rows)


def fill(file, name, text):
    old = file.read_text()
    place = rf"(<!-- table: {name} -->\n).*?(<!-- end of {name} -->)"
    new, count = re.subn(place, lambda found: f"{found[1]}{text}\n{found[2]}", old, flags=re.S)
    if count != 1:
        raise SystemExit(f"{file} has no place for the table `{name}`")
    file.write_text(new)


#: Magnification of the tool's deviation in the picture.
MAGNIFIED = 500


def curves(run, cut, event):
    """Curves of the picture: x and y of each."""
    some = slice(None, None, 40)
    point, off = run.point[some] * 1e3, (run.tool - run.point)[some] * 1e3
    cuts = run.cutting[some][:, None]
    distance = np.linalg.norm((run.tool - run.point)[:, :3], axis=1) * 1e6
    # Plot the largest of every 100 periods, so that no peak is lost.
    whole = len(distance) // 100 * 100
    states = cut.states
    begin = cut.driven[event - 1]
    window = slice(begin - 100, begin + 400)
    position = np.stack([states[axis][window] for axis in "xyz"], axis=1)
    speed = np.linalg.norm(np.diff(position, axis=0), axis=1) / TICK * 1e3
    time = (np.arange(len(speed)) - 100) * TICK * 1e3
    return {
        "path": np.where(cuts, point, np.nan)[:, :2].T, "way": point[:, :2].T, "tool": np.where(cuts, point + MAGNIFIED * off, np.nan)[:, :2].T,
        "error": ((run.tick * TICK)[:whole:100], distance[:whole].reshape(-1, 100).max(axis=1)),
        "speed": (time, speed), "drive": (time, states["drive"][window][1:] * 10),
    }


def draw(file, curves):
    sys.path.insert(0, str(Path(__file__).parents[1] / "python/examples"))
    import pictures

    # Grid lines would go through the words.
    blank = {"frameon": True, "facecolor": "white", "edgecolor": "none", "framealpha": 1, "fancybox": False}
    figure, (left, top, below) = pictures.subplots(3, 7.4, height_ratios=[1.6, 1, 1])
    left.plot(*curves["path"], color="0.6", lw=3, solid_capstyle="round", label="LinuxCNC's path, where it cuts")
    left.plot(*curves["way"], color="0.8", lw=0.5)
    left.plot(*curves["tool"], color="C1", lw=0.8, label=f"the tool, its deviation {MAGNIFIED} times as large")
    left.set(aspect="equal", ylim=(-46, 86), xlabel="x, mm (y upwards)", title="agh.ngc, planned by LinuxCNC, cut by the hybrid robot")
    left.legend(loc="upper left", **blank)
    seconds, peaks = curves["error"]
    top.plot(seconds, peaks, color="C1", lw=0.5)
    top.set(xlabel="time on the board, s", title="distance of the tool from LinuxCNC's point, µm", xlim=(0, seconds[-1]), ylim=(0, None))
    time, speed = curves["speed"]
    below.plot(time, speed, color="C0", label="speed of the tool, mm/s")
    below.step(*curves["drive"], color="C2", label="outputs drive (10) or are safe (0)")
    below.axvline(0, color="0.5", ls=":")
    below.set(xlabel="time after the link was cut, ms", xlim=(time[0], time[-1]), ylim=(0, 1.6 * speed.max()), title="the link is cut in mid-cut: the board brakes, and is safe")
    below.legend(loc="upper right", **blank)
    pictures.save(figure, file)


#: Limits: tool error in m, required by the founding paper; time from an event to safe outputs in s, which is `host` in
#: followed_board.toml plus a tick.
ERROR, SAFE = 10e-6, 30.2e-3


def wrong(name, run, wanted):
    """What is not as it should be in a run, in words."""
    if wanted["kind"] == "cut":
        figures, takt = run.errors(), run.result["takt"]
        checks = {
            f"LinuxCNC's end is {run.result['end']!r}: {run.result['messages']}": run.result["end"] == "end",
            f"the tool is {figures['overall'] * 1e6:.2f} µm off": figures["overall"] < ERROR,
            f"the tool is {figures['path'] * 1e6:.2f} µm off the programmed path": figures["path"] < ERROR,
            f"hal_takt says {takt}": all(takt[pin] == "0" for pin in ("fault-code", "starved", "skipped", "misses")),
            f"periods are out of step by {run.offsets}": figures["lost"] == 0,
            # Every tick from the first to the last must be recorded.
            "ticks are missing": (np.diff(run.tick) == 1).all(),
        }
    else:
        ending = run.ending(wanted["event"])
        checks = {
            f"LinuxCNC says {run.result['messages']}": wanted["says"] in " ".join(run.result["messages"]),
            f"LinuxCNC's end is {ending['end']!r}": ending["end"] != "end",
            f"a motor's pin is 1, or {ending['rows']} periods after it are few": ending["pins"] == 0 and ending["rows"] >= 50,
            f"outputs are safe after {ending['time']} s": ending["time"] is None or ending["time"] <= SAFE,
        }
    return [f"{name}: {text}" for text, holds in checks.items() if not holds]


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path)
    parser.add_argument("--document", type=Path)
    parser.add_argument("--picture", type=Path)
    arguments = parser.parse_args()
    folder = arguments.folder
    names = {run["name"]: run for run in json.loads((folder / "runs.json").read_text())}
    runs = {name: Run(folder / name) for name in names}
    cuts = [(names[name]["title"], run) for name, run in runs.items() if names[name]["kind"] == "cut"]
    ends = [(names[name]["title"], run, names[name].get("event")) for name, run in runs.items() if names[name]["kind"] == "end"]
    tables = {"cuts": cut_table(cuts) if cuts else "", "ends": end_table(ends) if ends else ""}
    for name, table in tables.items():
        if table:
            print(table + "\n")
        if arguments.document and table:
            fill(arguments.document, f"linuxcnc {name}", table)
    mistakes = [text for name, run in runs.items() for text in wrong(name, run, names[name])]
    if mistakes:
        raise SystemExit("\n".join(mistakes))
    if arguments.picture:
        cut = runs["unplugged"]
        draw(arguments.picture, curves(runs["path"], cut, names["unplugged"]["event"]))


main()
