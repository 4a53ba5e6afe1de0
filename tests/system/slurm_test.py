#!/usr/bin/env python3
"""patinad with a real Slurm of one node: jobs run there, and survive what may happen to it.

usage: slurm_test.py PATINA PATINAD FAKE_WORKER FOLDER [--rounds N] [NAME...]

FOLDER holds Slurm's files and the daemon's while it runs, and is made anew. With --rounds: in place of the tests, so many
rounds of random faults. NAMEs are tests to run; default: all. Exit code 77: Slurm cannot run here, and why.
"""

import argparse
import http.client
import json
import os
import random
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time

import slurm_node
from slurm_node import until


class UnixConnection(http.client.HTTPConnection):
    def __init__(self, path):
        super().__init__("localhost", timeout=30)
        self.path = path

    def connect(self):
        self.sock = socket.socket(socket.AF_UNIX)
        self.sock.connect(self.path)


class Patinad:
    """A daemon with its folders. Workers are fake unless `real`."""

    def __init__(self, arguments, name, real=False, kind="slurm"):
        self.arguments = arguments
        self.folder = os.path.join(arguments.folder, name)
        shutil.rmtree(self.folder, ignore_errors=True)
        for made in ("in", "out"):
            os.makedirs(os.path.join(self.folder, made))
        self.config = os.path.join(self.folder, "config.json")
        # Its path must be short.
        self.socket = os.path.join(arguments.sockets, name)
        executor = {"kind": kind}
        if kind == "slurm":
            executor.update(poll_s=0.1, result_wait_s=0.5, command_timeout_s=15, jobs=10)
        with open(self.config, "w", encoding="utf-8") as file:
            json.dump({"version": 1, "state_dir": "state", "out": "out", "input_roots": ["in"], "executor": executor,
                       "api": {"socket": self.socket},
                       "worker": arguments.patina if real else arguments.fake_worker, "cores": 1,
                       "limits": {"threads": 1, "memory_mb": 200 if not real else 0}, "stop_grace_s": 3600,
                       "retry": {"base_ms": 1, "max_ms": 2, "max_attempts": 1000}}, file)
        self.process = None
        self.start()

    def start(self):
        with open(os.path.join(self.folder, "log"), "a", encoding="utf-8") as log:
            self.process = subprocess.Popen([self.arguments.patinad, "--config", self.config], stdout=log, stderr=log)
        def answers():
            assert self.process.poll() is None, self.log()
            return self.ask("GET", "/readyz", missing=True) is not None
        until(answers, "the daemon answers")

    def kill(self):
        self.process.kill()
        self.process.wait()

    def stop(self):
        self.process.terminate()
        assert self.process.wait(60) == 0, self.log()

    def log(self):
        with open(os.path.join(self.folder, "log"), encoding="utf-8") as file:
            return file.read()

    def ask(self, method, target, body=None, missing=False):
        connection = UnixConnection(self.socket)
        try:
            connection.request(method, target, body and json.dumps(body), {"Content-Type": "application/json"} if body else {})
            answer = connection.getresponse()
            text = answer.read()
        except OSError:
            if missing:
                return None
            raise
        finally:
            connection.close()
        assert answer.status < 300, (target, answer.status, text)
        return json.loads(text) if text.startswith(b"{") else text

    def input_of(self, asset):
        return os.path.join(self.folder, "in", asset)

    def submit(self, asset, *behaviour):
        """Each line of behaviour as fake_worker.cpp takes it. Returns the job's id."""
        os.makedirs(self.input_of(asset), exist_ok=True)
        if behaviour:
            os.mkfifo(os.path.join(self.input_of(asset), "go"))
            with open(os.path.join(self.input_of(asset), "input.png"), "w", encoding="utf-8") as file:
                file.write(asset)
            with open(os.path.join(self.input_of(asset), "behaviour"), "w", encoding="utf-8") as file:
                file.write("\n".join(behaviour) + "\n")
        job = {"version": 1, "kind": "material", "asset": asset, "folder": self.input_of(asset)}
        if not behaviour:
            job.update(quality="preview", seed=3)
        return self.ask("POST", "/v1/jobs", {"job": job})["id"]

    def go(self, asset):
        """For one that waits."""
        os.close(os.open(os.path.join(self.input_of(asset), "go"), os.O_WRONLY))

    def job(self, number):
        return self.ask("GET", f"/v1/jobs/{number}")

    def until_state(self, number, *states):
        return until(lambda: (job := self.job(number))["state"] in states and job, f"job {number} is {states}")

    def until_trains(self, number):
        return until(lambda: (self.job(number).get("progress") or {}).get("stage") == "train", f"job {number} trains")

    def revisions(self, asset):
        folder = os.path.join(self.folder, "out", asset)
        return sorted(name for name in os.listdir(folder) if name.startswith("r0")) if os.path.isdir(folder) else []

    def attempts(self, number):
        return self.job(number)["attempt"]


def workers():
    return [pid for pid, name in slurm_node.descendants() if name == "fake_worker"]


def files_of(folder):
    found = {}
    for where, _, names in os.walk(folder):
        for name in names:
            if name not in ("run.json", "report.html"):
                path = os.path.join(where, name)
                with open(path, "rb") as file:
                    found[os.path.relpath(path, folder)] = file.read()
    return found


# ---- The tests: each gets the options and the Slurm.

def test_a_local_and_a_slurm_run_give_the_same_bytes(arguments, _):
    containers = []
    for kind in ("local", "slurm"):
        daemon = Patinad(arguments, "bytes_" + kind, real=True, kind=kind)
        subprocess.run([arguments.patina, "sample", "--out", daemon.input_of("wall"), "--size", "32", "--kind", "material",
                        "--seed", "5"], check=True, stdout=subprocess.DEVNULL)
        os.remove(os.path.join(daemon.input_of("wall"), "job.json"))
        job = daemon.submit("wall")
        daemon.until_state(job, "succeeded", "failed", "buried")
        assert daemon.job(job)["state"] == "succeeded", daemon.job(job)
        containers.append(files_of(os.path.join(daemon.folder, "out", "wall", "r0001")))
        daemon.stop()
    assert "manifest.json" in containers[0] and len(containers[0]) > 3, list(containers[0])
    assert containers[0].keys() == containers[1].keys()
    for name, content in containers[0].items():
        # Folders differ, and the manifest names none of them.
        assert content == containers[1][name], f"{name} differs"


def test_progress_reaches_the_api_and_cancel_the_worker(arguments, slurm):
    daemon = Patinad(arguments, "cancel")
    jobs = [daemon.submit(f"asset{i}", "0 hang") for i in range(4)]
    waits = daemon.submit("waits", "0 hang")
    for job in jobs:
        daemon.until_trains(job)
    said = until(lambda: (daemon.job(waits).get("progress") or {}).get("message"), "it says how it waits")
    assert "waits on the farm" in said, said
    daemon.ask("POST", f"/v1/jobs/{waits}/cancel")
    daemon.until_state(waits, "cancelled")
    daemon.ask("POST", f"/v1/jobs/{jobs[0]}/cancel")
    daemon.until_state(jobs[0], "cancelled")
    until(lambda: len(workers()) == 3, "one worker less")
    # The same output again, now that nothing writes it.
    with open(os.path.join(daemon.input_of("asset0"), "behaviour"), "w", encoding="utf-8") as file:
        file.write("0 ok\n")
    daemon.ask("POST", f"/v1/jobs/{jobs[0]}/retry")
    daemon.until_state(jobs[0], "succeeded")
    for job in jobs[1:]:
        daemon.ask("POST", f"/v1/jobs/{job}/cancel")
    for job in jobs[1:]:
        daemon.until_state(job, "cancelled")
    daemon.stop()
    until(lambda: slurm.say("squeue", "-h") == "", "nothing is left on the farm")


def test_a_worker_that_is_killed_is_replaced(arguments, _):
    daemon = Patinad(arguments, "killed")
    job = daemon.submit("wall", "1 hang", "0 ok")
    daemon.until_trains(job)
    os.kill(workers()[0], signal.SIGKILL)
    daemon.until_state(job, "succeeded")
    assert daemon.attempts(job) == 2
    assert daemon.revisions("wall") == ["r0001"]
    bad = daemon.submit("bad", "0 bad")
    assert daemon.until_state(bad, "failed")["attempt"] == 1, "bad input is not tried again"
    daemon.stop()


def test_a_node_that_crashes_is_left_out_unless_it_is_the_only_one(arguments, slurm):
    daemon = Patinad(arguments, "crash")
    job = daemon.submit("wall", "1 wait", "0 ok")
    daemon.until_trains(job)
    slurm.crash_node()
    failed_nodes = os.path.join(daemon.folder, "state", "jobs", str(job), "failed_nodes")
    until(lambda: os.path.exists(failed_nodes), "the node is known to have failed")
    slurm.start_node()
    daemon.until_state(job, "succeeded")
    assert daemon.attempts(job) >= 2
    assert daemon.revisions("wall") == ["r0001"]
    assert "node_failed" in daemon.log(), daemon.log()
    daemon.stop()


def test_jobs_wait_for_a_controller_that_is_down(arguments, slurm):
    daemon = Patinad(arguments, "down")
    runs = daemon.submit("runs", "0 wait")
    daemon.until_trains(runs)
    slurm.stop_controller()
    new = daemon.submit("new", "0 ok")
    problems = until(lambda: daemon.ask("GET", "/v1/status")["problems"], "the status says that Slurm is down")
    assert "Slurm does not say how its jobs are" in problems[0], problems
    # The worker does its work, and that is seen though nobody can be asked.
    daemon.go("runs")
    daemon.until_state(runs, "succeeded")
    assert daemon.job(new)["state"] == "running" and not daemon.revisions("new")
    slurm.start_controller()
    daemon.until_state(new, "succeeded")
    assert daemon.attempts(new) == 1
    until(lambda: not daemon.ask("GET", "/v1/status")["problems"], "all is well again")
    daemon.stop()


def test_a_daemon_finds_its_jobs_again(arguments, slurm):
    daemon = Patinad(arguments, "again")
    jobs = [daemon.submit(f"asset{i}", "0 wait") for i in range(3)]
    for job in jobs:
        daemon.until_trains(job)
    pids = sorted(workers())
    assert len(pids) == 3
    daemon.stop()
    assert sorted(workers()) == pids, "a stop of the daemon is none of its jobs'"
    daemon.start()
    daemon.go("asset0")
    daemon.until_state(jobs[0], "succeeded")
    daemon.kill()
    daemon.go("asset1")
    until(lambda: len(workers()) == 1, "the second job ends while nobody looks")
    daemon.start()
    daemon.until_state(jobs[1], "succeeded")
    daemon.go("asset2")
    daemon.until_state(jobs[2], "succeeded")
    for i, job in enumerate(jobs):
        assert daemon.attempts(job) == 1
        assert daemon.revisions(f"asset{i}") == ["r0001"]
    daemon.stop()
    until(lambda: slurm.say("squeue", "-h") == "", "nothing is left on the farm")


def test_check_config_asks_slurm(arguments, _):
    config = os.path.join(arguments.folder, "check.json")
    for executor, code, said in (({"partition": "test"}, 0, "the configuration is good"),
                                 ({"partition": "nosuch"}, 3, "nvalid partition"),
                                 ({"sbatch_arguments": ["--array=1-9"]}, 3, "--array")):
        with open(config, "w", encoding="utf-8") as file:
            json.dump({"version": 1, "state_dir": "check", "out": "out", "cores": 1, "limits": {"memory_mb": 100},
                       "executor": {"kind": "slurm", **executor}}, file)
        answer = subprocess.run([arguments.patinad, "--check-config", "--config", config], capture_output=True, text=True,
                                check=False)
        assert answer.returncode == code, (executor, answer)
        assert said in answer.stdout + answer.stderr, (executor, answer)


def test_check_config_only_warns_of_a_slurm_that_is_down(arguments, slurm):
    slurm.stop_controller()
    config = os.path.join(arguments.folder, "check.json")
    with open(config, "w", encoding="utf-8") as file:
        json.dump({"version": 1, "state_dir": "check", "out": "out", "executor": {"kind": "slurm"}}, file)
    answer = subprocess.run([arguments.patinad, "--check-config", "--config", config], capture_output=True, text=True,
                            check=False)
    slurm.start_controller()
    assert answer.returncode == 0, answer
    assert "warning: /executor: Slurm cannot be asked" in answer.stderr, answer


def fault_round(arguments, slurm, number):
    """Random faults while jobs run; then nothing is lost, and nothing was published twice."""
    chance = random.Random(number)
    daemon = Patinad(arguments, f"round{number}")
    steps = ["begin", "staged", "verified", "fenced", "published", "reported"]
    jobs = {}
    for i in range(6):
        asset = f"asset{i}"
        lines = [f"{attempt} die {chance.choice(steps)}" for attempt in (1, 2) if chance.random() < 0.5]
        jobs[asset] = daemon.submit(asset, "0 ok", *lines)
    for _ in range(6):
        fault = chance.choice(["daemon", "controller", "node", "worker", "stop"])
        if fault == "daemon":
            daemon.kill()
            daemon.start()
        elif fault == "stop":
            daemon.stop()
            daemon.start()
        elif fault == "controller":
            slurm.stop_controller()
            time.sleep(chance.random())
            slurm.start_controller()
        elif fault == "node":
            slurm.crash_node()
            time.sleep(chance.random())
            slurm.start_node()
        else:
            for pid in workers()[:1]:
                try:
                    os.kill(pid, signal.SIGKILL)
                except ProcessLookupError:
                    pass
        time.sleep(chance.random() / 2)
    for asset, job in jobs.items():
        daemon.until_state(job, "succeeded")
        assert daemon.revisions(asset) == ["r0001"], (asset, daemon.revisions(asset))
    daemon.stop()
    print(f"round {number}: {len(jobs)} jobs, {daemon.log().count('job_started')} attempts", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    for name in ("patina", "patinad", "fake_worker", "folder"):
        parser.add_argument(name)
    parser.add_argument("names", nargs="*")
    parser.add_argument("--rounds", type=int, default=0)
    arguments = parser.parse_args()
    for name in ("patina", "patinad", "fake_worker", "folder"):
        setattr(arguments, name, os.path.abspath(getattr(arguments, name)))
    os.makedirs(arguments.folder, exist_ok=True)
    tests = {name: test for name, test in globals().items() if name.startswith("test_")}
    try:
        with slurm_node.SlurmNode(os.path.join(arguments.folder, "slurm")) as slurm, \
                tempfile.TemporaryDirectory() as arguments.sockets:
            for number in range(arguments.rounds):
                fault_round(arguments, slurm, number)
            for name, test in tests.items() if arguments.rounds == 0 else ():
                if arguments.names and name not in arguments.names:
                    continue
                slurm.until_idle()
                began = time.monotonic()
                test(arguments, slurm)
                print(f"{name}: {time.monotonic() - began:.1f} s", flush=True)
    except slurm_node.NotHere as reason:
        print(f"skipped: {reason}")
        return 77
    print("all is well")
    return 0


if __name__ == "__main__":
    sys.exit(main())
