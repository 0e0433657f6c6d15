"""Builds one corpus on all machines of a Ray cluster; the same bytes as one process makes (ray on every node: pip install ray).

Usage:  python scripts/ray_generate.py CONFIG --out PLACE [--set KEY=VALUE ...] [--threads N] [--shards-per-task N]
                                       [--retries N] [--address ADDRESS] [--binary PATH]

PLACE is what `marsyard generate --out` takes, and every node must reach it: a folder on a shared file system, or an object store's URL
with credentials in every node's own environment. The driver lays the plan down in PLACE, asks which shards are missing, and hands them
out as tasks: each runs `marsyard generate PLACE --shards ... --threads N` on N processors. Nothing but the program goes to the nodes (so
that all run the same one) and nothing but a few counts comes back. At the end `marsyard finalize PLACE`.

  a node is lost                      Ray runs its tasks elsewhere, --retries times each
  exit 75 (storage), death by signal  tried again after 1, 2, 4 ... 60 s, --retries times
  exit 2 (config, place)              nothing more is started; this program exits with 2
  exit 1, or retries used up          the other shards go on; told at the end; this program exits with 1
  Ctrl-C, SIGTERM                     running tasks finish or discard the shard in hand; this program exits with 75

Whatever ended it, the same command goes on: only missing shards are built. Exits with 0 when the corpus is finalized.
"""

import argparse
import ctypes
import dataclasses
import json
import os
import pathlib
import shutil
import signal
import socket
import subprocess
import sys
import time

FAILED, USAGE, TRY_AGAIN = 1, 2, 75
#: Tasks that are known to Ray at a time: enough for an autoscaler to see the demand, few enough for a driver's memory.
IN_FLIGHT = 1000
#: Without --shards-per-task: as many shards to a task as make this many tasks. A task's own cost is some 0.1 s.
TASKS = 5000
LONGEST_WAIT_S = 60
#: How much of what a failed task said comes back.
SAID_BYTES = 2000


def log(text):
    print(text, file=sys.stderr, flush=True)


def to_ranges(shards):
    """[0, 1, 2, 7] -> "0..3,7", the form that --shards takes."""
    runs = []
    for shard in shards:
        if runs and runs[-1][1] == shard:
            runs[-1][1] = shard + 1
        else:
            runs.append([shard, shard + 1])
    return ",".join(str(first) if after == first + 1 else f"{first}..{after}" for first, after in runs)


def from_ranges(text):
    """The inverse of to_ranges; nothing is no shard."""
    shards = []
    for part in filter(None, text.strip().split(",")):
        first, _, after = part.partition("..")
        shards.extend(range(int(first), int(after) if after else int(first) + 1))
    return shards


def duration(seconds):
    minutes, hours = int(seconds) // 60, int(seconds) // 3600
    if seconds < 60:
        return f"{seconds:.0f} s"
    return f"{minutes} min" if minutes < 60 else f"{hours} h {minutes % 60} min"


# ---- on the nodes ------------------------------------------------------------------------------------------------------------------


def die_with_parent():
    """In the child, before it becomes marsyard: a worker that dies takes its build with it (Linux)."""
    PR_SET_PDEATHSIG = 1
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)


def build_shards(program, place, shards, threads):
    """The task: runs the program, which came as bytes, for some shards; a few counts and, if it failed, its last words."""
    # A file without a name: nothing to clean up after a killed worker, and no folder that must allow programs.
    file = os.memfd_create("marsyard")
    with os.fdopen(file, "wb", closefd=False) as writer:
        writer.write(program)
    command = [f"/proc/self/fd/{file}", "--log", "json", "generate", place, "--shards", shards, "--threads", str(threads)]
    child = subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, pass_fds=[file], preexec_fn=die_with_parent
    )
    os.close(file)
    try:
        while True:
            try:
                said = child.communicate(timeout=0.5)[1]
                break
            except subprocess.TimeoutExpired:
                # Python takes notice of a cancelled task between its own steps only.
                continue
    except BaseException:
        child.send_signal(signal.SIGTERM)
        child.communicate()
        raise
    result = {"exit": child.returncode, "host": socket.gethostname(), "said": ""}
    if child.returncode:
        result["said"] = said[-SAID_BYTES:].decode(errors="replace")
    else:
        end = json.loads(said.splitlines()[-1])
        result.update({key: end[key] for key in ("scenes", "failed", "cells", "rays")})
    return result


# ---- the driver --------------------------------------------------------------------------------------------------------------------


@dataclasses.dataclass(eq=False)
class Chunk:
    """Some shards that one task builds."""

    shards: list
    tries: int = 0
    not_before: float = 0.0


class Progress:
    """Counts shards and says how it stands: a line that is rewritten on a terminal, a line every 30 s elsewhere."""

    def __init__(self, shards):
        self.done, self.shards = 0, shards
        self.scenes = self.failed_scenes = self.cells = self.rays = 0
        self.started = self.last_line = time.monotonic()

    def count(self, chunk, result):
        self.done += len(chunk.shards)
        self.scenes += result["scenes"]
        self.failed_scenes += result["failed"]
        self.cells += result["cells"]
        self.rays += result["rays"]

    def line(self, running):
        seconds = time.monotonic() - self.started
        eta = duration(seconds / self.done * (self.shards - self.done)) if self.done else "unknown"
        failed = f", {self.failed_scenes} scenes failed" if self.failed_scenes else ""
        rates = f"{self.scenes / seconds:.1f} scenes/s  {self.rays / seconds:.3g} rays/s  {self.cells / seconds:.3g} cells/s"
        return f"{self.done}/{self.shards} shards  {running} tasks out  {rates}{failed}  ETA {eta}"

    def tell(self, running, last=False):
        now = time.monotonic()
        terminal = sys.stderr.isatty()
        if not last and now - self.last_line < (1 if terminal else 30):
            return
        self.last_line = now
        if terminal:
            print(f"\r\x1b[K{self.line(running)}", end="\n" if last else "", file=sys.stderr, flush=True)
        else:
            log(self.line(running))


class Driver:
    """Hands chunks out and takes results in until all are built, given up or one is refused."""

    def __init__(self, ray, args, program, progress):
        self.ray, self.args, self.progress = ray, args, progress
        self.program = ray.put(program)
        options = {"num_cpus": args.threads, "max_retries": args.retries, "name": "marsyard"}
        self.task = ray.remote(**options)(build_shards)
        self.running, self.given_up = {}, []

    def submit(self, chunk):
        chunk.tries += 1
        shards = to_ranges(chunk.shards)
        self.running[self.task.remote(self.program, self.args.out, shards, self.args.threads)] = chunk

    def build(self, chunks):
        """The exit code of the whole."""
        waiting = chunks
        while waiting or self.running:
            now = time.monotonic()
            ready = [chunk for chunk in waiting if chunk.not_before <= now][: IN_FLIGHT - len(self.running)]
            for chunk in ready:
                waiting.remove(chunk)
                self.submit(chunk)
            if not self.running:
                time.sleep(0.2)
                continue
            # The first that comes, then all that have come with it.
            references = list(self.running)
            if self.ray.wait(references, timeout=1)[0]:
                finished, _ = self.ray.wait(references, num_returns=len(references), timeout=0)
            else:
                finished = []
            for reference in finished:
                chunk = self.running.pop(reference)
                code, why = self.outcome(reference, chunk)
                if code == USAGE:
                    log(f"{why}\nno other shard would fare better: stopped")
                    self.stop()
                    return USAGE
                if code == TRY_AGAIN and chunk.tries <= self.args.retries:
                    wait_s = min(2 ** (chunk.tries - 1), LONGEST_WAIT_S)
                    log(f"{why}\ntried again in {wait_s} s ({chunk.tries} of {self.args.retries})")
                    chunk.not_before = time.monotonic() + wait_s
                    waiting.append(chunk)
                elif code:
                    log(why)
                    self.given_up.append(chunk)
            self.progress.tell(len(self.running), last=not waiting and not self.running)
        return FAILED if self.given_up else 0

    def outcome(self, reference, chunk):
        """(0, ""), or an exit code and what to say of it."""
        shards = to_ranges(chunk.shards)
        try:
            result = self.ray.get(reference)
        except self.ray.exceptions.RayError as error:
            # Ray has tried as often as it may; a program that cannot be started ends here as well.
            return FAILED, f"shards {shards}: {str(error).strip()[-SAID_BYTES:]}"
        code = result["exit"]
        if code == 0:
            self.progress.count(chunk, result)
            return 0, ""
        why = f"shards {shards} on {result['host']}: exit {code}\n{result['said'].strip()}"
        return (TRY_AGAIN if code < 0 else code), why

    def stop(self):
        """Takes back what waits, lets what runs finish or discard the shard in hand, and waits for that."""
        for reference in self.running:
            self.ray.cancel(reference)
        if self.running:
            self.ray.wait(list(self.running), num_returns=len(self.running), timeout=LONGEST_WAIT_S)


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("config", help="a corpus config, or the plan.yaml of a corpus")
    parser.add_argument("--out", required=True, metavar="PLACE", help="folder that all nodes see, or URL")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", dest="sets", help="override a key")
    parser.add_argument("--threads", type=int, default=1, help="of a task, which takes as many processors of the cluster (1)")
    parser.add_argument("--shards-per-task", type=int, metavar="N", help=f"default: 1, more from {TASKS} shards on")
    parser.add_argument("--retries", type=int, default=10, help="of a task that lost its node or its storage (10)")
    parser.add_argument("--address", help="of the cluster; default: the one that this machine is in, or this machine alone")
    parser.add_argument("--binary", type=pathlib.Path, help="marsyard here; default: target/release, then the PATH")
    args = parser.parse_args()
    if args.threads < 1 or args.retries < 0 or (args.shards_per_task is not None and args.shards_per_task < 1):
        parser.error("--threads and --shards-per-task are at least 1, --retries at least 0")
    if args.binary is None:
        built = pathlib.Path(__file__).resolve().parents[1] / "target/release/marsyard"
        found = str(built) if built.is_file() else shutil.which("marsyard")
        if found is None:
            parser.error("no marsyard in target/release or on the PATH: cargo build --release, or give --binary")
        args.binary = pathlib.Path(found)
    if not args.binary.is_file():
        parser.error(f"--binary {args.binary}: no such file")
    args.binary = args.binary.resolve()
    if "://" not in args.out:
        args.out = str(pathlib.Path(args.out).resolve())
    return args


def run_here(args, *verb, capture=False):
    """Runs a verb on this machine; its stdout where asked for. A failure ends this program with the verb's exit code."""
    done = subprocess.run([args.binary, *verb], stdout=subprocess.PIPE if capture else None, text=True)
    if done.returncode:
        sys.exit(done.returncode if done.returncode > 0 else TRY_AGAIN)
    return done.stdout


def main():
    args = arguments()
    sets = [part for key in args.sets for part in ("--set", key)]
    run_here(args, "generate", args.config, "--out", args.out, "--plan-only", *sets)
    missing = from_ranges(run_here(args, "status", args.out, "--missing", capture=True))
    if missing:
        code = build(args, missing)
        if code:
            sys.exit(code)
    run_here(args, "finalize", args.out)


def build(args, missing):
    """Builds the missing shards on the cluster; 0, or the exit code to end with."""
    try:
        import ray
    except ModuleNotFoundError:
        sys.exit("ray is not installed: pip install ray, the same version on every node")
    try:
        ray.init(address=args.address, log_to_driver=False)
    except ConnectionError as error:
        sys.exit(f"no cluster at {args.address or os.environ.get('RAY_ADDRESS')}: {error}")
    cpus = int(ray.cluster_resources().get("CPU", 0))
    if cpus < args.threads:
        log(f"the cluster has {cpus} processors; tasks of {args.threads} wait until a node with as many joins")
    per_task = args.shards_per_task or -(-len(missing) // TASKS)
    chunks = [Chunk(missing[k : k + per_task]) for k in range(0, len(missing), per_task)]
    nodes = sum(node["Alive"] for node in ray.nodes())
    log(f"{len(missing)} shards to build as {len(chunks)} tasks on {nodes} nodes, {cpus} processors")
    driver = Driver(ray, args, args.binary.read_bytes(), Progress(len(missing)))
    # SIGTERM is how job systems say Ctrl-C.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        code = driver.build(chunks)
    except KeyboardInterrupt:
        log("\ninterrupted: running tasks finish or discard the shard in hand; the same command goes on from there")
        driver.stop()
        code = TRY_AGAIN
    if driver.given_up:
        shards = sorted(shard for chunk in driver.given_up for shard in chunk.shards)
        log(f"not built: shards {to_ranges(shards)} (why: above); the others are there; the same command tries these again")
    ray.shutdown()
    return code


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        sys.exit(TRY_AGAIN)
