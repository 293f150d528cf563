# SPDX-License-Identifier: MIT OR Apache-2.0
"""HyperQueue for takt-work: a server with workers, each in its own process, and a client that submits units.

    cluster DIR N     a server in DIR and N workers of one core, each started again if it ends
    server DIR        the server alone
    worker DIR        a worker of the server in DIR; it looks for the next one if that ends
    submit DIR UNITS  runs the units of a file as one job, until each has ended or the server is lost

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
from datetime import timedelta

from hyperqueue import Client, Job
from hyperqueue.ffi.cluster import Cluster
from hyperqueue.ffi.protocol import ResourceRequest
from hyperqueue.output import StdioDef

PATIENCE = 60  # seconds; PATIENCE in queue.rs
THREADS = "RAYON_NUM_THREADS"  # THREADS in lib.rs
CURRENT = "hq-current"


def say(**line):
    print(json.dumps(line), flush=True)


def give_up(text):
    sys.stderr.write(f"takt: {text}\n")
    raise SystemExit(1)


def reason(error):
    """Message of the error, without the stack trace."""
    return str(error).split("\n\nStack backtrace")[0].strip().replace("\n", " ")


def while_parent_lives():
    """Ends when the parent process is gone."""
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
        except Exception as error:  # the server is still starting, or it is gone
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
    """Client of the server; waits if a server existed before."""
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
    client = connect(folder)
    job = Job(max_fails=None, name="takt")
    for command, cwd, log, cpus, seconds in units:
        job.program(
            command, cwd=cwd, stdout=None, stderr=StdioDef.from_path(log), env={THREADS: str(cpus)},
            resources=ResourceRequest(cpus=cpus, min_time=timedelta(seconds=seconds)),
        )
    try:
        submitted = client.submit(job)
        lost = client.connection.wait_for_jobs(
            [submitted.id], lambda jobs: say(done=sum(status["finished"] for status in jobs.values()))
        )
        errors = client.get_failed_tasks(submitted) if lost else {}
        client.forget(submitted)
    except Exception as error:
        say(ended={"lost": reason(error)})
    else:
        say(ended={"whole": {str(task): errors[task].error.strip() for task in errors}})


if __name__ == "__main__":
    # `python -c SOURCE …`: keep the source for child processes.
    SOURCE = sys.orig_argv[sys.orig_argv.index("-c") + 1]
    command, *rest = sys.argv[1:]
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    if command == "cluster":
        cluster(rest[0], int(rest[1]))
    else:
        {"server": server, "worker": worker, "submit": submit}[command](*rest)
