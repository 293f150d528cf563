"""The wheel needs no Rust: it installs and runs where no program is on the path, from no source and no index."""

import os
import subprocess
import sys
import venv
from pathlib import Path

import numpy as np

import takt

WHEELS = Path(__file__).parents[3] / "target/wheels"
PROGRAM = """
import sys, takt, takt.mpc
run = takt.assemble(".input x\\n.output y\\n.period\\nloop: fmul y, x, 0.5\\n wait loop\\n").run({"x": [1.0, 2.0]})
mpc = takt.mpc.program(takt.mpc.problem([[1.0]], [[1.0]], 1, 1, horizon=3, u_min=-1, u_max=1))
print(takt.__file__, run.outputs["y"].tolist(), mpc.bundles > 10)
"""


def test_a_wheel_needs_no_rust(tmp_path):
    wheels = sorted(WHEELS.glob("takt-*.whl"), key=os.path.getmtime)
    assert wheels, f"no wheel in {WHEELS}: `cargo xtask wheel` builds one, as `cargo xtask test` does"
    venv.create(tmp_path / "env", with_pip=False)
    python = tmp_path / "env/bin/python3"
    bare = {"PATH": str(tmp_path), "HOME": str(tmp_path), "PIP_CONFIG_FILE": os.devnull}
    # This environment's pip installs into the other one, from the file alone.
    install = [sys.executable, "-I", "-m", "pip", "--python", str(python), "install", "--no-deps", "--no-index", "--no-cache-dir"]
    subprocess.run([*install, "--disable-pip-version-check", str(wheels[-1])], env=bare, check=True, capture_output=True)
    # Use NumPy, the package's only dependency, from this environment.
    (packages,) = (tmp_path / "env/lib").glob("python3*/site-packages")
    for path in Path(np.__file__).parents[1].glob("numpy*"):
        (packages / path.name).symlink_to(path)
    done = subprocess.run([python, "-I", "-c", PROGRAM], env=bare, check=True, capture_output=True, text=True, cwd=tmp_path)
    file, rest = done.stdout.split(maxsplit=1)
    assert Path(file).is_relative_to(packages) and rest == "[0.5, 1.0] True\n", done.stdout
    assert Path(takt.__file__) != Path(file)
