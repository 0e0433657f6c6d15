"""What the checks of Ray, Slurm and Kubernetes share: a small corpus, its id from one process, a program that fails on purpose."""

import pathlib
import stat
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
CONFIG = ROOT / "configs" / "quickstart.yaml"
SHARDS, SCENES_PER_SHARD = 24, 10
SETS = ["--set", f"scenes={SHARDS * SCENES_PER_SHARD}", "--set", f"scenes_per_shard={SCENES_PER_SHARD}"]

#: Marsyard, but as if the storage were away the first time (exit 75), or a shard could not be built (exit 1), for some values of --shards.
FAULTY = """#!/bin/sh
shards=none
previous=
for word in "$@"; do
    [ "$previous" = --shards ] && shards=$word
    previous=$word
done
case " {once} " in
    *" $shards "*) mkdir "{marks}/$(echo "$shards" | tr / -)" 2>/dev/null && {{ echo "the storage is away" >&2; exit 75; }};;
esac
case " {never} " in
    *" $shards "*) echo "this shard cannot be built" >&2; exit 1;;
esac
exec "{marsyard}" "$@"
"""


def check(holds, claim, evidence=""):
    """Says what holds; ends the program with the evidence where it does not."""
    if not holds:
        sys.exit(f"FAILED: {claim}\n{evidence}")
    print(f"  holds: {claim}", flush=True)


def corpus_id(said):
    """Out of what `generate` or `finalize` says; "none" where it names none."""
    return said.rsplit("corpus_id ", 1)[1].split()[0] if "corpus_id " in said else "none"


def one_process(marsyard, place):
    """The corpus that all others must be equal to; its id."""
    command = [marsyard, "generate", CONFIG, "--out", place, "--threads", "1", *SETS]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"one process failed:\n{done.stderr}")
    print(f"one process: corpus_id {corpus_id(done.stderr)}", flush=True)
    return corpus_id(done.stderr)


def faulty(folder, marsyard, once=(), never=()):
    """A program that exits 75 the first time for the selections `once`, and with 1 for those of `never`."""
    marks = folder / f"marks-{len(list(folder.iterdir()))}"
    marks.mkdir()
    program = folder / f"faulty-{marks.name}"
    words = {"once": " ".join(map(str, once)), "never": " ".join(map(str, never)), "marks": marks, "marsyard": marsyard}
    program.write_text(FAULTY.format(**words))
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    return str(program)
