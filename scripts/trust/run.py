"""The long form of the promises: every fault many times at random moments, every condition of sameness.

    python scripts/trust/run.py target/release/marsyard --times 50
    python scripts/trust/run.py target/release/marsyard --short          # some seconds of each; writes nothing

The first writes scripts/results/trust.json and trust.md; the readers that CI runs and those of scripts/results/readers.json
are put into the same page. Python's standard library alone; mounting a small disk needs root, the emulated processor
qemu-x86_64 (Debian's qemu-user). A fault that costs anything ends the run with exit 1 and is written down all the same.
"""

import argparse
import collections
import json
import pathlib
import platform
import random
import sys
import time

import faults
import imports
import sameness
import scale
from lab import ROOT, Lab, Lost
from report import page

RESULTS = ROOT / "scripts/results"


def inject(lab, chosen, times, seed):
    mounts = faults.can_mount(lab)
    for fault, what, needs_mount in chosen:
        row = {"fault": what, "times": 0, "lost": [], "ends": collections.Counter(), "seconds": 0.0}
        started = time.monotonic()
        if needs_mount and not mounts:
            row["ends"]["not run: no right to mount here"] = 1
        for k in range(times if mounts or not needs_mount else 0):
            try:
                row["ends"][fault(lab, random.Random(f"{seed} {fault.__name__} {k}"))] += 1
            except Lost as lost:
                row["lost"].append(f"injection {k}: {lost}")
            row["times"] += 1
        row["seconds"] = round(time.monotonic() - started, 1)
        print(f"{what}: {row['times']} times, lost {len(row['lost'])}; {dict(row['ends'])}; {row['seconds']} s", flush=True)
        for lost in row["lost"]:
            print(f"  {lost}", flush=True)
        yield row


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("binary")
    parser.add_argument("--times", type=int, default=50, help="injections of each fault")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", help="faults whose function names hold this word; no conditions")
    parser.add_argument("--short", action="store_true", help="one or two injections, smaller corpus, nothing written")
    parser.add_argument("--debug-binary", help="a binary of the dev profile, whose imports are looked at as well")
    arguments = parser.parse_args()
    times = 2 if arguments.short else arguments.times
    chosen = [row for row in faults.ALL if not arguments.only or arguments.only in row[0].__name__]
    lab = Lab(arguments.binary, scenes=8 if arguments.short else 16)
    try:
        print(f"reference: {lab.corpus_id[:16]}, {len(lab.reference)} files, built in {lab.seconds:.2f} s", flush=True)
        conditions = []
        if not arguments.only:
            for row in sameness.conditions(lab, arguments.seed, arguments.short):
                print(f"{row['condition']}: {row['files']} {row['f64']}", flush=True)
                conditions.append(row)
        rows = list(inject(lab, chosen, times, arguments.seed))
        scales = []
        if not arguments.only and not arguments.short:
            scales = scale.many_shards(lab, 100_000) + scale.long_builds(lab, (10, 100, 1000))
            print(*scales, sep="\n", flush=True)
    finally:
        lab.close()
    binaries = {"release": arguments.binary, **({"debug": arguments.debug_binary} if arguments.debug_binary else {})}
    taken = {kind: imports.imports(binary) for kind, binary in binaries.items()}
    lost = sum(len(row["lost"]) for row in rows) + sum(len(names) for names in taken.values())
    if not arguments.short and not arguments.only:
        result = {"seed": arguments.seed, "times": times, "machine": platform.platform(), "scenes": lab.scenes, "corpus_id": lab.corpus_id,
                  "conditions": conditions, "imports": taken, "faults": rows, "scale": scales}
        (RESULTS / "trust.json").write_text(json.dumps(result, indent=1) + "\n")
        (RESULTS / "trust.md").write_text(page(result))
    print(f"lost: {lost or 'nothing'}")
    sys.exit(1 if lost else 0)


if __name__ == "__main__":
    main()
