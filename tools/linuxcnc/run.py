#!/usr/bin/python3
# SPDX-License-Identifier: MIT OR Apache-2.0
"""LinuxCNC's display without a screen: switches the machine on, runs a program, and says how it ended.

    run.py [--estop-at LINE] [--patience S] PROGRAM RESULT.json

The result has the state at the end, messages, and what HAL's pins of the board were."""

import argparse
import json
import subprocess
import sys
import time

import linuxcnc

#: Default time without progress before giving up, in s.
PATIENCE = 60


def pins(*names):
    """The values of the component's pins, as text, by name."""
    return {name: subprocess.run(["halcmd", "getp", f"takt.{name}"], capture_output=True, text=True).stdout.strip() for name in names}


class Machine:
    def __init__(self, patience):
        self.patience = patience
        self.command, self.stat, self.errors = linuxcnc.command(), linuxcnc.stat(), linuxcnc.error_channel()
        self.messages = []

    def poll(self):
        self.stat.poll()
        while True:
            message = self.errors.poll()
            if not message:
                return self.stat
            self.messages.append(message[1].strip())
            print(self.messages[-1], flush=True)

    def until(self, condition, what, state=None):
        """Waits; a state is commanded again and again, because the pulse that resets the emergency stop is short."""
        end, again = time.time() + self.patience, 0
        while not condition(self.poll()):
            if state is not None and time.time() > again:
                self.command.state(state)
                again = time.time() + 2
            if time.time() > end:
                sys.exit(f"{what}: not within {self.patience} s; {'; '.join(self.messages)}")
            time.sleep(0.005)

    def switch_on(self):
        """Out of emergency stop, on, and homed."""
        self.until(lambda s: s.task_state != linuxcnc.STATE_ESTOP, "the emergency stop is not reset", linuxcnc.STATE_ESTOP_RESET)
        self.until(lambda s: s.task_state == linuxcnc.STATE_ON, "the machine does not come on", linuxcnc.STATE_ON)
        self.command.mode(linuxcnc.MODE_MANUAL)
        self.command.wait_complete()
        self.command.home(-1)
        joints = self.stat.joints
        self.until(lambda s: all(s.homed[:joints]), "the joints are not homed")

    def run(self, program, estop_at):
        """Runs a program to its end, or until the machine goes off. What ended it, and in which line."""
        self.command.mode(linuxcnc.MODE_AUTO)
        self.command.wait_complete()
        self.command.program_open(program)
        self.command.auto(linuxcnc.AUTO_RUN, 0)
        self.until(lambda s: s.interp_state != linuxcnc.INTERP_IDLE, "the program does not begin")
        line, since = -1, time.time()
        while True:
            stat = self.poll()
            if stat.task_state != linuxcnc.STATE_ON:
                return ("emergency stop" if stat.task_state == linuxcnc.STATE_ESTOP else "off"), line
            if stat.interp_state == linuxcnc.INTERP_IDLE and stat.inpos:
                return "end", line
            if stat.motion_line not in (line, 0):
                line, since = stat.motion_line, time.time()
            if estop_at and line >= estop_at:
                # Within the move rather than at its beginning.
                time.sleep(0.2)
                self.command.state(linuxcnc.STATE_ESTOP)
                estop_at = None
            if time.time() - since > 10 * self.patience:
                return "no progress", line
            time.sleep(0.005)


def main():
    parser = argparse.ArgumentParser()
    # LinuxCNC passes its configuration to a display before the display's own arguments.
    parser.add_argument("-ini")
    parser.add_argument("--estop-at", type=int)
    parser.add_argument("--patience", type=float, default=PATIENCE)
    parser.add_argument("program")
    parser.add_argument("result")
    arguments = parser.parse_args()
    machine = Machine(arguments.patience)
    time.sleep(0.5)
    machine.switch_on()
    end, line = machine.run(arguments.program, arguments.estop_at)
    # Wait for the last reports of the board.
    time.sleep(0.5)
    stat = machine.poll()
    result = {
        "end": end,
        "line": line,
        "position": list(stat.actual_position)[:6],
        "messages": machine.messages,
        "takt": pins("fault", "fault-code", "driving", "causes", "knot", "period", "starved", "skipped", "misses", "most-cycles"),
    }
    with open(arguments.result, "w") as file:
        json.dump(result, file, indent=1)
    machine.command.state(linuxcnc.STATE_ESTOP)
    machine.command.wait_complete()


main()
