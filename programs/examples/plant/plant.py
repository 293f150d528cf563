#!/usr/bin/env python3
"""A motor, simulated, and `takt run` as its controller: the loop is closed through two pipes.

    python3 plant.py [TAKT] > loop.csv

TAKT is the command, `takt` unless said otherwise. Each period is one row each way: encoder and wanted angle go to the
controller, the current comes back. The exit status is the controller's: 3 if a deadline was missed or a flag raised.
"""

import math
import pathlib
import subprocess
import sys

PERIODS = 600
PERIOD = 1e-3  # s
STEPS = 20  # of the simulation, in a period
TICK = 125_000  # cycles in a period, at 125 MHz
COUNTS = 4096  # of the encoder, in a turn
WANTED = 2.0  # rad


class Motor:
    """Inertia, viscous friction, and dry friction that holds the shaft when it stands."""

    TORQUE = 0.05  # N m/A
    INERTIA = 2e-5  # kg m^2
    VISCOUS = 1e-5  # N m s
    DRY = 2e-3  # N m

    def __init__(self):
        self.angle = 0.0
        self.speed = 0.0

    def run(self, current, time):
        torque = self.TORQUE * current - self.VISCOUS * self.speed
        if self.speed == 0.0 and abs(torque) <= self.DRY:
            return
        forward = self.speed > 0.0 or (self.speed == 0.0 and torque > 0.0)
        torque -= self.DRY if forward else -self.DRY
        speed = self.speed + torque / self.INERTIA * time
        # Dry friction stops the shaft; it does not turn it round.
        self.speed = 0.0 if speed * self.speed < 0.0 else speed
        self.angle += self.speed * time

    def encoder(self):
        return math.floor(self.angle * (COUNTS / math.tau))


def main():
    takt = sys.argv[1] if len(sys.argv) > 1 else "takt"
    program = pathlib.Path(__file__).with_name("servo.s")
    command = [takt, "run", program, "--inputs", "-", "--outputs", "-", "--tick", str(TICK), "--deny", "all"]
    try:
        controller = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    except OSError as error:
        sys.exit(f"cannot run {takt}: {error.strerror}; give its path, as in plant.py target/release/takt")

    def answer():
        row = controller.stdout.readline()
        if not row:
            sys.exit(controller.wait() or "the controller ended early")
        return row.strip().split(",")

    def ask(*fields):
        print(*fields, sep=",", file=controller.stdin, flush=True)  # a row that stays in a buffer has no answer

    names = answer()  # the controller's header comes first
    ask("n", "ref")  # ours: any order, names as in the source
    motor = Motor()
    print("time", "angle", "current", sep=",")
    for period in range(PERIODS):
        ask(motor.encoder(), WANTED)
        current = float(dict(zip(names, answer()))["current"])
        print(period * PERIOD, motor.angle, current, sep=",")
        for _ in range(STEPS):
            motor.run(current, PERIOD / STEPS)
    controller.stdin.close()  # the end of the run
    return controller.wait()


if __name__ == "__main__":
    sys.exit(main())
