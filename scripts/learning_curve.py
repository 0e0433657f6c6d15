"""What more scenes teach, by how patient the training is: the unseen family's error against scenes, CPU seconds and the look interval.

Usage:  cargo build --release
        python scripts/learning_curve.py [--sizes 140,400,1200] [--seeds 1,2,3] [--quick]

Cuts configs/mixed.yaml to each size and trains the default network on it with several values of `validate_every`: 20,000 rows (the
default before), and a twentieth and a tenth (the default) of a pass; `patience` is 5 throughout. All networks are judged on one test
corpus of another seed: its held-out family, and all families. Intervals are standard deviations over the seeds of the training; the
corpora of all sizes begin with the same scenes, and the test scenes are the same for all.

Writes learning_curve.json and learning_curve.md into scripts/results.
"""

import argparse
import json
import resource

import study

CONFIG = study.ROOT / "configs" / "mixed.yaml"
#: Rows between two looks, by share of a pass; None: 20,000 rows.
SHARES = [None, 0.05, 0.1]
UNSEEN = "unseen"
PER_SHARD = 10


def cpu_s():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def timed(folder, name, make):
    """What `make` gives, and the CPU seconds it took, kept beside what it made."""
    before = cpu_s()
    made = make()
    kept = folder / f"{name}.cpu"
    if not kept.exists():
        kept.write_text(str(cpu_s() - before))
    return made, float(kept.read_text())


def group(report, wanted):
    found = [g for g in report["groups"] if wanted in json.dumps(g["group"])]
    at = found[0]["network"]["at"][0]["cells"]
    rates = {key: at[key] for key in ("balanced_accuracy", "missed_untraversable", "false_untraversable")}
    return {**rates, "auc": found[0]["network"]["auc"], "cells": found[0]["cells"]}


def trained(marsyard, corpus, size, share, seed, test):
    rows = json.loads((corpus / "manifest.json").read_text())["splits"]["train"]["rows"]["cells"]
    every = 20_000 if share is None else max(1, int(rows * share))
    name = f"{size}-{every}"
    run, seconds = timed(marsyard.work, f"train-{name}-{seed}",
                         lambda: marsyard.train(name, [corpus], seed, [f"validate_every={every}"]))
    training = json.loads((run / "training.json").read_text())
    report = marsyard.evaluate(run, test, "test")
    return {"size": size, "share": share, "seed": seed, "train_rows": rows, "train_cpu_s": seconds,
            "rows_learnt": training["rows_learnt"], "best_rows": training["best"]["rows"],
            "validation_error": training["best"]["validation_error"],
            "unseen": group(report, UNSEEN), "all": group(report, "all")}


def table(runs, sizes, generate_s):
    head = ["scenes", "look every", "CPU s, generate", "CPU s, train", "rows learnt, thousands", "best at, thousands",
            "unseen: balanced %", "unseen: AUC %", "unseen: missed %", "unseen: false %", "all: balanced %"]
    rows = []
    for size in sizes:
        for share in SHARES:
            of = [run for run in runs if (run["size"], run["share"]) == (size, share)]
            mean = lambda value: study.mean_spread([value(run) for run in of])
            plain = lambda value, scale=1.0: f"{mean(value)['mean'] * scale:.1f}"
            spread = lambda where, what: study.percent_spread(mean(lambda run: run[where][what]))
            rows.append([size, "20,000 rows" if share is None else f"{share:.2f} pass", f"{generate_s[size]:.0f}",
                         plain(lambda run: run["train_cpu_s"]), plain(lambda run: run["rows_learnt"], 1e-3),
                         plain(lambda run: run["best_rows"], 1e-3), spread("unseen", "balanced_accuracy"),
                         spread("unseen", "auc"), spread("unseen", "missed_untraversable"),
                         spread("unseen", "false_untraversable"), spread("all", "balanced_accuracy")])
    return study.markdown(head, rows)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", default="140,400,1200")
    parser.add_argument("--seeds", default="1,2,3")
    parser.add_argument("--test-scenes", default=1000, type=int, help="of the test corpus, before its split (default 1000)")
    study.add_arguments(parser, "learning_curve")
    options = parser.parse_args()
    sizes, seeds = [int(n) for n in options.sizes.split(",")], [int(n) for n in options.seeds.split(",")]
    test_scenes = options.test_scenes
    if options.quick:
        sizes, seeds, test_scenes = [70, 140], [1], 140
    marsyard = study.Marsyard(options.marsyard, options.work, options.threads)
    test = marsyard.corpus("test", CONFIG, ["seed=99"], test_scenes, PER_SHARD)
    corpora, generate_s = {}, {}
    for size in sizes:
        corpora[size], generate_s[size] = timed(
            marsyard.work, f"generate-{size}", lambda: marsyard.corpus(f"mixed-{size}", CONFIG, [], size, PER_SHARD))
    runs = [trained(marsyard, corpora[size], size, share, seed, test)
            for seed in seeds for size in sizes for share in SHARES]
    test_cells = runs[0]["unseen"]["cells"]
    text = "\n\n".join([
        "# What more scenes teach, by the interval of looks",
        f"`python scripts/learning_curve.py`, {study.versions(marsyard)['marsyard']}; {len(seeds)} seeds of the training, "
        f"mean ± standard deviation over them. Test: {test_scenes} scenes of another seed, of them the test split; the unseen family "
        f"has {test_cells:,} cells. CPU seconds of this machine, beside other work.",
        table(runs, sizes, generate_s)]) + "\n"
    results = {"versions": study.versions(marsyard), "generate_cpu_s": generate_s, "runs": runs}
    study.write_results(options.out, "learning_curve", results, text)


if __name__ == "__main__":
    main()
