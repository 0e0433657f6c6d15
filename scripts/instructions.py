#!/usr/bin/env python3
"""Counts the instructions of one scene of an empty yard, and compares with the count that is committed.

A part that a config does not name must cost nothing: an empty yard (benches/empty_yard.yaml) names none, so its count must
not grow when a part is added to the program. `run_scene` is run 2 and 22 times under valgrind's callgrind; a twentieth of
the difference is one scene, start-up cancels. Counted twice: the two must agree to 0.1 %.

    python scripts/instructions.py --check     compare with scripts/results/instructions.json, to 0.5 %
    python scripts/instructions.py --mint      write that file

The count hangs on the compiler and on its settings (not on the machine: valgrind shows every program AVX2 and no AVX-512), so the program
is built by the settings of Cargo.toml alone: run it where no cargo settings of the machine change them. After a change of the
compiler, or one that is meant, mint it again.
"""

import argparse
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[1]
RESULT = ROOT / "scripts" / "results" / "instructions.json"
TOLERANCE = 0.005
# Two counts differ by the order of hash maps at the start of the program, some 1e-4.
STEADY = 0.001


def said(*command):
    return subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT).stdout.strip()


def build():
    command = ["cargo", "build", "--release", "--locked", "--example", "empty_yard", "--message-format=json"]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, cwd=ROOT, env={**os.environ, "CARGO_INCREMENTAL": "0"})
    if done.returncode:
        sys.exit(done.returncode)
    messages = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]
    found = [m["executable"] for m in messages if m.get("reason") == "compiler-artifact" and m["target"]["name"] == "empty_yard"]
    return found[-1]


def instructions(program, times):
    command = ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null", program, str(times)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT)
    found = re.search(r"Collected : (\d+)", done.stderr)
    if done.returncode or not found:
        sys.exit(f"{' '.join(command)} failed:\n{done.stderr[-2000:]}")
    return int(found.group(1))


def of_one_scene(program):
    return (instructions(program, 22) - instructions(program, 2)) // 20


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--check", action="store_true", help="compare with the committed count; exit 1 where it differs by more than 0.5 %%")
    what.add_argument("--mint", action="store_true", help="write the count to scripts/results/instructions.json")
    parser.add_argument("--program", help="an empty_yard that is built already")
    args = parser.parse_args()
    if not shutil.which("valgrind"):
        sys.exit("valgrind is not installed: apt-get install valgrind")
    program = args.program or build()
    first, second = of_one_scene(program), of_one_scene(program)
    if abs(first - second) > STEADY * first:
        sys.exit(f"not the same count twice: {first} and {second} instructions")
    here = {"instructions": first, "rustc": said("rustc", "--version"), "valgrind": said("valgrind", "--version")}
    if args.mint:
        RESULT.write_text(json.dumps(here, indent=1) + "\n")
        print(f"{RESULT.relative_to(ROOT)}: {first:,} instructions a scene")
        return
    committed = json.loads(RESULT.read_text())
    change = first / committed["instructions"] - 1
    print(f"{first:,} instructions a scene of an empty yard, {committed['instructions']:,} committed: {100 * change:+.3f} %")
    if abs(change) > TOLERANCE:
        others = [f"{key}: {here[key]} here, {committed[key]} there" for key in ("rustc", "valgrind") if here[key] != committed[key]]
        sys.exit("more than 0.5 %: where the change is meant (or the compiler is another), python scripts/instructions.py --mint"
                 + "".join(f"\n  {other}" for other in others))


if __name__ == "__main__":
    main()
