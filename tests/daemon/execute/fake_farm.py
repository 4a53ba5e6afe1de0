#!/usr/bin/python3 -ISB
"""A farm on one machine, for tests: sbatch, squeue and scancel, and the same for command templates.

Which of them it is, its name says (links in a folder of $PATH). All state lies in $FAKE_FARM:
  nodes           names of nodes, one a line
  jobs/ID/        name, folder, script, node, args; pid of the running script; code: its wait status
  jobs/ID/state   put there by a test: what squeue says, whatever is so
  calls           a line for each call: the program's name and its arguments
  faults/...      made and removed by a test:
     PROGRAM.fail      exits with 1 and does nothing
     PROGRAM.hang      never answers
     sbatch.lost       takes the job, and dies before it answers (once)
     hold              jobs are taken, but wait
     no_disk           jobs end with 75 at once, as where their folder is not there
     keep              what is cancelled goes on
"""

import os
import signal
import subprocess
import sys
import time

FARM = os.environ["FAKE_FARM"]
PROGRAM = os.path.basename(sys.argv[0])
ARGS = sys.argv[1:]


def path(*parts):
    return os.path.join(FARM, *parts)


def fault(name):
    return os.path.exists(path("faults", name))


def read(*parts):
    try:
        with open(path(*parts), encoding="utf-8") as file:
            return file.read()
    except FileNotFoundError:
        return ""


def write(text, *parts):
    temporary = path(*parts[:-1], ".new")
    with open(temporary, "w", encoding="utf-8") as file:
        file.write(text)
    os.rename(temporary, path(*parts))


def jobs():
    return sorted((name for name in os.listdir(path("jobs")) if name.isdigit()), key=int)


def take(name, folder, script, log, excluded, args):
    nodes = [node for node in read("nodes").split() if node not in excluded]
    if not nodes:
        sys.exit("sbatch: error: Batch job submission failed: Requested node configuration is not available")
    number = 1
    while True:
        try:
            os.mkdir(path("jobs", str(number)))
            break
        except FileExistsError:
            number += 1
    number = str(number)
    for key, value in (("name", name), ("folder", folder), ("script", script), ("log", log), ("node", nodes[0]),
                       ("args", "\n".join(args))):
        write(value, "jobs", number, key)
    if fault("no_disk"):
        write(str(75 << 8), "jobs", number, "code")
    elif not fault("hold"):
        # A keeper outlives this call, and says how the script ended.
        if os.fork() == 0:
            os.setsid()
            for descriptor in range(3):
                os.close(descriptor)
            os.open("/dev/null", os.O_RDWR)
            os.open(log, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600)
            os.dup(1)
            script = subprocess.Popen(["/bin/sh", script], start_new_session=True)
            write(str(script.pid), "jobs", number, "pid")
            code = script.wait()
            write(str(-code if code < 0 else code << 8), "jobs", number, "code")
            os._exit(0)
    return number


def state(number):
    """(state, wait status)"""
    said = read("jobs", number, "state").strip()
    if said:
        return said, 0
    code = read("jobs", number, "code")
    if not code:
        return ("RUNNING" if os.path.exists(path("jobs", number, "pid")) else "PENDING"), 0
    if os.path.exists(path("jobs", number, "cancelled")):
        return "CANCELLED", int(code)
    return ("COMPLETED" if code == "0" else "FAILED"), int(code)


def cancel(number):
    if fault("keep") or not os.path.exists(path("jobs", number)):
        return
    write("", "jobs", number, "cancelled")
    pid = read("jobs", number, "pid")
    if not pid:
        write("0", "jobs", number, "code")
        return
    try:
        os.kill(int(pid), signal.SIGTERM)
    except ProcessLookupError:
        pass


def options():
    return dict(word.partition("=")[::2] for word in ARGS if word.startswith("--"))


WORDS = {"PENDING": "waiting", "RUNNING": "running", "COMPLETED": "completed", "FAILED": "failed",
         "CANCELLED": "cancelled", "NODE_FAIL": "node_failed"}


def template_line(number):
    name, status = state(number)
    print(number, WORDS.get(name, name), read("jobs", number, "node"), status >> 8)


def main():
    with open(path("calls"), "a", encoding="utf-8") as file:
        file.write(" ".join([PROGRAM] + ARGS) + "\n")
    if fault(PROGRAM + ".hang"):
        time.sleep(1000)
    if fault(PROGRAM + ".fail"):
        sys.exit(PROGRAM + ": error: Unable to contact slurm controller (connect failure)")
    if PROGRAM == "sbatch":
        given = options()
        number = take(given["--job-name"], given["--chdir"], ARGS[-1], given["--output"],
                      given.get("--exclude", "").split(","), ARGS)
        if fault("sbatch.lost"):
            os.remove(path("faults", "sbatch.lost"))
            os.kill(os.getpid(), signal.SIGKILL)
        print(number)
    elif PROGRAM == "squeue":
        for number in jobs():
            name, status = state(number)
            print(number, name, status, read("jobs", number, "node"), "None", read("jobs", number, "name"),
                  read("jobs", number, "folder"), "", sep="|")
    elif PROGRAM == "scancel":
        for number in ARGS:
            cancel(number)
    elif PROGRAM == "farm-submit":
        name, folder, script, log = ARGS[:4]
        number = take(name, folder, script, log, [], ARGS)
        if fault("farm-submit.lost"):
            os.remove(path("faults", "farm-submit.lost"))
            os.kill(os.getpid(), signal.SIGKILL)
        print("taken as", number)
    elif PROGRAM == "farm-status":
        for number in jobs():
            if number in ARGS:
                template_line(number)
    elif PROGRAM == "farm-find":
        for number in jobs():
            if read("jobs", number, "name") == ARGS[0]:
                template_line(number)
    elif PROGRAM == "farm-cancel":
        cancel(ARGS[0])


main()
