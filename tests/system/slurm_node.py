"""A Slurm of one node for tests, with its own ports and files: never for a network, as nobody is asked who he is."""

import ctypes
import os
import shutil
import signal
import socket
import subprocess
import time

CONFIGURATION = """ClusterName=patina
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={controller_port}
SlurmdPort={node_port}
AuthType=auth/none
CredType=cred/none
CommunicationParameters=NoInAddrAny
SlurmUser=root
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
SlurmdParameters=config_overrides
SchedulerParameters=sched_interval=1,sched_min_interval=20000,batch_sched_delay=0
MpiDefault=none
ReturnToService=2
SlurmdTimeout=3
MessageTimeout=2
KillWait=1
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/controller.pid
SlurmdPidFile={folder}/node.pid
SlurmctldLogFile={folder}/controller.log
SlurmdLogFile={folder}/node.log
NodeName={host} NodeAddr=127.0.0.1 CPUs=4 RealMemory=4000 State=UNKNOWN
PartitionName=test Nodes={host} Default=YES MaxTime=INFINITE State=UP
"""

PR_SET_CHILD_SUBREAPER = 36


class NotHere(Exception):
    """Slurm cannot run on this machine; the reason."""


def free_ports(count):
    sockets = [socket.socket() for _ in range(count)]
    for one in sockets:
        one.bind(("127.0.0.1", 0))
    ports = [one.getsockname()[1] for one in sockets]
    for one in sockets:
        one.close()
    return ports


def descendants():
    """(process id, name) of all processes below this one."""
    parents = {}
    for entry in os.listdir("/proc"):
        if not entry.isdigit():
            continue
        try:
            with open(f"/proc/{entry}/stat", encoding="utf-8", errors="replace") as file:
                text = file.read()
        except OSError:
            continue
        name = text[text.index("(") + 1:text.rindex(")")]
        state, parent = text[text.rindex(")") + 2:].split()[:2]
        if state != "Z":
            parents[int(entry)] = (int(parent), name)
    found, below = [], {os.getpid()}
    while below:
        children = [pid for pid, (parent, _) in parents.items() if parent in below]
        found += [(pid, parents[pid][1]) for pid in children]
        below = set(children)
    return found


class SlurmNode:
    """Controller and node, while in a `with`; SLURM_CONF in the environment names them."""

    def __init__(self, folder):
        self.folder = folder
        self.conf = os.path.join(folder, "slurm.conf")
        self.controller = self.node = None

    def __enter__(self):
        for program in ("slurmctld", "slurmd", "sbatch", "squeue", "scancel", "sinfo"):
            if not shutil.which(program):
                raise NotHere(f"there is no {program} (package slurm-wlm)")
        if os.geteuid() != 0:
            raise NotHere("Slurm's daemons need root")
        shutil.rmtree(self.folder, ignore_errors=True)
        for name in ("state", "spool"):
            os.makedirs(os.path.join(self.folder, name))
        controller_port, node_port = free_ports(2)
        with open(self.conf, "w", encoding="utf-8") as file:
            file.write(CONFIGURATION.format(host=socket.gethostname().split(".")[0], folder=self.folder,
                                            controller_port=controller_port, node_port=node_port))
        os.environ["SLURM_CONF"] = self.conf
        # Orphans come to this process: so it can end what outlives a daemon that is killed.
        ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
        self.start_controller(clear=True)
        self.start_node()
        try:
            self.until_idle()
        except AssertionError:
            logs = ""
            for name in ("controller", "node"):
                path = os.path.join(self.folder, name + ".log")
                if os.path.exists(path):
                    with open(path, encoding="utf-8", errors="replace") as file:
                        logs += f"{name}:\n" + "".join(file.readlines()[-8:])
            self.__exit__()
            raise NotHere("Slurm does not start here:\n" + logs) from None
        return self

    def __exit__(self, *_):
        for process in (self.node, self.controller):
            if process and process.poll() is None:
                process.kill()
                process.wait()
        for pid, _ in descendants():
            try:
                os.kill(pid, signal.SIGKILL)
            except ProcessLookupError:
                pass

    def start_controller(self, clear=False):
        words = ["slurmctld", "-D", "-f", self.conf] + (["-c"] if clear else [])
        self.controller = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def start_node(self):
        name = socket.gethostname().split(".")[0]
        self.node = subprocess.Popen(["slurmd", "-D", "-f", self.conf, "-N", name], stdout=subprocess.DEVNULL,
                                     stderr=subprocess.DEVNULL)

    def stop_controller(self):
        """In order: one that is killed forgets the jobs of the last seconds, and drains the node when it counts on anew."""
        self.controller.terminate()
        self.controller.wait()

    def crash_node(self):
        """As if the machine had lost its power: nothing of it can still tell of its end."""
        self.node.kill()
        self.node.wait()
        for wanted in ("slurmstepd", ""):
            for pid, name in descendants():
                if (name == "slurmstepd" if wanted else name == "fake_worker"):
                    os.kill(pid, signal.SIGKILL)

    def until_idle(self):
        until(lambda: self.say("sinfo", "-h", "-o", "%T") in ("idle", "mixed", "allocated"), "the node is up", 30)

    @staticmethod
    def say(*words):
        try:
            return subprocess.run(words, capture_output=True, text=True, timeout=20, check=False).stdout.strip()
        except subprocess.TimeoutExpired:
            return ""


def until(condition, what, limit_s=90):
    end = time.monotonic() + limit_s
    while True:
        found = condition()
        if found:
            return found
        assert time.monotonic() < end, f"within {limit_s} s it did not come true that {what}"
        time.sleep(0.02)
