#!/usr/bin/env python3
"""What the paper's whole search (33,824 networks of one to three hidden layers) would take, and whether its first passes rank as full training does.

    cargo build --release
    python scripts/search_full.py            # some 15 minutes of CPU time; --quick: whether it runs

Builds `configs/paper.yaml` (1000 scenes) into the work folder, then runs `marsyard search --full` twice, on 20,000 rows of it:

- `--sample 0.01`: 1 % of the networks, in the rungs that the whole search has. CPU time of its process, scaled to all networks in two ways: by
  their number, and by the sum of their squared weights (a row costs about s^2), for a sample may hold large or small ones by chance.
- `--sample 0.002 --keep 1`: every network goes on to full training. Spearman's rho says how well the ranks after a rung agree with those
  after full training; beside it, how much worse than the best is the network that halving (a third goes on) would have kept to the end.
"""

import argparse
import itertools
import json
import math

from study import ROOT, Marsyard, add_arguments, markdown, note, versions, write_results
from train_rows import LISTED

INPUTS = len(LISTED)  # what features: full takes of paper.yaml
WIDTHS = range(1, 33)
KEEP = 1 / 3


def weights(hidden):
    """Of a network with biases and one output."""
    sizes = [INPUTS, *hidden, 1]
    return sum((inputs + 1) * outputs for inputs, outputs in itertools.pairwise(sizes))


def searched(marsyard, corpus, name, *options):
    """A search's leaderboard, its journal, and the CPU seconds of its process."""
    run = marsyard.work / "runs" / name
    kept = run / "cpu_s.json"
    if not kept.exists():
        note(f"search {name}: {' '.join(map(str, options))}")
        spent = marsyard.cpu_s("search", corpus, "--full", "--out", run, "--threads", marsyard.threads, *options)
        kept.write_text(json.dumps(spent))
    board = json.loads((run / "search.json").read_text())
    entries = [json.loads(line) for line in (run / "search.jsonl").read_text().splitlines()[1:]]
    return board, entries, json.loads(kept.read_text())


def whole_search(board, entries, cpu_s):
    """The sample's CPU time scaled to all networks."""
    everyone = [weights(hidden) for layers in (1, 2, 3) for hidden in itertools.product(WIDTHS, repeat=layers)]
    sample = [entry["weights"] for entry in entries if entry["rung"] == 0]
    by_number = cpu_s * len(everyone) / len(sample)
    by_work = cpu_s * sum(s * s for s in everyone) / sum(s * s for s in sample)
    return {
        "networks": len(everyone), "sample": len(sample), "sample_cpu_s": cpu_s,
        "cpu_h_by_number": by_number / 3600, "cpu_h_by_work": by_work / 3600,
        "rungs": board["rungs"],
    }


def ranking(board, entries):
    """How well each rung ranks, over networks that all reached the last one."""
    error = lambda entry: math.inf if entry["validation_error"] is None else entry["validation_error"]
    last = len(board["rungs"]) - 1
    final = {tuple(entry["hidden"]): error(entry) for entry in entries if entry["rung"] == last}
    left = set(final)
    for rung in range(last):
        errors = {tuple(e["hidden"]): error(e) for e in entries if e["rung"] == rung and tuple(e["hidden"]) in left}
        left = set(sorted(errors, key=errors.get)[: math.ceil(KEEP * len(errors))])
    return {
        "networks": len(final),
        "rho": [{"rows": rung["rows"], "rho": rung["rank_correlation"]} for rung in board["rungs"][:last]],
        "best_error": min(final.values()), "median_error": sorted(final.values())[len(final) // 2],
        "error_of_the_best_that_halving_keeps": min(final[hidden] for hidden in left),
    }


def report(results):
    whole, rank = results["whole"], results["ranking"]
    rungs = markdown(
        ["rung", "rows learnt by each", "networks of the sample", "rho with full training"],
        [[k + 1, rung["rows"], rung["networks"], "-" if k >= len(rank["rho"]) else f"{rank['rho'][k]['rho']:.2f}"]
         for k, rung in enumerate(whole["rungs"])])
    return f"""# The paper's whole search

```sh
python scripts/search_full.py
```

{whole['sample']} of the {whole['networks']} networks took {whole['sample_cpu_s']:.0f} s of CPU time. All of them would take
{whole['cpu_h_by_work']:.1f} CPU hours by the work of their weights ({whole['cpu_h_by_number']:.1f} by their number): {whole['cpu_h_by_work'] / 2:.1f} hours on two free cores.

{rungs}

Rho: Spearman's, of {rank['networks']} networks that all went on to full training. Halving (a third goes on) would have kept one with a validation
error of {rank['error_of_the_best_that_halving_keeps']:.4f}; the best of all has {rank['best_error']:.4f}, the median {rank['median_error']:.4f}.
"""


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    add_arguments(parser, "search_full")
    args = parser.parse_args()
    marsyard = Marsyard(args.marsyard, args.work, args.threads)
    scenes, share, ranked = (1000, 0.01, 0.002) if not args.quick else (200, 0.0005, 0.0003)
    corpus = marsyard.corpus(f"paper-{scenes}", ROOT / "configs" / "paper.yaml", [], scenes, 10 if args.quick else 50)
    results = {
        "versions": versions(marsyard),
        "whole": whole_search(*searched(marsyard, corpus, f"sample-{share}", "--sample", share)),
        "ranking": ranking(*searched(marsyard, corpus, f"ranked-{ranked}", "--sample", ranked, "--keep", 1)[:2]),
    }
    write_results(args.out, "search_full", results, report(results))


if __name__ == "__main__":
    main()
