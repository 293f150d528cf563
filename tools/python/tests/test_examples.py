"""The examples run, and say what they should."""

import re
import runpy
from pathlib import Path

EXAMPLES = Path(__file__).parents[1] / "examples"


def test_the_acrobot_follows_its_reference(capsys):
    names = runpy.run_path(str(EXAMPLES / "acrobot.py"))
    said = capsys.readouterr().out
    assert len(names["cycles"]) == 1 and max(names["cycles"]) <= names["bound"].worst_period
    # A period late, at 2 rad/s: what remains is the delay, not the model.
    error = float(re.search(r"within ([0-9.]+) mrad", said)[1])
    assert 0 < error < 5, said
    assert len((EXAMPLES / "acrobot.py").read_text().splitlines()) <= 40


def test_the_plant_is_the_one_of_the_urdf():
    """The textbook's equations against the machine's forward dynamics of the same description."""
    import numpy as np

    import takt.urdf

    names = runpy.run_path(str(EXAMPLES / "acrobot.py"))
    random = np.random.default_rng(5)
    q, qd, tau = (random.uniform(-2, 2, (50, 2)) for _ in range(3))
    run = takt.urdf.program(names["URDF"], "forward-dynamics").run({"q": q, "qd": qd, "tau": tau})
    expected = np.array([names["acceleration"](*state) for state in zip(q, qd, tau)])
    np.testing.assert_allclose(run.outputs["qdd"], expected, rtol=1e-4, atol=1e-3)
