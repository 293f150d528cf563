#!/usr/bin/env python3
# SPDX-License-Identifier: MIT OR Apache-2.0
"""HyperQueue's program `hq` as far as takt-work calls it: it records its arguments in the server's folder, and runs the tasks of a job
itself, when the job is submitted. If the folder has a file `lose`, the first job is lost with its server."""

import json
import subprocess
import sys
import time
import tomllib
from pathlib import Path

if sys.argv[1:] == ["--version"]:
    print("hyperqueue 0.0.0")
    raise SystemExit
assert sys.argv[1] == "--server-dir"
folder, words = Path(sys.argv[2]), sys.argv[3:]
folder.mkdir(parents=True, exist_ok=True)
with open(folder / "calls", "a") as calls:
    calls.write(" ".join(words) + "\n")
is_json = words[:2] == ["--output-mode", "json"]
words = words[2:] if is_json else words
jobs = folder / "jobs.json"


def answer(value, status=0):
    print(json.dumps(value))
    raise SystemExit(status)


def known():
    return json.loads(jobs.read_text()) if jobs.exists() else {}


if words == ["server", "start"]:
    (folder / "hq-current").touch()
    time.sleep(1000)
elif words[:2] == ["worker", "start"]:
    time.sleep(1000)
elif words == ["server", "info"]:
    answer({"pid": 1}) if (folder / "hq-current").exists() else answer({"error": "no server"}, 1)
elif words[:2] == ["job", "submit-file"]:
    job = tomllib.loads(Path(words[2]).read_text())
    with open(folder / "jobs.toml", "a") as seen:
        seen.write(Path(words[2]).read_text())
    number, lost = str(len(known()) + 1), (folder / "lose").exists()
    (folder / "lose").unlink(missing_ok=True)
    tasks = []
    for task in job["task"][: 1 if lost else None]:
        with open(task["stderr"], "w") as log:
            done = subprocess.run(task["command"], cwd=task["cwd"], env=task["env"] | {"PATH": "/usr/bin:/bin"}, stderr=log)
        state = "finished" if done.returncode == 0 else "failed"
        tasks.append({"id": task["id"], "state": state, "error": f"Program terminated with exit code {done.returncode}"})
    jobs.write_text(json.dumps(known() | {number: None if lost else tasks}))
    answer({"id": int(number)})
elif words == ["job", "list", "--all"]:
    if None in known().values():
        jobs.write_text(json.dumps({number: tasks or [] for number, tasks in known().items()}))
        answer({"error": "the connection is gone"}, 1)
    count = lambda tasks, state: sum(task["state"] == state for task in tasks)
    states = ("finished", "failed", "running", "waiting", "canceled", "aborted")
    answer([{"id": int(number), "task_stats": {state: count(tasks, state) for state in states}} for number, tasks in known().items()])
elif words[:2] == ["task", "list"]:
    answer({words[2]: known()[words[2]]})
elif words[:2] == ["job", "forget"]:
    answer({})
else:
    answer({"error": f"`{' '.join(words)}` is no command"}, 1)
