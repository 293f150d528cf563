"""A gain sweep: a thousand closed loops of a servo in one call, and the gains that settle fastest."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

import takt

LAW = """
.schedule on
.input q, qr, kp, kd, ki
.output u
.const STEP = 1e-3
.reg e d
.state before integral
.once
        fadd    before, zero, zero
        fadd    integral, zero, zero
        wait    loop
.period
loop:   fsub    e, qr, q
        fsub    d, q, before
        fadd    before, q, zero
        fmul    d, d, 1/STEP
        fmul    d, d, kd
        fmul    u, e, kp
        fsub    u, u, d
        fadd    u, u, integral
        fmul    e, e, ki
        fmul    e, e, STEP
        fadd    integral, integral, e
        fsat    u, u, 20.0
        wait    loop
"""
STEP, RUNS, PERIODS = 1e-3, 1000, 1500

law, random = takt.assemble(LAW), np.random.default_rng(1)
gains = {"kp": random.uniform(20, 400, RUNS), "kd": random.uniform(1, 40, RUNS), "ki": random.uniform(0, 400, RUNS)}
q, v = np.zeros(RUNS), np.zeros(RUNS)


def servo(outputs: dict[str, NDArray[Any]], period: int) -> Mapping[str, ArrayLike]:
    """All servos at once: a mass of 1 kg with friction and a weight of 3 N."""
    global q, v
    v = v + STEP * (outputs["u"] - 3 - 0.5 * v)
    q = q + STEP * v
    return {"q": q}


begin = time.perf_counter()
loops = law.batch(RUNS).close(servo, PERIODS, {"q": q, "qr": 1.0, **gains}, record=["q"])
closed = time.perf_counter() - begin
# The same periods without a plant: the inputs of all periods are passed at once.
given: dict[str, ArrayLike] = {"q": loops.inputs["q"], "qr": 1.0, **{name: values[:, None] for name, values in gains.items()}}
begin = time.perf_counter()
run = law.run(given)
native = time.perf_counter() - begin

late = np.abs(loops.inputs["q"] - 1) > 0.02
settled = STEP * (PERIODS - np.argmax(late[:, ::-1], axis=1))
best = int(np.argmin(settled))
print(f"{RUNS} loops of {PERIODS} periods in {closed:.2f} s, {1e9 * closed / RUNS / PERIODS:.0f} ns a period and robot; {closed / native:.1f} times native speed")
print(f"{run.cycles.max()} cycles a period; kp {gains['kp'][best]:.0f}, kd {gains['kd'][best]:.1f}, ki {gains['ki'][best]:.0f} settle within 2 % in {settled[best]:.3f} s")
