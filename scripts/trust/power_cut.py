"""Power cuts of a real file system: what is on the block device at a random moment is what a machine finds when it starts again.

    sudo python scripts/trust/power_cut.py target/release/marsyard --times 48

An ext4 in a file is mounted by a loop device, and a build, a growth, a training or a search runs in it. At a random moment the
process is stopped and the file is copied: what the kernel still holds in memory is not in the copy, as it would not be on a disk.
The copy is mounted, so that ext4 replays its journal. Then readers are asked, the same command runs again, and every byte must be
that of an undisturbed run. Needs root, mkfs.ext4 and loop devices; Python's standard library alone. Writes
scripts/results/power_cut.md; a cut that costs anything ends the run with exit 1 and is written down all the same.
"""

import argparse
import collections
import contextlib
import hashlib
import json
import pathlib
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
CONFIG = ROOT / "tests/fixtures/crash.yaml"
IMAGE_MB = 48
# No part of any promise: times and what they are derived from.
TIMELY = ("report.json",)
TRY_AGAIN = 75

GENERATE = ["generate", "crash.yaml", "--out", "corpus", "--threads", "2", "--keep-free-mb", "0",
            "--set", "scenes=56"]
GROW = [*GENERATE[:-1], "scenes=112"]
TRAIN = ["train", "corpus", "--out", "run", "--resume", "--set", "network.hidden=[16,16]", "--set", "epochs=30",
         "--set", "patience=1000", "--set", "filter={ekf: {precision: f64}}"]
SEARCH = ["search", "corpus", "--out", "found", "--resume", "--threads", "2", "--widths", "2,4,8", "--layers", "3"]
# What is cut, the command, and those that must have run before it.
KINDS = {
    "generate": (GENERATE, []),
    "growth": (GROW, [GENERATE]),
    "train": (TRAIN, [GENERATE]),
    "search": (SEARCH, [GENERATE]),
}
PROBE = ["train", "corpus", "--out", "probe", "--set", "network.hidden=[1]", "--set", "epochs=1"]
READERS = {"inspect": ["inspect", "corpus"], "verify": ["verify", "corpus"], "train": PROBE}


class Lost(Exception):
    """A cut cost something."""


def run(binary, folder, arguments):
    return subprocess.run([binary, *arguments], cwd=folder, capture_output=True, text=True)


def must(binary, folder, arguments):
    done = run(binary, folder, arguments)
    if done.returncode != 0:
        raise Lost(f"{arguments[0]}: exit {done.returncode}: {' '.join(done.stderr.split())[-400:]}")


def promised(folder):
    """Every file with its hash, temporary ones too: none may stay. Lines that hold times are compared without them."""
    files = {}
    for path in sorted(folder.rglob("*")):
        name = str(path.relative_to(folder))
        if path.is_file() and path.name not in TIMELY and not name.startswith("lost+found"):
            files[name] = hashlib.sha256(timeless(path)).hexdigest()
    return files


def timeless(path):
    if path.name == "training.jsonl":
        return json.dumps([without(line, "elapsed_s") for line in path.read_text().splitlines()]).encode()
    if path.name == "search.jsonl":
        # The checksum covers the seconds.
        return json.dumps(sorted(without(line, "seconds", "checksum") for line in path.read_text().splitlines())).encode()
    return path.read_bytes()


def without(line, *keys):
    values = json.loads(line)
    for key in keys:
        values.pop(key, None)
    return json.dumps(values, sort_keys=True)


def answers(binary, folder):
    """What each reader says of the corpus: its products, or None where it refuses."""
    said = {}
    for name, arguments in READERS.items():
        done = run(binary, folder, arguments)
        if done.returncode not in (0, 1, 2, TRY_AGAIN):
            raise Lost(f"{name} as a reader: exit {done.returncode}")
        probe = folder / "probe"
        products = promised(probe) if probe.exists() else {}
        shutil.rmtree(probe, ignore_errors=True)
        said[name] = (done.stdout, products) if done.returncode == 0 else None
    return said


class Reference:
    """An undisturbed run of a kind: where it starts from, how long it takes, and what it gives."""

    def __init__(self, binary, folder, kind):
        self.command, before = KINDS[kind]
        self.kind, self.start = kind, folder / f"{kind}-start"
        self.start.mkdir()
        shutil.copy(CONFIG, self.start / "crash.yaml")
        for command in before:
            must(binary, self.start, command)
        self.builds = kind in ("generate", "growth")
        self.old = answers(binary, self.start) if self.builds else None
        end = folder / f"{kind}-end"
        shutil.copytree(self.start, end)
        started = time.monotonic()
        must(binary, end, self.command)
        self.seconds = time.monotonic() - started
        self.files = promised(end)
        self.new = answers(binary, end) if self.builds else None


@contextlib.contextmanager
def mounted(image, place, options):
    subprocess.run(["mount", "-o", f"loop,{options}", str(image), str(place)], check=True)
    try:
        yield place
    finally:
        while subprocess.run(["umount", str(place)], capture_output=True).returncode != 0:
            time.sleep(0.05)


def copied(image, target):
    """What is on the device; the kernel may write on while it is copied, so it is copied until two copies agree."""
    digest = None
    while True:
        shutil.copyfile(image, target)
        again = hashlib.sha256(target.read_bytes()).hexdigest()
        if again == digest:
            return
        digest = again


def cut(binary, scratch, reference, options, rng, met):
    """One cut; counts what it met."""
    image, copy, place = scratch / "disk.img", scratch / "cut.img", scratch / "disk"
    place.mkdir(exist_ok=True)
    image.unlink(missing_ok=True)
    subprocess.run(["truncate", "-s", f"{IMAGE_MB}M", str(image)], check=True)
    subprocess.run(["mkfs.ext4", "-q", "-F", str(image)], check=True)
    with mounted(image, place, options):
        shutil.copytree(reference.start, place, dirs_exist_ok=True)
        subprocess.run(["sync", "-f", str(place)], check=True)
        child = subprocess.Popen([binary, *reference.command], cwd=place, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        time.sleep(rng.uniform(0, 1.05 * reference.seconds))
        child.send_signal(signal.SIGSTOP)
        met["behind its end" if child.poll() is not None else "under way"] += 1
        copied(image, copy)
        child.kill()
        child.wait()
    with mounted(copy, place, options):
        if reference.builds:
            read(binary, place, reference)
        must(binary, place, reference.command)
        there = promised(place)
        if there != reference.files:
            names = sorted(n for n in there.keys() | reference.files.keys() if there.get(n) != reference.files.get(n))
            raise Lost(f"other files than the undisturbed run: {names[:4]}")


def read(binary, place, reference):
    """All readers take the corpus of before, or all that of after, or refuse."""
    said = {name: answer for name, answer in answers(binary, place).items() if answer is not None}
    sides = [all(answer == side[name] for name, answer in said.items()) for side in (reference.old, reference.new)]
    if not any(sides):
        raise Lost(f"mixed: {', '.join(said)} read neither the corpus of before nor that of after")


def page(rows, options):
    lines = [
        "# Power cuts",
        "",
        "`scripts/trust/power_cut.py`: an ext4 on a loop device (`" + options + "`), copied at a random moment under a stopped process;",
        "its journal is replayed, readers are asked, and the same command runs again. Lost: a byte of the result differs from an",
        "undisturbed run, the command does not go on, or a temporary file stays. Mixed: a reader takes a corpus that is neither that",
        "of before nor that of after.",
        "",
        "| cut off | cuts | while under way | lost | mixed |",
        "|---|--:|--:|--:|--:|",
    ]
    for row in rows:
        mixed = sum("mixed:" in what for what in row["lost"])
        lines.append(f"| {row['kind']} | {row['times']} | {row['met']['under way']} | {len(row['lost']) - mixed} | {mixed} |")
    faults = [f"- {row['kind']}, {what}" for row in rows for what in row["lost"]]
    return "\n".join([*lines, *([""] if faults else []), *faults]) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("binary")
    parser.add_argument("--times", type=int, default=48, help="cuts of each kind")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", choices=KINDS, help="one kind; nothing is written")
    parser.add_argument("--options", default="data=ordered", help="of the mount")
    arguments = parser.parse_args()
    binary = str(pathlib.Path(arguments.binary).resolve())
    rows = []
    with tempfile.TemporaryDirectory(prefix="marsyard-cut-") as folder:
        folder = pathlib.Path(folder)
        for kind in [arguments.only] if arguments.only else KINDS:
            reference = Reference(binary, folder, kind)
            row = {"kind": kind, "times": 0, "lost": [], "met": collections.Counter()}
            for k in range(arguments.times):
                try:
                    rng = random.Random(f"{arguments.seed} {kind} {k}")
                    cut(binary, folder, reference, arguments.options, rng, row["met"])
                except Lost as lost:
                    row["lost"].append(f"cut {k}: {lost}")
                    print(f"  {row['lost'][-1]}", flush=True)
                row["times"] += 1
            print(f"{kind} ({reference.seconds:.1f} s): {row['times']} cuts, lost {len(row['lost'])}; {dict(row['met'])}", flush=True)
            rows.append(row)
    if not arguments.only:
        (ROOT / "scripts/results/power_cut.md").write_text(page(rows, arguments.options))
    sys.exit(1 if any(row["lost"] for row in rows) else 0)


if __name__ == "__main__":
    main()
