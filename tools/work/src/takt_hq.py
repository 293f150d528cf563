# SPDX-License-Identifier: MIT OR Apache-2.0
"""HyperQueue for takt-work: a server with workers, each a process of its own, and a client that submits units.

    cluster DIR N     a server in DIR and N workers of one core, each started again if it ends
    server DIR        the server alone
    worker DIR        a worker of the server in DIR; it looks for the next one if that ends
    submit DIR UNITS  runs the units of a file, until each is done or has failed a few times

The package starts a server and workers in threads of one process. A worker in a process of its own is a server without work whose link
to the server's files, `hq-current`, is set to those of the server that it is to serve.
"""

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time

from hyperqueue import Client, Job
from hyperqueue.ffi.cluster import Cluster
from hyperqueue.output import StdioDef

ATTEMPTS = 3  # times that a unit is started, as in lib.rs
PATIENCE = 60  # seconds without a server, or until a result that was written elsewhere is seen
CURRENT = "hq-current"


def say(**line):
    print(json.dumps(line), flush=True)


def give_up(text):
    sys.stderr.write(f"takt: {text}\n")
    raise SystemExit(1)


def reason(error):
    """The error's own words, without the stack that follows them."""
    return str(error).split("\n\nStack backtrace")[0].strip().replace("\n", " ")


def while_parent_lives():
    """Returns when whoever started this process is gone."""
    parent = os.getppid()
    while os.getppid() == parent:
        yield
        time.sleep(0.5)


def server(folder):
    running = Cluster(folder)
    for _ in while_parent_lives():
        pass
    running.stop()


def worker(folder):
    own = tempfile.mkdtemp(prefix="takt-worker-")
    try:
        serve(folder, own)
    finally:
        shutil.rmtree(own, ignore_errors=True)


def serve(folder, own, cores=1):
    idle = Cluster(own)
    link = os.path.join(own, CURRENT)
    serves = None
    for _ in while_parent_lives():
        current = os.path.realpath(os.path.join(folder, CURRENT))
        if current == serves or not os.path.exists(os.path.join(current, "access.json")):
            continue
        os.unlink(link)
        os.symlink(current, link)
        try:
            idle.add_worker(cores)
            serves = current
        except Exception as error:  # the server is on its way, or gone
            sys.stderr.write(f"worker: {reason(error)}\n")


def cluster(folder, workers):
    def start(*what):
        arguments = [sys.executable, "-c", SOURCE, *what]
        return subprocess.Popen(arguments, stdout=subprocess.DEVNULL)

    roles = [("server", folder)] + [("worker", folder)] * workers
    running = []
    try:
        for role in roles:
            running.append(start(*role))
            if role[0] == "server":
                wait_for_server(folder, running[0])
        print(json.dumps({"server": running[0].pid, "workers": [one.pid for one in running[1:]]}), flush=True)
        for _ in while_parent_lives():
            for index, process in enumerate(running):
                if process.poll() is not None:
                    sys.stderr.write(f"{roles[index][0]} {process.pid} ended; another one is started\n")
                    running[index] = start(*roles[index])
    except KeyboardInterrupt:
        pass
    finally:
        for process in running:
            process.terminate()


def wait_for_server(folder, process):
    for _ in range(PATIENCE * 5):
        if process.poll() is not None:
            give_up(f"the server ended with status {process.returncode}")
        try:
            return Client(folder)
        except Exception:
            time.sleep(0.2)
    give_up(f"no server answers in {folder}")


def connect(folder):
    """A client of the server, for which it waits if there was one before."""
    end = time.monotonic() + PATIENCE
    while True:
        try:
            return Client(folder)
        except Exception as error:
            if "version" in str(error).lower():
                give_up(f"{folder}: {reason(error)}")
            if not os.path.exists(os.path.join(folder, CURRENT)):
                give_up(f"no server has its files in {folder}; start one, or leave out --hq-server")
            if time.monotonic() > end:
                give_up(f"no server answers in {folder} for {PATIENCE} s: {reason(error)}")
            time.sleep(0.5)


def submit(folder, path):
    with open(path, encoding="utf-8") as file:
        units = json.load(file)
    attempts, failed = {}, {}
    total = len(units)
    todo = units
    while todo:
        client = connect(folder)
        job = Job(max_fails=None, name="takt")
        for name, command, cwd, _result, log in todo:
            job.program(command, cwd=cwd, name=name, stdout=None, stderr=StdioDef.remove_if_finished(log))
        base = total - len(todo) - len(failed)
        try:
            submitted = client.submit(job)

            def progress(jobs):
                say(done=base + sum(status["finished"] for status in jobs.values()))

            lost = client.connection.wait_for_jobs([submitted.id], progress)
            errors = client.get_failed_tasks(submitted) if lost else {}
            client.forget(submitted)
        except Exception as error:
            say(note=f"the server is lost ({reason(error)}); what is not done is submitted again")
            todo = [unit for unit in todo if not os.path.exists(unit[3])]
            continue
        again = []
        for task, unit in enumerate(todo):
            name = unit[0]
            if task in errors:
                attempts[name] = attempts.get(name, 0) + 1
                why = errors[task].error.strip()
            elif not seen(unit[3]):
                attempts[name] = attempts.get(name, 0) + 1
                why = "it wrote no result"
            else:
                continue
            if attempts[name] < ATTEMPTS:
                again.append(unit)
            else:
                failed[name] = why
        todo = again
    say(failed=failed)


def seen(path):
    """True if a file is there, or comes: a shared file system shows it late."""
    for _ in range(PATIENCE):
        if os.path.exists(path):
            return True
        time.sleep(1)
    return False


if __name__ == "__main__":
    # `python -c SOURCE …` keeps its source for the processes that it starts.
    SOURCE = sys.orig_argv[sys.orig_argv.index("-c") + 1]
    command, *rest = sys.argv[1:]
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    if command == "cluster":
        cluster(rest[0], int(rest[1]))
    else:
        {"server": server, "worker": worker, "submit": submit}[command](*rest)
