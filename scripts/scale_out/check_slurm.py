"""Slurm against one process: a real Slurm with two nodes on this machine, one killed in mid-run, and other ways a build can go wrong.

Usage:  python scripts/scale_out/check_slurm.py MARSYARD [--json FILE]

Needs root, and Debian's or Ubuntu's packages: where no slurmctld is installed they are unpacked into a folder that goes away. The
nodes are two slurmd of one processor each; auth/none stands for munge. Each case builds the same corpus through
scripts/slurm_array.sh as an array of 8 tasks and compares its corpus_id with that of one local process.
"""

import argparse
import contextlib
import json
import os
import pathlib
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time

import yard
from yard import CONFIG, SETS, SHARDS, check, corpus_id, faulty

PARTS = 8
DEBS = "slurmctld slurmd slurm-client slurm-wlm-basic-plugins libmunge2 libhwloc15 libnuma1 liblz4-1 libjson-c5 libyaml-0-2".split()
LONGEST_S = 1200
#: auth/none: all is one user's. cred_expire is also how long a requeued job waits; 120 s elsewhere.
CONF = """ClusterName=yard
SlurmctldHost={host}(127.0.0.1)
AuthType=auth/none
CredType=cred/none
AuthInfo=cred_expire=5
SlurmUser=root
SlurmdUser=root
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool-%n
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd-%n.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd-%n.log
SlurmctldPort={port}
PluginDir={plugins}
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SchedulerParameters=batch_sched_delay=1,sched_interval=5
SlurmdParameters=config_overrides
SlurmdTimeout=10
KillWait=10
ReturnToService=2
JobRequeue=1
"""


def unpacked(folder):
    """The root of the packages, fetched with the system's own apt; the system is left as it is."""
    debs, root = folder / "debs", folder / "root"
    debs.mkdir()
    subprocess.run(["apt-get", "download", "-q", *DEBS], cwd=debs, check=True, capture_output=True)
    for deb in debs.glob("*.deb"):
        subprocess.run(["dpkg", "-x", deb, root], check=True)
    return root


class Slurm:
    """A controller and two nodes."""

    def __init__(self, folder):
        self.folder = folder
        root = pathlib.Path("/") if shutil.which("slurmctld") else unpacked(folder)
        [plugins] = root.glob("usr/lib/*/slurm-wlm")
        os.environ["SLURM_CONF"] = str(folder / "slurm.conf")
        os.environ["LD_LIBRARY_PATH"] = f"{plugins}:{plugins.parent}:{os.environ.get('LD_LIBRARY_PATH', '')}"
        os.environ["PATH"] = f"{root / 'usr/bin'}:{os.environ['PATH']}"
        self.sbin = root / "usr/sbin"
        host, port = socket.gethostname(), free_port()
        conf = CONF.format(host=host, folder=folder, port=port, plugins=plugins)
        for node in ("n1", "n2"):
            conf += f"NodeName={node} NodeHostname={host} NodeAddr=127.0.0.1 Port={free_port()} CPUs=1\n"
            (folder / f"spool-{node}").mkdir()
        conf += "PartitionName=main Nodes=ALL Default=YES State=UP MaxTime=INFINITE\n"
        (folder / "slurm.conf").write_text(conf)
        (folder / "state").mkdir()
        self.daemons = {"ctl": self.start("slurmctld-wlm", "-D")}
        for node in ("n1", "n2"):
            self.daemons[node] = self.start("slurmd-wlm", "-D", "-N", node, "-d", self.sbin / "slurmstepd-wlm")
        wait_for(lambda: self.nodes("idle") == 2, "two idle nodes", 60)
        self.version = self.out("sinfo", "--version").split()[-1]

    def start(self, name, *words):
        return subprocess.Popen([self.sbin / name, *words], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def out(self, *command):
        return subprocess.run(command, capture_output=True, text=True).stdout

    def nodes(self, state):
        return len(self.out("sinfo", "-h", "-N", "-o", "%N", "-t", state).split())

    def jobs(self, *filters):
        """A line a job: id of the array and of the task in it, the job's own id, state, node."""
        return self.out("squeue", "-h", "-r", "-o", "%F_%K %A %t %N", *filters).splitlines()

    def kill_node(self, node):
        """As if its machine were switched off: slurmd, and all that it has started, at once."""
        daemon = self.daemons.pop(node)
        for process in [daemon.pid, *started_on(self.folder, node)]:
            with contextlib.suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)
        daemon.wait()

    def stop(self):
        subprocess.run(["scancel", "--full", "--user=root"], capture_output=True)
        for daemon in self.daemons.values():
            daemon.terminate()
        for daemon in self.daemons.values():
            daemon.wait(timeout=30)


def started_on(folder, node):
    """Processes of jobs that run on a node, those that watch over them first: a job that dies alone is one that failed."""
    watchers, found = set(), []
    for entry in pathlib.Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        with contextlib.suppress(OSError):
            environment = (entry / "environ").read_bytes().split(b"\0")
            if f"SLURM_CONF={folder}/slurm.conf".encode() in environment and f"SLURMD_NODENAME={node}".encode() in environment:
                found.append(int(entry.name))
                parent = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
                if pathlib.Path(f"/proc/{parent}/comm").read_text().startswith("slurmstepd"):
                    watchers.add(parent)
    return [*watchers, *found]


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def wait_for(condition, what, seconds=LONGEST_S):
    deadline = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > deadline:
            sys.exit(f"FAILED: no {what} after {seconds} s")
        time.sleep(0.3)


class Case:
    """One corpus, built by an array."""

    def __init__(self, slurm, folder, marsyard, program=None):
        self.slurm, self.folder, self.marsyard, self.program = slurm, folder, marsyard, program or marsyard
        folder.mkdir(exist_ok=True)

    def submit(self):
        """The ids of the array and of the job that finalizes."""
        code, said = self.run_script()
        check(code == 0, "the array is submitted", said)
        words = [word.rstrip(":") for word in said.split()]
        return [words[words.index(kind) + 1] for kind in ("array", "job")]

    def run_script(self, *extra):
        """Exit code and what it said."""
        script = [yard.ROOT / "scripts/slurm_array.sh", self.config(*extra), self.folder / "corpus", str(PARTS)]
        environment = {**os.environ, "MARSYARD": str(self.program)}
        done = subprocess.run(["bash", *script], capture_output=True, text=True, env=environment, cwd=self.folder)
        return done.returncode, done.stdout + done.stderr

    def config(self, *extra):
        """The corpus's config in a file of its own: the script takes no overrides."""
        laid = self.folder / "plan.yaml"
        if not laid.exists():
            whole = self.folder / "laid"
            subprocess.run([self.marsyard, "generate", CONFIG, "--out", whole, "--plan-only", *SETS], check=True, capture_output=True)
            laid.write_text((whole / "plan.yaml").read_text() + "".join(f"{line}\n" for line in extra))
        return laid

    def done(self):
        return len(list((self.folder / "corpus/receipts").glob("*.json")))

    def end(self, ids):
        """What the job that finalizes said, once it has ended."""
        wait_for(lambda: not self.slurm.jobs(), "end of all jobs")
        return (self.folder / f"slurm-{ids[1]}.out").read_text()

    def said(self, ids):
        return "\n".join(log.read_text() for log in sorted(self.folder.glob(f"slurm-{ids[0]}_*.out")))


def storage_faults(case):
    ids = case.submit()
    final = case.end(ids)
    logs = case.said(ids)
    check(logs.count("exit 75: requeued (0 times before)") == 2, "two tasks with exit 75 requeue themselves", logs)
    return {"what": f"{PARTS} tasks, two end with exit 75 and requeue themselves", "corpus_id": corpus_id(final)}


def told_to_end(case):
    """As at a time limit: the batch shell alone is told."""
    ids = case.submit()
    wait_for(lambda: case.done() >= 1 and case.slurm.jobs("-t", "R"), "running task")
    # By the job's own id: given an array's task, scancel tries again and hits the requeued one too.
    case.slurm.out("scancel", "--batch", "--signal=TERM", case.slurm.jobs("-t", "R")[0].split()[1])
    final = case.end(ids)
    logs = case.said(ids)
    requeued = "exit 75: requeued" in logs or "exit 143: requeued" in logs
    check(requeued, "a task that is told to end does, and requeues itself", logs)
    return {"what": f"{PARTS} tasks, one told to end (SIGTERM, as before a time limit)", "corpus_id": corpus_id(final)}


def node_killed(case):
    ids = case.submit()
    wait_for(lambda: any(job.endswith(" R n2") for job in case.slurm.jobs()) and case.done() >= 2, "task on the second node")
    lost = next(job for job in case.slurm.jobs() if job.endswith(" R n2")).split()[0]
    left = SHARDS - case.done()
    case.slurm.kill_node("n2")
    wait_for(lambda: case.slurm.nodes("down") == 1, "sign that Slurm has seen that the node is gone")
    final = case.end(ids)
    requeued = (case.folder / f"slurm-{lost}.out").read_text()
    check(requeued.count("shards to build") == 2, "the task of the lost node ran again", requeued)
    return {"what": f"{PARTS} tasks, a node killed with {left} of {SHARDS} shards to go", "corpus_id": corpus_id(final)}


def part_that_fails(case):
    ids = case.submit()
    final = case.end(ids)
    missing = ",".join(str(shard) for shard in range(3, SHARDS, PARTS))
    check("cannot be built" in case.said(ids) and case.said(ids).count("cannot be built") == 1, "exit 1 is not tried again")
    check(corpus_id(final) == "none" and missing in final, f"finalize refuses the gap and names {missing}", final)
    case.program = case.marsyard
    ids = case.submit()
    return {"what": "a task ends with exit 1; the same command again with a sound program", "corpus_id": corpus_id(case.end(ids))}


def bad_config(case):
    code, said = case.run_script("rockz: 3")
    check(code == 2 and "rockz" in said and not case.slurm.jobs(), "a bad config: exit 2, nothing submitted", said)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("marsyard", type=lambda path: str(pathlib.Path(path).resolve()))
    parser.add_argument("--json", type=pathlib.Path)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        scratch = pathlib.Path(scratch)
        expected = yard.one_process(args.marsyard, scratch / "one-process")
        (scratch / "slurm").mkdir()
        (scratch / "programs").mkdir()
        slurm = Slurm(scratch / "slurm")
        facts = {"engine": f"Slurm {slurm.version}, 2 nodes", "corpus_id": expected, "shards": SHARDS, "cases": []}

        def case(name, run, program=None):
            print(name, flush=True)
            begun = time.monotonic()
            fact = run(Case(slurm, scratch / name.replace(" ", "-"), args.marsyard, program))
            if fact:
                check(fact["corpus_id"] == expected, "corpus_id is that of one process")
                facts["cases"].append({**fact, "wall_s": round(time.monotonic() - begun, 1)})

        try:
            parts = [f"{part}/{PARTS}" for part in (1, 4)]
            case("storage faults", storage_faults, faulty(scratch / "programs", args.marsyard, once=parts))
            case("told to end", told_to_end)
            case("part that fails", part_that_fails, faulty(scratch / "programs", args.marsyard, never=[f"3/{PARTS}"]))
            case("bad config", bad_config)
            case("node killed", node_killed)
        finally:
            slurm.stop()
    if args.json:
        args.json.write_text(json.dumps(facts, indent=1) + "\n")


if __name__ == "__main__":
    main()
