"""Ray against one process: a two-node cluster on this machine, one node killed in mid-run, and other ways in which a build can go wrong.

Usage:  python scripts/scale_out/check_ray.py MARSYARD [--json FILE] [--place PREFIX]     (pip install ray)

Each case builds the same corpus through scripts/ray_generate.py and compares its corpus_id with that of one local process. PREFIX is
where the cases' corpora go: a folder, or a URL that the environment has the credentials for; default: a folder that goes away.
"""

import argparse
import contextlib
import json
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import time

import ray
import yard
from ray.cluster_utils import Cluster
from yard import SETS, SHARDS, check, corpus_id, faulty

sys.path.insert(0, str(yard.ROOT / "scripts"))
import ray_generate  # noqa: E402

OBJECT_STORE_BYTES = 80_000_000
#: Shards that are there before a build is disturbed.
BEFORE = SHARDS // 6


class Case:
    """One corpus, built by a driver in a process of its own."""

    def __init__(self, place, marsyard, address, binary=None):
        self.place, self.marsyard, self.address, self.binary = place, marsyard, address, binary or marsyard

    def start(self, *extra):
        command = [sys.executable, yard.ROOT / "scripts/ray_generate.py", yard.CONFIG, "--out", self.place, *SETS]
        command += ["--address", self.address, "--binary", self.binary, *extra]
        # A session of its own: a signal to the driver is a signal to the driver alone. Shells start background jobs deaf to Ctrl-C.
        return subprocess.Popen(
            command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, start_new_session=True,
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)
        )

    def run(self, *extra):
        driver = self.start(*extra)
        said = driver.communicate()[1]
        return driver.returncode, said

    def missing(self):
        done = subprocess.run([self.marsyard, "status", self.place, "--missing"], capture_output=True, text=True)
        return ray_generate.from_ranges(done.stdout) if done.returncode == 0 else list(range(SHARDS))

    def start_and_wait(self):
        """A driver that has some shards behind it and some before it."""
        driver = self.start()
        while SHARDS - len(self.missing()) < BEFORE:
            if driver.poll() is not None:
                sys.exit(f"FAILED: the driver ended before {BEFORE} shards were there:\n{driver.stderr.read()}")
            time.sleep(0.1)
        return driver


def builds_below(ancestor):
    """Process ids of the builds of shards that descend from a process."""
    parents, builds = {}, []
    for entry in pathlib.Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        try:
            parents[int(entry.name)] = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
            if b"--shards" in (entry / "cmdline").read_bytes().split(b"\0"):
                builds.append(int(entry.name))
        except OSError:
            continue  # It has ended meanwhile.

    def descends(process):
        while process in parents and process != ancestor:
            process = parents[process]
        return process == ancestor

    return [build for build in builds if descends(build)]


def alive(processes):
    """Those that run still, each with the start of its status; a zombie does not run."""
    running = {}
    for process in processes:
        with contextlib.suppress(OSError):
            status = pathlib.Path(f"/proc/{process}/status").read_text()
            if "State:\tZ" not in status:
                running[process] = status[:300]
    return running


def node_killed(case, cluster, node):
    driver = case.start_and_wait()
    raylet = node.all_processes["raylet"][0].process.pid
    while not (running := builds_below(raylet)):
        if driver.poll() is not None:
            sys.exit(f"FAILED: the driver ended before the node could be killed:\n{driver.stderr.read()}")
    left = len(case.missing())
    cluster.remove_node(node, allow_graceful=False)
    gone = time.monotonic() + 30
    while alive(running) and time.monotonic() < gone:
        time.sleep(0.1)
    orphans = alive(running)
    said = driver.communicate()[1]
    check(driver.returncode == 0, f"exit 0 though a node was killed under {len(running)} build, with {left} shards to go", said)
    check(not orphans, "no build outlives its node", orphans)
    return {"what": f"a node killed with {left} of {SHARDS} shards to go and a build on it", "corpus_id": corpus_id(said)}


def interrupted(case):
    driver = case.start_and_wait()
    driver.send_signal(signal.SIGINT)
    said = driver.communicate()[1]
    left = len(case.missing())
    check(driver.returncode == 75 and "goes on from there" in said, "Ctrl-C: exit 75, and it says how to go on", said)
    check(0 < left < SHARDS, f"what was built stays: {SHARDS - left} of {SHARDS} shards", said)
    code, said = case.run()
    check(code == 0 and f"{left} shards to build" in said, f"the same command builds the {left} missing shards alone", said)
    built = corpus_id(said)
    code, said = case.run("--set", "seed=7")
    check(code == 2 and "seed" in said, "another plan in the same place: exit 2, the difference is shown", said)
    return {"what": f"Ctrl-C with {left} of {SHARDS} shards to go, and the same command again", "corpus_id": built}


def storage_faults(case, once):
    code, said = case.run()
    check(code == 0 and said.count("tried again") == len(once), f"{len(once)} tasks with exit 75 are tried again", said)
    return {"what": f"{len(once)} tasks end with exit 75", "corpus_id": corpus_id(said)}


def shard_that_fails(case, never):
    code, said = case.run()
    check(code == 1 and f"not built: shards {never[0]} " in said, "exit 1, and the shard is named", said)
    check(said.count("cannot be built") == 1, "exit 1 is not tried again", said)
    check(case.missing() == list(never), "all other shards are there")
    case.binary = case.marsyard
    code, said = case.run()
    check(code == 0 and "1 shards to build" in said, "the same command with a sound program builds it", said)
    return {"what": "a task ends with exit 1; the same command again with a sound program", "corpus_id": corpus_id(said)}


def bad_config(case):
    code, said = case.run("--set", "scene.rocks.coumt=3")
    check(code == 2 and "coumt" in said and "shards to build" not in said, "a bad config: exit 2, no task", said)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("marsyard", type=lambda path: str(pathlib.Path(path).resolve()))
    parser.add_argument("--json", type=pathlib.Path)
    parser.add_argument("--place", help="folder or URL for the cases' corpora")
    args = parser.parse_args()
    # Ray's workers are nicer than other programs, and would wait for whatever else the machine does.
    os.environ["RAY_worker_niceness"] = "0"
    with tempfile.TemporaryDirectory() as scratch:
        scratch = pathlib.Path(scratch)
        prefix = str(args.place or scratch).rstrip("/")
        expected = yard.one_process(args.marsyard, scratch / "one-process")
        started = time.monotonic()
        node_args = {"num_cpus": 1, "object_store_memory": OBJECT_STORE_BYTES}
        cluster = Cluster(initialize_head=True, head_node_args={**node_args, "include_dashboard": False})
        # Another address than the head's, so that no driver joins the cluster by the node that is to be killed.
        second = cluster.add_node(**node_args, node_ip_address="127.0.0.2")
        print(f"two nodes up in {time.monotonic() - started:.0f} s", flush=True)
        facts = {"engine": f"Ray {ray.__version__}, 2 nodes", "corpus_id": expected, "shards": SHARDS, "cases": []}

        def case(name, run, *arguments, binary=None):
            print(name, flush=True)
            begun = time.monotonic()
            fact = run(Case(f"{prefix}/{name.replace(' ', '-')}", args.marsyard, cluster.address, binary), *arguments)
            if fact:
                check(fact["corpus_id"] == expected, "corpus_id is that of one process")
                facts["cases"].append({**fact, "wall_s": round(time.monotonic() - begun, 1)})

        try:
            case("node killed", node_killed, cluster, second)
            case("interrupted", interrupted)
            once, never = [2, 5, 11], [7]
            case("storage faults", storage_faults, once, binary=faulty(scratch, args.marsyard, once=once))
            case("a shard that fails", shard_that_fails, never, binary=faulty(scratch, args.marsyard, never=never))
            case("bad config", bad_config)
        finally:
            cluster.shutdown()
    if args.json:
        args.json.write_text(json.dumps(facts, indent=1) + "\n")


if __name__ == "__main__":
    main()
