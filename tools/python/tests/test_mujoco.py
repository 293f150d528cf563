"""Programs as controllers in MuJoCo: instants to the cycle, names, encoders, several robots."""

import re
from pathlib import Path

import mujoco
import numpy as np
import pytest

import takt
import takt.mujoco
from takt.mujoco import Controller, Encoder

ROOT = Path(__file__).parents[3]
#: A mass of 1 kg that slides without friction, so that its velocity is the integral of the force.
SLIDE = """<mujoco><option gravity="0 0 0" timestep="0.001"/>
<worldbody><body name="mass"><joint name="x" type="slide" axis="1 0 0"/><geom size="0.1" mass="1"/></body></worldbody>
<actuator><motor name="push" joint="x" gear="2"/></actuator>
<sensor><jointvel name="speed" joint="x"/><jointpos name="place" joint="x"/></sensor></mujoco>"""
#: Program that pushes with the period's number as force, after some cycles.
LATE = """
.schedule on
.input q
.output tau
.reg root
.state count
.once
 fadd count, zero, zero
 wait loop
.period
loop:
 fadd count, count, 1.0
 fsqrt root, 2.0
 fmul root, root, 0.0
 fmul root, root, q
 fadd tau, count, root
 wait loop
"""
PENDULUM = """<mujoco><option timestep="0.0005"/>
<worldbody><body name="arm"><joint name="{0}" axis="0 1 0" damping="0.05" armature="0.01"/>
<geom type="capsule" fromto="0 0 0 0 0 -0.5" size="0.03"/></body></worldbody>
<actuator><motor name="motor" joint="{0}"/></actuator></mujoco>"""


def pusher():
    return takt.assemble(LATE)


def test_forces_act_from_the_cycle_on():
    model, program, clock = mujoco.MjModel.from_xml_string(SLIDE), pusher(), 1e6
    for latency, period in [(None, 1e-3), (0, 1e-3), (700, 1e-3), (1000, 1e-3), (1300, 1e-3), (None, 5.4e-5)]:
        data = mujoco.MjData(model)
        loop = Controller(model, program, period=period, clock=clock, latency=latency, joints=["x"])
        velocity = 0.0
        for k in range(1, 6):
            loop.step(data)
            late = int(loop.cycles[0]) if latency is None else latency
            # The force is the number of the period, starting `late` cycles after the tick.
            forces = [(number, (number - 1) * loop.tick + late) for number in range(1, k + 1)]
            now, begin = k * loop.tick, (k - 1) * loop.tick
            edges = [(0 if not i else forces[i - 1][0], 0 if not i else forces[i - 1][1]) for i in range(len(forces) + 1)]
            velocity = sum(
                force * max(0, min(now, edges[i + 1][1] if i + 1 < len(edges) else now) - start)
                for i, (force, start) in enumerate(edges)
            ) / clock
            assert begin < now
            assert data.qvel[0] == pytest.approx(velocity, rel=1e-9, abs=1e-15), (latency, k)
            assert data.time == pytest.approx(k * period, abs=1e-15)
        assert loop.latency != 0 or velocity > 0
        assert model.opt.timestep == 1e-3
    assert 0 < int(loop.cycles[0]) < 54


def test_the_callback_does_the_same_on_its_grid():
    model, program = mujoco.MjModel.from_xml_string(SLIDE), pusher()
    by_step, by_callback = mujoco.MjData(model), mujoco.MjData(model)
    loop = Controller(model, program, period=1e-3, clock=1e6, latency=400, joints=["x"])
    for _ in range(5):
        loop.step(by_step)
    model.opt.timestep = 1e-4
    loop = Controller(model, program, period=1e-3, clock=1e6, latency=400, joints=["x"])
    mujoco.set_mjcb_control(loop)
    try:
        mujoco.mj_step(model, by_callback, 50)
    finally:
        mujoco.set_mjcb_control(None)
    assert loop.periods == 5
    assert by_callback.qvel[0] == pytest.approx(by_step.qvel[0], rel=1e-9)
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    with pytest.raises(ValueError, match="the integrator RK4 calls the controller within a step"):
        loop(model, by_callback)


def test_computed_torque_holds_what_it_should():
    text = PENDULUM.format("hinge")
    model = mujoco.MjModel.from_xml_string(text)
    program = takt.mujoco.program(text, "computed-torque", kp=400, kd=40)
    assert program.model.joints == ("hinge",)

    def reference(t):
        return {"qr": [np.sin(15 * t)], "qdr": [15 * np.cos(15 * t)], "qddr": [-225 * np.sin(15 * t)]}

    def error(**options):
        data = mujoco.MjData(model)
        data.qvel[0] = 15
        loop = Controller(model, program, period=1e-3, reference=reference, **options)
        errors = []
        for _ in range(1000):
            loop.step(data)
            errors.append(abs(data.qpos[0] - np.sin(15 * data.time)))
        return max(errors)

    exact, late = error(), error(latency=125_000)
    assert exact < 5e-3 and late > 1.2 * exact
    assert error(encoder=Encoder(2**20, 400)) < 2e-2


def test_encoders_count():
    model = mujoco.MjModel.from_xml_string(PENDULUM.format("hinge"))
    seen = takt.assemble(".input q, qd\n.output tau, rate\n.period\nloop: fmul tau, q, 1.0\n fmul rate, qd, 1.0\n wait loop\n")
    data, steps = mujoco.MjData(model), 4096
    data.qpos[0] = 0.7
    loop = Controller(model, seen, period=1e-3, encoder=Encoder(steps), joints=["hinge"])
    for _ in range(20):
        loop.step(data)
        count = float(loop.outputs["tau"][0]) / (2 * np.pi / steps)
        assert count == pytest.approx(round(count), abs=1e-3)
    assert abs(loop.outputs["tau"][0] - data.qpos[0]) < 0.05


def test_robots_in_a_batch_move_as_alone():
    text = PENDULUM.format("hinge")
    model, program = mujoco.MjModel.from_xml_string(text), takt.mujoco.program(text, "computed-torque")

    def reference(t):
        return {"qr": [0.5], "qdr": [0.0], "qddr": [0.0]}

    def start(angle):
        data = mujoco.MjData(model)
        data.qpos[0] = angle
        return data

    angles = [-1.0, -0.2, 0.1, 0.9, 2.0]
    together = [start(angle) for angle in angles]
    loop = Controller(model, program, period=1e-3, runs=5, reference=reference)
    for _ in range(50):
        loop.step(together)
    for angle, other in zip(angles, together):
        alone, single = start(angle), Controller(model, program, period=1e-3, reference=reference)
        for _ in range(50):
            single.step(alone)
        assert alone.qpos[0] == other.qpos[0] and alone.qvel[0] == other.qvel[0]
    with pytest.raises(ValueError, match="2 MjData for 5 robots"):
        loop.step(together[:2])
    with pytest.raises(ValueError, match="the callback is for one robot, this is for 5"):
        loop(model, together[0])


def test_sensors_and_actuators_have_names():
    model = mujoco.MjModel.from_xml_string(SLIDE)
    # `place` is the name of a sensor; `v` is assigned one; push has no scale if it is named.
    program = takt.assemble(".schedule on\n.input place, v, k\n.output u\n.reg x\n.period\nloop: fsub x, k, place\n fsub u, x, v\n wait loop\n")
    data = mujoco.MjData(model)
    data.qpos[0], data.qvel[0] = 0.25, 0.5
    with pytest.raises(ValueError, match="input `v` is one number, and reads 2"):
        Controller(model, program, period=1e-3, sensors={"v": ["speed", "place"]}, actuators={"u": "push"})
    loop = Controller(model, program, period=1e-3, sensors={"v": "speed"}, actuators={"u": "push"}, reference=lambda t: {"k": 2})
    loop.step(data)
    assert loop.outputs["u"][0] == 2 - 0.25 - 0.5 == data.ctrl[0]


def test_wrong_names_and_models_are_refused(tmp_path):
    model, program = mujoco.MjModel.from_xml_string(SLIDE), pusher()

    def wrong(text, **options):
        with pytest.raises(ValueError, match=re.escape(text)):
            Controller(model, program, **{"period": 1e-3, "joints": ["x"], **options})

    wrong("the model has no joint `y` (there are: x)", joints=["y"])
    wrong("the model has no actuator `pusj`; did you mean `push`?", actuators={"tau": "pusj"})
    wrong("the model has no sensor `speeed`; did you mean `speed`?", sensors={"q": "speeed"})
    wrong("sensors: the program has no input `p`", sensors={"p": "speed"})
    wrong("actuators: the program has no output `taw`; did you mean `tau`?", actuators={"taw": "push"})
    wrong("no output moves anything: actuators={…} names them (outputs: tau)", joints=[])
    wrong("period is 1e-10 s", period=1e-10)
    wrong("latency is -1: it is 0 at least", latency=-1)
    servo = mujoco.MjModel.from_xml_string(SLIDE.replace('<motor name="push" joint="x" gear="2"/>', '<position name="push" joint="x"/>'))
    with pytest.raises(ValueError, match="actuator `push` of joint `x` is no motor"):
        Controller(servo, program, period=1e-3, joints=["x"])
    none = mujoco.MjModel.from_xml_string(re.sub("<actuator>.*</actuator>", "", SLIDE))
    with pytest.raises(ValueError, match="joint `x` has no actuator"):
        Controller(none, program, period=1e-3, joints=["x"])
    ball = mujoco.MjModel.from_xml_string(re.sub("<sensor>.*</sensor>", "", SLIDE).replace('type="slide" axis="1 0 0"', 'type="ball"'))
    with pytest.raises(ValueError, match="joint `x` neither turns nor slides"):
        Controller(ball, program, period=1e-3, joints=["x"])
    with pytest.raises(ValueError, match="counts is 0"):
        Encoder(0)
    (tmp_path / "ball.xml").write_text(PENDULUM.format("hinge").replace("<joint ", '<joint type="ball" '))
    with pytest.raises(takt.ModelError, match="ball.xml:2: `hinge`: a ball joint: only hinges and slides are known"):
        takt.mujoco.program(tmp_path / "ball.xml", "gravity")
