"""`programs/servo`: one axis and six, each in closed loop with a motor that shares nothing with the program."""

from pathlib import Path

import numpy as np
import pytest

import takt

FOLDER = Path(__file__).parents[3] / "programs" / "servo"
PAIRS, R, LD, LQ, PSI, J = 4, 0.35, 0.9e-3, 1.1e-3, 0.012, 6e-5
#: Period in s, and encoder counts per turn.
T, COUNTS = 1e-5, 2**17
OVERCURRENT, VOLTAGE, FOLLOWING, ENCODER = 1, 2, 4, 8


class Motor:
    """Synchronous motor on an averaged bridge; a bridge that is off carries no current."""

    def __init__(self):
        self.d = self.q = self.speed = self.angle = 0.0

    def step(self, duties, drive, load=0.0, udc=48.0, parts=4):
        a, b, c = (duty * udc for duty in duties)
        u = (2 * a - b - c) / 3 + 1j * (b - c) / np.sqrt(3)
        for _ in range(parts):
            rotor = u * np.exp(-1j * PAIRS * self.angle) if drive else 0
            w = PAIRS * self.speed
            slope = (rotor.real - R * self.d + w * LQ * self.q) / LD if drive else 0
            rise = (rotor.imag - R * self.q - w * (LD * self.d + PSI)) / LQ if drive else 0
            torque = 1.5 * PAIRS * (PSI + (LD - LQ) * self.d) * self.q
            self.d, self.q = (self.d + T / parts * slope, self.q + T / parts * rise) if drive else (0.0, 0.0)
            self.speed += T / parts * (torque - load - 1e-4 * self.speed) / J
            self.angle += T / parts * self.speed

    def currents(self):
        i = (self.d + 1j * self.q) * np.exp(1j * PAIRS * self.angle)
        return i.real, (i * np.exp(-2j * np.pi / 3)).real

    def turns(self):
        return self.angle / (2 * np.pi)

    def count(self):
        return int(np.floor(self.turns() * COUNTS))


def program(name, machine):
    source = (FOLDER / name).read_text()
    return takt.assemble(source, machine=machine, name=name, folder=FOLDER, warnings=["error"])


def closed_loop(machine, periods, **inputs):
    """Runs `servo.s` with a motor; an input is a value or a function of period and motor. A row for each period, by name."""
    sim, motor, rows = program("servo.s", machine).sim(), Motor(), []
    values = {"error": 0, "udc": 48.0, "enable": 1, "home": 0, "at_switch": 0, "goal": 1.0, "id_ref": 0.0, "load": 0.0}
    duties, drive = (0.5, 0.5, 0.5), 0
    for period in range(periods):
        now = {name: value(period, motor) if callable(value) else value for name, value in (values | inputs).items()}
        load = now.pop("load")
        ia, ib = motor.currents()
        measured = {"ia": ia, "ib": ib, "count": motor.count()} | now
        outputs = sim.step(measured)
        # Duties computed in a period act in the next one.
        motor.step(duties, drive, load)
        duties, drive = (outputs["da"], outputs["db"], outputs["dc"]), outputs["drive"]
        rows.append(outputs | {"turns": motor.turns(), "d": motor.d, "q": motor.q, "ia": ia, "speed": motor.speed / (2 * np.pi)})
    return {name: np.array([row[name] for row in rows], dtype=float) for name in rows[0]}


@pytest.mark.parametrize("machine", [str(FOLDER / "small.toml"), "t3", "t4"])
def test_an_axis_goes_to_its_goal_and_holds_it_against_a_load(machine):
    run = closed_loop(machine, 12_000, load=lambda period, _: 0.05 if 7000 <= period < 10_000 else 0.0)
    assert (run["faults"] == 0).all() and (run["mode"][20:] == 2).all()
    assert np.abs(run["d"]).max() < 0.5 and np.abs(run["q"]).max() < 20
    assert run["speed"].max() == pytest.approx(40, abs=2)
    assert run["turns"][6900] == pytest.approx(1, abs=1e-3)
    # A load of 0.05 N·m displaces the axis by less than 2 mrev, and the current matches the torque.
    assert np.abs(run["turns"][6900:] - 1).max() < 2e-3
    assert run["q"][9900] == pytest.approx(0.05 / (1.5 * PAIRS * PSI), rel=0.03)
    assert np.abs(run["position"][100:] - run["turns"][99:-1]).max() < 5e-3


def test_homing_finds_the_switch_and_goals_count_from_it():
    switch = -0.02
    run = closed_loop(
        "t3", 16_000, home=1, goal=0.25, at_switch=lambda _, motor: int(motor.turns() <= switch)
    )
    assert (run["faults"] == 0).all()
    assert run["mode"][500] == 1 and run["mode"][-1] == 2
    assert run["turns"].min() > switch - 0.01, "it turns round at the switch"
    assert run["turns"][-1] == pytest.approx(switch + 0.25, abs=2e-3)
    assert run["position"][-1] == pytest.approx(0.25, abs=2e-3)


@pytest.mark.parametrize(
    ("fault", "inputs"),
    [
        (ENCODER, {"error": lambda period, _: int(period == 3000)}),
        (VOLTAGE, {"udc": lambda period, _: 12.0 if period == 3000 else 48.0}),
        (VOLTAGE, {"udc": lambda period, _: 60.0 if period == 3000 else 48.0}),
        (FOLLOWING, {"load": lambda period, _: 3.0 if period >= 3000 else 0.0}),
    ],
)
def test_a_fault_is_latched_and_ends_when_the_drive_is_disabled(fault, inputs):
    run = closed_loop("t3", 14_000, enable=lambda period, _: int(not 6000 <= period < 6100), **inputs)
    first = int(np.flatnonzero(run["faults"])[0])
    assert first >= 3000 and (run["drive"][20:first] == 1).all()
    assert (run["faults"][first:6000] == fault).all(), "latched"
    assert (run["drive"][first + 1 : 6000] == 0).all() and (run["current"][first + 20 : 6000] == 0).all()
    assert run["mode"][5999] == 3 and run["faults"][6050] == 0
    if fault != FOLLOWING:
        assert run["drive"][6200] == 1 and run["turns"][-1] == pytest.approx(1, abs=1e-2)


def test_an_overcurrent_switches_the_bridge_off_in_its_period():
    sim = program("servo.s", "t3").sim()
    rest = {"error": 0, "udc": 48.0, "enable": 1, "home": 0, "at_switch": 0, "goal": 0.0, "id_ref": 0.0, "count": 0}
    for _ in range(30):
        outputs = sim.step(rest | {"ia": 0.0, "ib": 0.0})
    assert outputs["drive"] == 1
    # The third phase current is the negative sum of the other two, and exceeds the limit.
    outputs = sim.step(rest | {"ia": 16.0, "ib": 16.0})
    assert (outputs["drive"], outputs["faults"]) == (0, OVERCURRENT)


@pytest.mark.parametrize("machine", ["t1", "t3", "t4"])
def test_six_axes_do_what_one_axis_does(machine):
    sim, motors = program("six.s", machine).sim(), [Motor() for _ in range(6)]
    goals = [0.1, -0.2, 0.05, 0.3, -0.02, 0.15]
    bridges = [((0.5, 0.5, 0.5), 0)] * 6
    turns = []
    for period in range(5000):
        currents = [motor.currents() for motor in motors]
        inputs = {f"ia[{i + 1}]": currents[i][0] for i in range(6)} | {f"ib[{i + 1}]": currents[i][1] for i in range(6)}
        inputs |= {f"count[{i + 1}]": motors[i].count() for i in range(6)} | {f"goal[{i + 1}]": goals[i] for i in range(6)}
        # The fourth encoder reports an error after its axis has arrived.
        outputs = sim.step(inputs | {"udc": 48.0, "error": (period == 4000) << 3, "enable": 0b111111})
        for motor, (duties, drive) in zip(motors, bridges):
            motor.step(duties, drive)
        bridges = [
            (tuple(outputs[f"d{phase}[{i + 1}]"] for phase in "abc"), outputs["drive"] >> i & 1) for i in range(6)
        ]
        turns.append([motor.turns() for motor in motors])
    assert outputs["drive"] == 0b110111
    assert [outputs[f"faults[{i + 1}]"] for i in range(6)] == [0, 0, 0, ENCODER, 0, 0]
    assert turns[3999] == pytest.approx(goals, abs=2e-3)
    # Compared with a single axis: the same goal gives the same path. Its motion loop begins in another period of ten.
    alone = closed_loop(machine, 4000, goal=goals[1])["turns"]
    assert np.abs(np.array(turns)[:3999, 1] - alone[:3999]).max() < 2e-3


def test_the_loop_does_with_motulator_s_drive_what_it_does_with_ours():
    """Another maker's motor, bridge and carrier: switched, not averaged, and solved by SciPy."""
    from motulator.drive import model, utils

    machine = model.SynchronousMachine(
        utils.SynchronousMachinePars(n_p=PAIRS, R_s=R, L_d=LD, L_q=LQ, psi_f=PSI)
    )
    plant = model.Drive(
        model.VoltageSourceConverter(u_dc=48.0), machine, model.StiffMechanicalSystem(J=J, B_L=1e-4)
    )
    plant.pwm = model.CarrierComparison()
    sim, seen, turns = program("servo.s", "t3").sim(), [], [0.0]
    rest = {"error": 0, "udc": 48.0, "enable": 1, "home": 0, "at_switch": 0, "goal": 0.1, "id_ref": 0.0}

    class Control:
        def __call__(self, plant):
            ia, ib, _ = plant.machine.meas_currents()
            angle = plant.mechanics.meas_position() / (2 * np.pi)
            turns.append(angle + np.rint(turns[-1] - angle))
            outputs = sim.step(rest | {"ia": ia, "ib": ib, "count": int(np.floor(turns[-1] * COUNTS))})
            seen.append((turns[-1], outputs["drive"], plant.machine.i_s))
            duties = [outputs["da"], outputs["db"], outputs["dc"]]
            return T, np.array(duties if outputs["drive"] else [0.5] * 3)

        def post_process(self):
            pass

    model.Simulation(plant, Control()).simulate(t_stop=0.02)
    ours = closed_loop("t3", 1900, goal=0.1)
    theirs = np.array([turn for turn, _, _ in seen])
    assert np.abs(theirs[1:1900] - ours["turns"][:1899]).max() < 1e-3
    assert abs(seen[-1][2]) < 20 and seen[-1][1] == 1
