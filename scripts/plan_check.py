#!/usr/bin/env python3
"""Sets what `marsyard plan` says beside what `marsyard generate` then takes: CPU, wall, rows, bytes.

    python scripts/plan_check.py [--marsyard target/release/marsyard] [--rounds 3] [--only paper] [--check]

Each round runs plan and then the build, in a folder that goes away. Other programs on the machine move the wall time of both, plan's
some seconds earlier than the build's: the load is reported, and CPU beside it. --check fails where rows, bytes or CPU are off by
more than 15 % in the median round; wall times are told and not judged, for they hang on what else the machine does. Results go to
scripts/results/plan_check.json and .md.
"""

import argparse
import json
import os
import pathlib
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
import time

import study

# Name, config, overrides.
BUILDS = [
    ("quickstart", "configs/quickstart.yaml", []),
    ("paper", "configs/paper.yaml", ["scenes=200", "scenes_per_shard=20"]),
    ("mars", "configs/mars.yaml", ["scenes=60", "scenes_per_shard=6"]),
    ("mixed", "configs/mixed.yaml", ["scenes=400", "scenes_per_shard=20"]),
]
LIMIT = 0.15


def spent(command):
    """CPU and wall seconds of a command, and what it said."""
    before, started = study.cpu_s(resource.RUSAGE_CHILDREN), time.monotonic()
    done = subprocess.run(command, capture_output=True, text=True, cwd=study.ROOT)
    wall = time.monotonic() - started
    if done.returncode:
        sys.exit(f"{' '.join(command)} failed:\n{done.stderr[-3000:]}")
    return study.cpu_s(resource.RUSAGE_CHILDREN) - before, wall, done.stdout


def one_round(marsyard, config, sets, threads, scratch):
    place = pathlib.Path(tempfile.mkdtemp(prefix="plan-check-", dir=scratch)) / "corpus"
    common = [config, *study.overrides(sets), "--out", str(place), "--threads", str(threads)]
    load = os.getloadavg()[0]
    plan_cpu, plan_wall, said = spent([marsyard, "plan", *common, "--json", "--no-parts"])
    estimate = json.loads(said)["estimate"]
    cpu, wall, _ = spent([marsyard, "generate", *common])
    manifest = json.loads((place / "manifest.json").read_text())
    size = sum(path.stat().st_size for folder in ("data", "receipts") for path in (place / folder).rglob("*") if path.is_file())
    shutil.rmtree(place.parent)
    took = {"cpu_s": cpu, "wall_s": wall, "rows": manifest["tables"]["cells"]["rows"], "bytes": size}
    said = {key: estimate[key]["value"] for key in took}
    return {"load": load, "plan_cpu_s": plan_cpu, "plan_wall_s": plan_wall, "scenes_measured": estimate["scenes_measured"],
            "said": said, "took": took, "ratio": {key: said[key] / took[key] for key in took},
            # Where no family had two scenes there is none.
            "standard_error": {key: (error := estimate[key]["standard_error"]) and error / max(said[key], 1e-9) for key in took}}


def table(results):
    rows = []
    for name, rounds in results["builds"].items():
        middle = lambda pick: statistics.median(pick(r) for r in rounds)
        off = lambda key: f"{100 * (middle(lambda r: r['ratio'][key]) - 1):+.1f} %"
        spread = lambda key: ", ".join(f"{100 * (r['ratio'][key] - 1):+.1f}" for r in rounds)
        rows.append([name, f"{middle(lambda r: r['took']['wall_s']):.1f} s", f"{middle(lambda r: r['plan_wall_s']):.1f} s",
                     f"{middle(lambda r: r['scenes_measured']):.0f}", off("rows"), off("bytes"), off("cpu_s"),
                     off("wall_s"), spread("wall_s"), f"{middle(lambda r: r['load']):.1f}"])
    head = ["build", "took", "plan took", "scenes sampled", "rows off", "bytes off", "CPU off", "wall off", "wall, each round %", "load"]
    return study.markdown(head, rows)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--marsyard", default="target/release/marsyard")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--threads", type=int, default=len(os.sched_getaffinity(0)))
    parser.add_argument("--only", action="append", help="this build alone (repeatable)")
    parser.add_argument("--scratch", help="folder to build in (default: the system's temporary folder)")
    parser.add_argument("--check", action="store_true", help="fail where rows, bytes or CPU are off by more than 15 %%")
    args = parser.parse_args()
    builds = {name: [] for name, _, _ in BUILDS if not args.only or name in args.only}
    # Rounds outside: each build meets the machine at several times.
    for _ in range(args.rounds):
        for name, config, sets in BUILDS:
            if name in builds:
                builds[name].append(one_round(args.marsyard, config, sets, args.threads, args.scratch))
                study.note(f"{name}: {builds[name][-1]['ratio']}")
    results = {"threads": args.threads, "builds": builds}
    text = f"""# What `marsyard plan` says against what `marsyard generate` takes

`python scripts/plan_check.py --rounds {args.rounds}`, {args.threads} threads; estimate over truth less one, medians of the rounds.
Wall times of both hang on what else ran on the machine meanwhile (load: of the last minute before).

{table(results)}
"""
    study.write_results(study.RESULTS, "plan_check", results, text)
    wrong = [f"{name}: {key} off by {100 * (ratio - 1):+.1f} %" for name, rounds in builds.items() for key in ("rows", "bytes", "cpu_s")
             if abs((ratio := statistics.median(r["ratio"][key] for r in rounds)) - 1) > LIMIT]
    if args.check and wrong:
        sys.exit("\n".join(wrong))


if __name__ == "__main__":
    main()
