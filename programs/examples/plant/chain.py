# SPDX-License-Identifier: MIT OR Apache-2.0
"""Designs the controller of statespace.s, and records statespace.csv in its loop: `python chain.py`.

Six masses in a chain, between walls, have springs of one stiffness. Forces act on the masses 1, 3, 4 and 6; the positions of 1, 3 and 5
are measured. The controller is linear-quadratic-Gaussian, with the measurement of a period in the forces of the same period. The loop is
pushed twice: a blow on mass 2, and later a constant force on mass 5.
"""

from pathlib import Path

import numpy as np

HERE = Path(__file__).parent.parent
MASSES, MASS, STIFFNESS, DAMPING = 6, 0.1, 40.0, 0.02  # kg, N/m, N·s/m
PERIOD = 0.01  # s
ACTUATED, MEASURED = [0, 2, 3, 5], [0, 2, 4]
FULL_SCALE = 0.02  # m, of the sensors; 1 in the table
PERIODS = 300
# Periods and forces in N on masses: a blow of one period, and a constant force.
BLOW, CONSTANT = (10, 1, 6.0), (150, 4, 0.4)
LARGEST = 3.0  # of a state, where measurements stay within the full scale


def exponential(matrix: np.ndarray) -> np.ndarray:
    """Exponential of a small matrix, by its series over a 1024th of it."""
    term = result = np.eye(len(matrix))
    for k in range(1, 12):
        term = term @ (matrix / 1024) / k
        result = result + term
    return np.linalg.matrix_power(result, 1024)


def riccati(a: np.ndarray, b: np.ndarray, q: np.ndarray, r: np.ndarray) -> np.ndarray:
    """Solution of the discrete Riccati equation, by iteration."""
    p = q
    for _ in range(20000):
        gain = np.linalg.solve(r + b.T @ p @ b, b.T @ p @ a)
        after = q + a.T @ p @ (a - b @ gain)
        if np.abs(after - p).max() < 1e-13 * np.abs(after).max():
            break
        p = after
    return p


def text(matrix: np.ndarray) -> str:
    return ", ".join(f"{value:.4f}".replace("-0.0000", "0.0000") for value in matrix.ravel())


# Positions in full scales and velocities in full scales a period, so that states are of one size.
coupling = -2 * np.eye(MASSES) + np.eye(MASSES, k=1) + np.eye(MASSES, k=-1)
zero, one = np.zeros((MASSES, MASSES)), np.eye(MASSES)
flow = np.block([[zero, one], [STIFFNESS / MASS * coupling, -DAMPING / MASS * one]])
scale = np.diag([1 / FULL_SCALE] * MASSES + [PERIOD / FULL_SCALE] * MASSES)
forces = np.vstack([zero, one / MASS])
whole = exponential(PERIOD * np.block([[flow, forces], [np.zeros((MASSES, 3 * MASSES))]]))
a = scale @ whole[: 2 * MASSES, : 2 * MASSES] @ np.linalg.inv(scale)
pushed = scale @ whole[: 2 * MASSES, 2 * MASSES :]
b = pushed[:, ACTUATED]
c = np.eye(2 * MASSES)[MEASURED]

weight = np.diag([1.0] * MASSES + [0.2] * MASSES)
p = riccati(a, b, weight, 0.02 * np.eye(len(ACTUATED)))
gain = np.linalg.solve(0.02 * np.eye(len(ACTUATED)) + b.T @ p @ b, b.T @ p @ a)
s = riccati(a.T, c.T, 0.05 * pushed @ pushed.T, 1e-3 * np.eye(len(MEASURED)))
correct = s @ c.T @ np.linalg.inv(c @ s @ c.T + 1e-3 * np.eye(len(MEASURED)))

# x: what the period before predicts; the measurement corrects it first.
inner = np.eye(2 * MASSES) - correct @ c
A, B = (a - b @ gain) @ inner, (a - b @ gain) @ correct
C, D = -gain @ inner, -gain @ correct
# Each state within LARGEST: the sums of its responses to measurements of full scale.
size, response = np.zeros(2 * MASSES), B
for _ in range(5000):
    size += np.abs(response).sum(axis=1)
    response = A @ response
units = np.diag(LARGEST / size)
A, B, C = units @ A @ np.linalg.inv(units), units @ B, C @ np.linalg.inv(units)
A, B, C, D = (np.array([float(value) for value in text(matrix).split(", ")]).reshape(matrix.shape) for matrix in (A, B, C, D))

if __name__ == "__main__":
    chain, state, rows, given = np.zeros(2 * MASSES), np.zeros(2 * MASSES), [], []
    for period in range(PERIODS):
        measured = np.round(c @ chain, 4)
        u = C @ state + D @ measured
        state = A @ state + B @ measured
        rows.append(measured)
        given.append(u)
        force = np.zeros(MASSES)
        if period == BLOW[0]:
            force[BLOW[1]] = BLOW[2]
        if period >= CONSTANT[0]:
            force[CONSTANT[1]] = CONSTANT[2]
        chain = a @ chain + b @ u + pushed @ force
    assert np.abs(np.linalg.eigvals(A)).max() < 1 and np.abs(rows).max() < 1, "it stays within the sensors"
    lines = ["y[1],y[2],y[3]"] + [",".join(f"{value + 0.0:g}" for value in row) for row in rows]
    (HERE / "statespace.csv").write_text("\n".join(lines) + "\n")
    source = (HERE / "statespace.s").read_text().splitlines(keepends=True)
    for name, matrix in zip("ABCD", (A, B, C, D)):
        at = next(i for i, line in enumerate(source) if line.startswith(f".array  {name}["))
        source[at] = f".array  {name}[{matrix.shape[0]},{matrix.shape[1]}] = {text(matrix)}\n"
    (HERE / "statespace.s").write_text("".join(source))
    print(f"|y| <= {np.abs(rows).max():.3f}, |u| <= {np.abs(given).max():.3f} N, |D| <= {np.abs(D).max():.3f}, |C| <= {np.abs(C).max():.3f}")
