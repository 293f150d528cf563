# SPDX-License-Identifier: MIT OR Apache-2.0
"""`takt run --plant` and `takt.Plant`: closed loops against SciPy's integrator and motulator's machine and inverter, tables fed back, FMUs of others."""

import copy
import csv
import json
import os
import pickle
import subprocess
import sysconfig
import zipfile
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import takt as package

TOOL = Path("target/release/takt").absolute()
EXAMPLES = Path("programs/examples")
PLANTS = EXAMPLES / "plant"
pytestmark = pytest.mark.skipif(not TOOL.exists(), reason="target/release has no takt")


def takt(*arguments, status=0, env=None):
    ran = subprocess.run([TOOL, "run", *map(str, arguments)], capture_output=True, text=True, timeout=120, env=env)
    assert ran.returncode == status, ran.stderr
    return ran


def table(*arguments, env=None):
    """Columns of a closed loop's table, by name."""
    rows = list(csv.DictReader(takt(*arguments, "--outputs", "-", env=env).stdout.splitlines()))
    # Ports are printed as the shortest decimals of binary32, states as those of binary64.
    exact = lambda name, text: float(text) if "." in name else float(np.float32(text))
    return {name: np.array([exact(name, row[name]) for row in rows]) for name in rows[0]}


def follows(columns, derivative, states, period, takes, tolerance):
    """The plant's motion in each period, from the state before, against SciPy's under the same output of the program."""
    rows = np.array([columns[name] for name in states]).T
    scale = np.abs(rows).max(axis=0) + 1e-12
    worst = 0.0
    for at in range(len(rows) - 1):
        held = [columns[name][at] for name in takes]
        solved = solve_ivp(lambda _, x: derivative(at * period, x, *held), (0, period), rows[at], rtol=1e-11, atol=1e-13)
        worst = max(worst, (np.abs(rows[at + 1] - solved.y[:, -1]) / scale).max())
    assert worst < tolerance, worst


def test_a_dc_motor_moves_as_scipy_says():
    columns = table(EXAMPLES / "pi.s", "--plant", PLANTS / "dc_motor.toml", "--periods", 400)
    R, L, K, J, B = 1.0, 1e-3, 0.08, 7e-4, 1e-4

    def motor(time, x, u):
        load = 0.4 if time >= 0.1 - 1e-12 else 0.0
        return [(u - R * x[0] - K * x[1]) / L, (K * x[0] - B * x[1] - load) / J, x[1]]

    follows(columns, motor, ["dc_motor.i", "dc_motor.w", "dc_motor.angle"], 1e-3, ["u"], 1e-7)
    # The sensor is the state, as binary32.
    assert (columns["w"].astype(np.float32) == columns["dc_motor.w"].astype(np.float32)).all()
    assert (columns["w_ref"][:200] == 100).all() and (columns["w_ref"][200:] == -100).all()
    assert abs(columns["w"][99] - 100) < 3 and abs(columns["w"][199] - 100) < 3 and abs(columns["w"][-1] + 100) < 3


def test_a_pendulum_stays_upright_as_scipy_says():
    columns = table(EXAMPLES / "pendulum.s", "--plant", PLANTS / "cart_pendulum.toml", "--periods", 2500)
    M, m, l, b, c, g = 0.5, 0.2, 0.3, 0.1, 1e-3, 9.80665

    def pendulum(time, x, force):
        # Lagrange's equations as a linear system for both accelerations.
        _, v, angle, rate = x
        force += 2.0 if 2.0 - 1e-12 <= time < 2.1 - 1e-12 else 0.0
        sine, cosine = np.sin(angle), np.cos(angle)
        mass = np.array([[M + m, m * l * cosine], [m * l * cosine, m * l * l]])
        right = np.array([force - b * v + m * l * rate * rate * sine, m * g * l * sine - c * rate])
        acceleration, turning = np.linalg.solve(mass, right)
        return [v, acceleration, rate, turning]

    names = [f"cart_pendulum.{name}" for name in ("x", "v", "angle", "rate")]
    follows(columns, pendulum, names, 1e-3, ["force"], 1e-10)
    assert np.abs(columns["angle"][1900:2000]).max() < 0.02 < np.abs(columns["angle"][2000:2200]).max() < 0.3


def motulator_machine(parameters, rotor):
    """motulator's synchronous machine, whose states are flux linkages in its rotor's axes."""
    from motulator.drive import model, utils

    pars = utils.SynchronousMachinePars(n_p=parameters["p"], R_s=parameters["R"], L_d=parameters["Ld"], L_q=parameters["Lq"], psi_f=parameters["psi"])
    return model.SynchronousMachine(pars)


@pytest.mark.parametrize("model", ["pmsm", "pmsm_switched"])
def test_a_synchronous_motor_moves_as_motulator_s(tmp_path, model):
    text = (PLANTS / "pmsm.toml").read_text().replace('model = "pmsm" ', f'model = "{model}" ').replace("0.5 us", "0 s")
    file = tmp_path / "pmsm.toml"
    file.write_text(text)
    periods, T, udc = 400, 50e-6, 24.0
    columns = table(EXAMPLES / "foc.s", "--plant", file, "--periods", periods)
    p, J, B = 4, 2e-5, 1e-5
    machine = motulator_machine({"p": p, "R": 0.35, "Ld": 0.9e-3, "Lq": 1.1e-3, "psi": 12e-3}, None)
    d = np.stack([columns[name] for name in ("da", "db", "dc")], axis=1)

    def levels(time, duty):
        """Legs at a time in the period: mean, or the upper switch's pulse in the middle."""
        if model == "pmsm":
            return duty
        return (np.abs(time - T / 2) < duty * T / 2).astype(float)

    def motion(time, x, voltage, load):
        psi_d, psi_q, speed, angle = x
        turn = np.exp(1j * p * angle)
        inp, state = machine.inp, machine.state
        state.psi_s = (psi_d + 1j * psi_q) * 1.0
        state.exp_j_theta_m = turn
        inp.u_ss, inp.w_M = voltage, speed
        out = machine.out
        machine.set_outputs(time)
        rhs = machine.rhs()
        rate = rhs[0]
        return [rate.real, rate.imag, (out.tau_M - B * speed - load) / J, speed]

    x = np.array([12e-3, 0.0, 0.0, 0.0])
    worst = 0.0
    for at in range(periods - 1):
        time = at * T
        load = 0.2 if time >= 0.008 - 1e-12 else 0.0
        edges = [0.0, T] if model == "pmsm" else sorted({0.0, T, *(T / 2 * (1 - d[at])), *(T / 2 * (1 + d[at]))})
        for begin, end in zip(edges, edges[1:]):
            if end <= begin:
                continue
            legs = levels((begin + end) / 2, d[at]) * udc
            voltage = 2 / 3 * (legs[0] + legs[1] * np.exp(2j * np.pi / 3) + legs[2] * np.exp(-2j * np.pi / 3))
            x = solve_ivp(motion, (begin, end), x, args=(voltage, load), rtol=1e-10, atol=1e-13).y[:, -1]
        expected = np.array([(x[0] - 12e-3) / 0.9e-3, x[1] / 1.1e-3, x[2]])
        found = np.array([columns[f"{model}.{name}"][at + 1] for name in ("id", "iq", "w")])
        worst = max(worst, np.abs(found - expected).max())
    assert worst < 2e-4, worst
    assert abs(columns["iq"][150:190].mean() - 5) < 0.3 and abs(columns["iq"][-40:].mean() + 5) < 0.3


@pytest.mark.parametrize(("program", "plant", "periods"), [
    ("pi.s", "dc_motor", 400), ("foc.s", "pmsm", 400), ("pi.s", "tank", 600), ("plant/servo.s", "servo", 600), ("pendulum.s", "cart_pendulum", 500),
])
def test_a_table_fed_back_gives_the_same_outputs(tmp_path, program, plant, periods):
    """The plant sees only outputs: its table, as recorded inputs, gives them again; the loop is the same a second time."""
    file = tmp_path / "loop.csv"
    arguments = [EXAMPLES / program, "--plant", PLANTS / f"{plant}.toml", "--periods", periods]
    takt(*arguments, "--outputs", file)
    again = takt(*arguments, "--outputs", "-").stdout
    assert again == file.read_text()
    replayed = takt(EXAMPLES / program, "--inputs", file, "--outputs", "-").stdout
    rows, replay = list(csv.DictReader(again.splitlines())), list(csv.DictReader(replayed.splitlines()))
    assert len(rows) == len(replay) == periods
    assert all(row[name] == other[name] for row, other in zip(rows, replay) for name in other)


def test_columns_of_a_table_come_before_the_file_s_values(tmp_path):
    file = tmp_path / "in.csv"
    file.write_text("w_ref,w\n" + "50,999\n" * 200)
    columns = table(EXAMPLES / "pi.s", "--plant", PLANTS / "dc_motor.toml", "--inputs", file)
    assert (columns["w_ref"] == 50).all() and columns["w"].max() < 100 and len(columns["w"]) == 200


def test_results_and_pictures(tmp_path):
    picture = tmp_path / "loop.svg"
    ran = takt(EXAMPLES / "pi.s", "--plant", PLANTS / "dc_motor.toml", "--periods", 50, "--plot", picture, "--json")
    told = json.loads(ran.stdout)
    assert told["plant"]["name"] == "dc_motor" and set(told["plant"]["states"]) == {"i", "w", "angle"}
    svg = picture.read_text()
    assert svg.startswith("<svg") and all(title in svg for title in ("w_ref", "dc_motor.i", "time, ms"))


@pytest.mark.parametrize(("arguments", "status", "message"), [
    (["--plant", "none.toml", "--periods", 3], 1, "cannot open none.toml"),
    (["--plant", PLANTS / "plant.py", "--periods", 3], 2, "expected a file `….toml` or `….fmu`"),
    (["--plant", PLANTS / "dc_motor.toml"], 2, "give --periods or --inputs"),
    (["--plant", PLANTS / "pmsm.toml", "--periods", 3], 1, "takes `da`, and the program has no output port of that name"),
    (["--plant", PLANTS / "dc_motor.toml", "--periods", 3, "--connect", "w"], 2, "expected SIGNAL=PORT"),
    (["--plant", PLANTS / "dc_motor.toml", "--periods", 3, "--connect", "w=speed"], 1, "no input port `speed`"),
    (["--plant", PLANTS / "dc_motor.toml", "--periods", 3, "--period", "5"], 2, "expected a unit"),
    (["--connect", "w=w", "--periods", 3], 2, "--plant"),
    (["--plant", EXAMPLES / "board/drive.toml", "--periods", 3], 1, "a plant's file has no key `board`"),
])
def test_mistakes_are_named(arguments, status, message):
    ran = takt(EXAMPLES / "pi.s", *arguments, status=status)
    assert message in ran.stderr and ran.stdout == "", ran.stderr


def test_a_plant_that_diverges_keeps_the_rows_before(tmp_path):
    law = tmp_path / "law.s"
    law.write_text(".const T = 1e-3 ; s\n.input w\n.output u\n.state n\n.once\n mov n, zero\n mov u, zero\n wait p\n.period\np: n = n + 1\n u = 1 / max(5 - n, 0)\n wait p\n")
    file = tmp_path / "loop.csv"
    ran = takt(law, "--plant", PLANTS / "dc_motor.toml", "--periods", 50, "--outputs", file, status=1)
    assert "no input port `w_ref`" in ran.stderr
    plant = tmp_path / "motor.toml"
    plant.write_text('model = "dc_motor"\n')
    ran = takt(law, "--plant", plant, "--periods", 50, "--outputs", file, status=1)
    assert "period 4: the plant `dc_motor` diverged: i is" in ran.stderr and "its input u was inf" in ran.stderr, ran.stderr
    assert len(file.read_text().splitlines()) == 6


# A motor in C, as another maker would write it: FMI 2.0 without any of Takt's code. `mode` makes it fail in its tenth step.
MOTOR_C = r"""
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
typedef void (*logger)(void *, const char *, int, const char *, const char *, ...);
typedef struct { logger log; void *(*allocate)(size_t, size_t); void (*release)(void *); void *step; void *environment; } callbacks;
typedef struct { const callbacks *c; double u, w, gain; int mode, steps; } motor;
void *fmi2Instantiate(const char *n, int kind, const char *guid, const char *uri, const callbacks *c, int v, int l) {
    if (kind != 1 || strcmp(guid, "{motor}") || strncmp(uri, "file:///", 8)) return NULL;
    motor *m = c->allocate(1, sizeof *m);
    m->c = c; m->gain = 8; printf("the motor talks\n"); fflush(stdout);
    return m;
}
int fmi2SetupExperiment(void *m, int t, double tol, double start, int s, double stop) { return start != 0; }
int fmi2EnterInitializationMode(void *m) { return 0; }
int fmi2ExitInitializationMode(void *m) { return 0; }
int fmi2SetReal(motor *m, const unsigned *r, size_t n, const double *x) { if (*r == 0) m->u = *x; else if (*r == 2) m->gain = *x; else return 3; return 0; }
int fmi2GetReal(motor *m, const unsigned *r, size_t n, double *x) { if (*r != 1) return 3; *x = m->w; return 0; }
int fmi2SetInteger(motor *m, const unsigned *r, size_t n, const int *x) { m->mode = *x; return 0; }
int fmi2DoStep(motor *m, double t, double h, int p) {
    if (++m->steps >= 10) {
        if (m->mode == 1) *(volatile int *)8 = 1;
        if (m->mode == 2) for (;;) sleep(1);
        if (m->mode == 3) { m->c->log(m->c->environment, "motor", 3, "logStatusError", "the winding is 100%% hot"); return 3; }
        if (m->mode == 4) m->w = 0.0 / 0.0;
        if (m->mode == 5) exit(7);
    }
    m->w += h * (m->u * m->gain - m->w) / 0.05;
    return 0;
}
int fmi2Terminate(void *m) { return 0; }
void fmi2FreeInstance(motor *m) { m->c->release(m); }
"""
DESCRIPTION = """<?xml version="1.0"?>
<fmiModelDescription fmiVersion="2.0" modelName="motor" guid="{motor}"><CoSimulation modelIdentifier="motor" canHandleVariableCommunicationStepSize="true"/>
<ModelVariables>
<ScalarVariable name="u" valueReference="0" causality="input"><Real start="0"/></ScalarVariable>
<ScalarVariable name="w" valueReference="1" causality="output"><Real/></ScalarVariable>
<ScalarVariable name="gain" valueReference="2" causality="parameter" variability="fixed"><Real start="8"/></ScalarVariable>
<ScalarVariable name="mode" valueReference="3" causality="parameter" variability="fixed"><Integer start="0"/></ScalarVariable>
</ModelVariables></fmiModelDescription>"""


@pytest.fixture(scope="module")
def motor(tmp_path_factory):
    folder = tmp_path_factory.mktemp("motor")
    (folder / "motor.c").write_text(MOTOR_C)
    subprocess.run(["gcc", "-shared", "-fPIC", "-w", "-O1", "-o", folder / "motor.so", folder / "motor.c"], check=True)
    return pack(folder / "motor.fmu", DESCRIPTION, {"binaries/linux64/motor.so": (folder / "motor.so").read_bytes()})


def pack(file, description, files):
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("modelDescription.xml", description)
        for name, data in files.items():
            archive.writestr(name, data)
    return file


def plant_file(folder, fmu, text="", inputs="w_ref = 100"):
    file = folder / "plant.toml"
    head, _, rest = text.partition("[")
    file.write_text(f'fmu = "{fmu}"\n{head}\n[inputs]\n{inputs}\n{"[" + rest if rest else ""}\n')
    return file


def lag(columns, gain=8.0, steps=1):
    """The motor's speeds by the same sums in Python."""
    w, speeds = 0.0, []
    for u in columns["u"]:
        speeds.append(w)
        for _ in range(steps):
            w += PERIOD / steps * (u * gain - w) / 0.05
    return np.array(speeds)


PERIOD = 1e-3


def test_an_fmu_in_c_closes_the_loop(tmp_path, motor):
    columns = table(EXAMPLES / "pi.s", "--plant", plant_file(tmp_path, motor), "--periods", 1000)
    assert (columns["motor.w"] == lag(columns)).all() and abs(columns["w"][-1] - 100) < 0.1
    # A parameter, steps in a period, another port, and the FMU by itself, whose other input is a table's.
    four = plant_file(tmp_path, motor, "steps = 4\n[parameters]\ngain = 6.0")
    columns = table(EXAMPLES / "pi.s", "--plant", four, "--periods", 300)
    assert (columns["motor.w"] == lag(columns, 6.0, 4)).all()
    law = tmp_path / "law.s"
    law.write_text((EXAMPLES / "pi.s").read_text().replace("w_ref, w ", "w_ref, speed ").replace("w_ref, w =", "w_ref, speed =").replace("e, w_ref, w", "e, w_ref, speed"))
    rows = tmp_path / "rows.csv"
    rows.write_text("w_ref\n" + "70\n" * 300)
    columns = table(law, "--plant", motor, "--connect", "w=speed", "--inputs", rows, "--period", "1ms")
    assert (columns["motor.w"] == lag(columns)).all() and (columns["w_ref"] == 70).all() and len(columns["w"] if "w" in columns else columns["speed"]) == 300


@pytest.mark.parametrize(("mode", "message"), [
    (1, "its process broke down in a step: signal: 11 (SIGSEGV)"),
    (2, "a step took longer than 0.5 s, and its process was ended"),
    (3, "fmi2DoStep failed: the winding is 100%% hot"),
    (4, "diverged: w is NaN"),
    (5, "its process broke down in a step: exit status: 7"),
])
def test_an_fmu_that_fails_ends_the_run_with_the_rows_so_far(tmp_path, motor, mode, message):
    file, rows = plant_file(tmp_path, motor, f"limit = 0.5\n[parameters]\nmode = {mode}"), tmp_path / "loop.csv"
    ran = takt(EXAMPLES / "pi.s", "--plant", file, "--periods", 100, "--outputs", rows, status=1)
    assert message in ran.stderr and "period 9" in ran.stderr, ran.stderr
    assert len(rows.read_text().splitlines()) == 11
    assert "the motor talks" in ran.stderr and ran.stdout == ""


def test_fmus_that_are_no_plants_are_refused_by_name(tmp_path, motor):
    library = {"binaries/linux64/motor.so": zipfile.ZipFile(motor).read("binaries/linux64/motor.so")}
    exchange = DESCRIPTION.replace("CoSimulation", "ModelExchange")
    for name, description, files, message in [
        ("exchange", exchange, library, "it is for ModelExchange only, without a solver of its own; export it for co-simulation"),
        ("old", DESCRIPTION.replace('fmiVersion="2.0"', 'fmiVersion="1.0"'), library, "an FMU of FMI 1.0"),
        ("windows", DESCRIPTION, {"binaries/win64/motor.dll": b"MZ"}, "it has libraries for win64, and no binaries/linux64/motor.so"),
        ("damaged", DESCRIPTION, {"binaries/linux64/motor.so": b"no library"}, "its library cannot be loaded"),
        ("renamed", DESCRIPTION.replace("{motor}", "{other}"), library, "its instantiation failed"),
    ]:
        fmu = pack(tmp_path / f"{name}.fmu", description, files)
        ran = takt(EXAMPLES / "pi.s", "--plant", plant_file(tmp_path, fmu.name), "--periods", 3, status=1)
        assert message in ran.stderr and f"{name}.fmu" in ran.stderr, ran.stderr
    for text, message in [
        ("[parameters]\nmass = 1", "has no variable `mass`"),
        ("[parameters]\nw = 1", "`w` of"),
        ("[ports]\nspeed = \"w\"", "no signal `speed`"),
        ("[disturbance]\nload = 1", "no input `load`"),
    ]:
        ran = takt(EXAMPLES / "pi.s", "--plant", plant_file(tmp_path, motor, text), "--periods", 3, status=1)
        assert message in ran.stderr and "plant.toml:" in ran.stderr, ran.stderr
    assert "cannot be read" in takt(EXAMPLES / "pi.s", "--plant", tmp_path / "none.fmu", "--periods", 3, status=1).stderr


LAG = """
.const T = 1e-3 ; s
.input u
.output speed
.state w
.once
 mov w, zero
 mov speed, zero
 wait p
.period
p: w = w + T*(u*8 - w)/0.05
 speed = w
 wait p
"""


@pytest.mark.parametrize("fmi", ["2", "3"])
def test_a_program_as_an_fmu_is_a_plant(tmp_path, fmi):
    """A law in Takt drives a motor in Takt; the motor's outputs are those of the program by itself, under the same inputs."""
    library = next((path for path in map(Path, ["target/release/libtakt_fmu.so", "target/release/deps/libtakt_fmu.so"]) if path.exists()), None)
    if library is None:
        pytest.skip("target/release has no libtakt_fmu.so")
    (tmp_path / "lag.s").write_text(LAG)
    fmu = tmp_path / "lag.fmu"
    subprocess.run([TOOL, "fmu", tmp_path / "lag.s", "--period", "1ms", "--fmi", fmi, "--library", library, "-o", fmu], check=True, capture_output=True)
    file = plant_file(tmp_path, fmu.name, '[ports]\nspeed = "w"')
    columns = table(EXAMPLES / "pi.s", "--plant", file, "--periods", 500)
    assert abs(columns["w"][-1] - 100) < 0.1
    rows = tmp_path / "u.csv"
    rows.write_text("u\n" + "".join(f"{np.float32(u)}\n" for u in columns["u"]))
    alone = list(csv.DictReader(takt(tmp_path / "lag.s", "--inputs", rows, "--outputs", "-").stdout.splitlines()))
    assert [float(np.float32(row["speed"])) for row in alone[:-1]] == list(columns["w"][1:])
    # Half of its step is none of its steps.
    ran = takt(EXAMPLES / "pi.s", "--plant", plant_file(tmp_path, fmu.name, 'steps = 2\n[ports]\nspeed = "w"'), "--periods", 5, status=1)
    assert "a whole number of periods" in ran.stderr, ran.stderr


MOTOR_PY = '''
from pythonfmu import Fmi2Causality, Fmi2Slave, Real

class Motor(Fmi2Slave):
    """A motor's speed at a voltage."""
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.u, self.w = 0.0, 0.0
        self.register_variable(Real("u", causality=Fmi2Causality.input))
        self.register_variable(Real("w", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        self.w += step_size * (self.u * 8.0 - self.w) / 0.05
        return True
'''


def test_an_fmu_of_pythonfmu_closes_the_loop(tmp_path):
    pythonfmu = pytest.importorskip("pythonfmu.builder")
    (tmp_path / "motor.py").write_text(MOTOR_PY)
    fmu = Path(pythonfmu.FmuBuilder.build_FMU(str(tmp_path / "motor.py"), dest=str(tmp_path)))
    loop = [EXAMPLES / "pi.s", "--plant", plant_file(tmp_path, fmu.name), "--periods", 1000]
    assert "LD_PRELOAD=" in takt(*loop, status=1).stderr
    library = Path(sysconfig.get_config_var("LIBDIR")) / str(sysconfig.get_config_var("INSTSONAME"))
    if not library.is_file():
        pytest.skip("this Python has no shared library")
    columns = table(*loop, env=os.environ | {"LD_PRELOAD": str(library), "PYTHONPATH": str(Path(pythonfmu.__file__).parents[1])})
    assert (columns["Motor.w"] == lag(columns)).all() and abs(columns["w"][-1] - 100) < 0.1


def in_python(run, columns, plant):
    """The run of the package has the values of the command's table, bit for bit."""
    for name, values in {**run.inputs, **run.outputs}.items():
        assert (values.view(np.uint32) == columns[name].astype(values.dtype).view(np.uint32)).all(), name
    for name, values in run.states.items():
        assert (values == columns[f"{plant.name}.{name}"]).all(), name
    assert (run.cycles == columns["cycles"]).all() and run.completed == len(columns["cycles"]) and not run.faults


@pytest.mark.parametrize(("program", "file", "periods"), [
    ("pi.s", "dc_motor", 400), ("foc.s", "pmsm", 400), ("pi.s", "tank", 300), ("plant/servo.s", "servo", 600), ("pendulum.s", "cart_pendulum", 2100),
])
def test_python_s_loops_are_those_of_the_command(program, file, periods):
    plant, law = package.Plant(PLANTS / f"{file}.toml"), package.load(EXAMPLES / program, effort=20)
    columns = table(EXAMPLES / program, "--plant", PLANTS / f"{file}.toml", "--periods", periods)
    run = law.run(plant=plant, periods=periods)
    in_python(run, columns, plant)
    sim = law.sim(plant=plant)
    for at in range(60):
        outputs = sim.step()
        assert all(np.float32(value) == np.float32(run.outputs[name][at]) for name, value in outputs.items())
        assert all(np.float32(value) == np.float32(run.inputs[name][at]) for name, value in sim.inputs.items())
        assert all(value == run.states[name][at] for name, value in sim.states.items())
    others = [copy.copy(sim), pickle.loads(pickle.dumps(sim))]
    for at in range(60, 70):
        states = [(each.step(), each.states) for each in (sim, *others)]
        assert states[0] == states[1] == states[2] and states[0][1] == {name: values[at] for name, values in run.states.items()}
    sim.reset()
    sim.step()
    assert sim.periods == 1 and sim.states == {name: values[0] for name, values in run.states.items()}


def test_values_in_python_come_before_the_file_s(tmp_path):
    plant, law = package.Plant(PLANTS / "dc_motor.toml"), package.load(EXAMPLES / "pi.s", effort=20)
    file = tmp_path / "in.csv"
    rows = np.linspace(20, 60, 200).astype(np.float32)
    file.write_text("w_ref\n" + "".join(f"{row}\n" for row in rows))
    in_python(law.run({"w_ref": rows}, plant=plant), table(EXAMPLES / "pi.s", "--plant", PLANTS / "dc_motor.toml", "--inputs", file), plant)
    # Numbers of the file, as if they were written there.
    other = tmp_path / "other.toml"
    other.write_text((PLANTS / "dc_motor.toml").read_text().replace("7e-4 ", "2e-3 ").replace("[[0.1, 0.4]]", "[[0.05, 0.3]]"))
    heavy = pickle.loads(pickle.dumps(plant.with_parameters({"J": 2e-3}).with_parameters({"load": 0.3, "load.at": 0.05})))
    assert (plant.parameters["J"], heavy.parameters["J"], heavy.parameters["load.at"]) == (7e-4, 2e-3, 0.05)
    in_python(law.run(plant=heavy, periods=200), table(EXAMPLES / "pi.s", "--plant", other, "--periods", 200), heavy)
    # Given values stay in force; before them, the file's value holds.
    sim = law.sim(plant=plant)
    assert (sim.step(), sim.inputs["w_ref"])[1] == 100 and (sim.step({"w_ref": 7}), sim.step(), sim.inputs["w_ref"])[2] == 7


def test_fmus_in_python(tmp_path, motor, capfd):
    law = package.load(EXAMPLES / "pi.s", effort=20)
    file = plant_file(tmp_path, motor)
    plant = package.Plant(file)
    assert (plant.name, plant.inputs, plant.sensors, plant.parameters) == ("motor", ("u",), ("w",), {})
    in_python(law.run(plant=plant, periods=300), table(EXAMPLES / "pi.s", "--plant", file, "--periods", 300), plant)
    # By itself, whose other input is given, and step by step: one after the other, and two at a time.
    alone = package.Plant(motor, period=1e-3)
    run = law.run({"w_ref": 100.0}, plant=alone, periods=300)
    sim, other = law.sim(plant=alone), law.sim(plant=alone)
    for at in range(20):
        assert np.float32(sim.step({"w_ref": 100.0})["u"]) == run.outputs["u"][at]
        other.step({"w_ref": 3.0})
    assert copy.copy(sim).step() == sim.step() != other.step()
    for mode, message, period in [
        (1, "its process broke down in a step: signal: 11", 9),
        (2, "a step took longer than 0.5 s", 9),
        (3, "fmi2DoStep failed: the winding", 9),
        (4, "diverged: w is NaN", 9),
    ]:
        run = law.run(plant=package.Plant(plant_file(tmp_path, motor, f"limit = 0.5\n[parameters]\nmode = {mode}")), periods=100)
        (fault,) = run.faults
        assert (fault.kind, fault.period, run.completed) == ("plant", period, period + 1) and message in str(fault)
        assert np.isfinite(run.states["w"][:10]).all() and np.isnan(run.states["w"][10:]).all() and np.isnan(run.inputs["w"][10:]).all()
    sim = law.sim(plant=package.Plant(file))
    while sim.periods < 10:
        sim.step()
    with pytest.raises(package.FaultError, match="diverged"):
        for _ in range(3):
            sim.step()
    assert sim.periods == 10
    sim.reset()
    sim.step()
    assert "the motor talks" in capfd.readouterr().err


def test_an_fmu_of_pythonfmu_in_python(tmp_path):
    """The process of the FMU is Python, which such libraries expect."""
    pythonfmu = pytest.importorskip("pythonfmu.builder")
    (tmp_path / "motor.py").write_text(MOTOR_PY)
    fmu = Path(pythonfmu.FmuBuilder.build_FMU(str(tmp_path / "motor.py"), dest=str(tmp_path)))
    run = package.load(EXAMPLES / "pi.s").run({"w_ref": 100}, plant=package.Plant(fmu), periods=1000).check()
    assert (run.states["w"] == lag({"u": run.outputs["u"].astype(float)})).all() and abs(run.inputs["w"][-1] - 100) < 0.1


def test_mistakes_in_python(tmp_path, motor):
    law, plant = package.load(EXAMPLES / "pi.s"), package.Plant(PLANTS / "dc_motor.toml")
    bare = tmp_path / "bare.toml"
    bare.write_text('model = "dc_motor"\n')
    silent = package.assemble(".input w\n.output u\n.period\np: mov u, w\n wait p\n")
    exchange = pack(tmp_path / "exchange.fmu", DESCRIPTION.replace("CoSimulation", "ModelExchange"), {})
    wrong = tmp_path / "wrong.toml"
    wrong.write_text('model = "dc_motor"\n[parameters]\nr = 1\n')
    for kind, message, act in [
        (OSError, "cannot read none.toml", lambda: package.Plant("none.toml")),
        (ValueError, "expected a file `….toml` or `….fmu`", lambda: package.Plant("plant.py")),
        (TypeError, "path is a path", lambda: package.Plant(3)),
        (package.AssemblyError, r"wrong.toml:3:1", lambda: package.Plant(wrong)),
        (package.PlantError, "for ModelExchange only", lambda: package.Plant(exchange)),
        (ValueError, "period is -1.0 s", lambda: package.Plant(bare, period=-1)),
        (TypeError, "names of signals to names of ports", lambda: package.Plant(bare, connect={"w": 3})),
        (ValueError, "no parameter `r`", lambda: plant.with_parameters({"r": 1})),
        (ValueError, "expected a positive number", lambda: plant.with_parameters({"R": 0})),
        (TypeError, "plant is a takt.Plant", lambda: law.run(plant="dc_motor.toml", periods=3)),
        (ValueError, "give periods", lambda: law.run(plant=plant)),
        (ValueError, "the inputs have 2 runs", lambda: law.run({"w_ref": np.zeros((2, 5))}, plant=plant)),
        (ValueError, "the plant gives the input `w`", lambda: law.run({"w": 1}, plant=plant, periods=3)),
        (ValueError, "the plant gives the input `w`", lambda: law.sim(plant=plant).step({"w": 1})),
        (ValueError, "no input `v`", lambda: law.run({"v": 1}, plant=plant, periods=3)),
        (package.PlantError, "`w_ref` has no source.*columns with `inputs=`", lambda: law.run(plant=package.Plant(bare), periods=3)),
        (ValueError, "no value for `w_ref`", lambda: law.sim(plant=package.Plant(bare)).step()),
        (package.AssemblyError, 'connect={"da": "…"}', lambda: law.run(plant=package.Plant(PLANTS / "pmsm.toml"), periods=3)),
        (package.AssemblyError, "no input port `speed`", lambda: law.run(plant=package.Plant(bare, connect={"w": "speed"}), periods=3)),
        (ValueError, r"takt.Plant\(…, period=1e-3\)", lambda: silent.run(plant=package.Plant(bare), periods=3)),
        (package.PlantError, "moves too fast", lambda: silent.run(plant=package.Plant(bare, period=1e9), periods=3)),
    ]:
        with pytest.raises(kind, match=message):
            act()
    with pytest.raises(package.AssemblyError):
        package.Plant(plant_file(tmp_path, motor, "[parameters]\nmass = 1")).name
        law.run(plant=package.Plant(plant_file(tmp_path, motor, "[parameters]\nmass = 1")), periods=3)
    broken = silent.run(plant=package.Plant(bare, period=1e-3), periods=0)
    assert broken.completed == 0 and broken.cycles.shape == (0,)
