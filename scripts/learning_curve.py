"""What more scenes teach: the error on each held-out family of configs/mixed.yaml against scenes and CPU seconds.

Usage:  cargo build --release
        python scripts/learning_curve.py [--sizes 140,400,1200] [--seeds 1,2,3] [--quick]

Cuts configs/mixed.yaml to each size and trains the default network on it with all defaults. All networks are judged on one test corpus
of another seed, family by family. Intervals are standard deviations over the seeds of the training; the corpora of all sizes begin
with the same scenes, and the test scenes are the same for all.

Writes learning_curve.json and learning_curve.md into scripts/results.
"""

import argparse
import json
import resource

import study

CONFIG = study.ROOT / "configs" / "mixed.yaml"
FAMILIES = ["unseen_pattern", "unseen_density", "unseen_height", "unseen_frame", "unseen_slope", "unseen_kinds", "unseen"]
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


def rates(report, wanted):
    """The rates by cells of one group of a report: of a family, or of all."""
    found = [g for g in report["groups"] if f'"{wanted}"' in json.dumps(g["group"])]
    at = found[0]["network"]["at"][0]["cells"]
    kept = {key: at[key] for key in ("balanced_accuracy", "missed_untraversable", "false_untraversable")}
    return {**kept, "auc": found[0]["network"]["auc"], "cells": found[0]["cells"]}


def trained(marsyard, corpus, size, seed, test):
    run, seconds = timed(marsyard.work, f"train-{size}-{seed}", lambda: marsyard.train(str(size), [corpus], seed))
    training = json.loads((run / "training.json").read_text())
    report = marsyard.evaluate(run, test, "test")
    return {"size": size, "seed": seed, "train_cpu_s": seconds, "rows_learnt": training["rows_learnt"],
            "best_rows": training["best"]["rows"], "validation_error": training["best"]["validation_error"],
            "families": {family: rates(report, family) for family in FAMILIES}}


def mean_of_families(run):
    return sum(of["balanced_accuracy"] for of in run["families"].values()) / len(FAMILIES)


def worst_family(run):
    return min(of["balanced_accuracy"] for of in run["families"].values())


def table(runs, sizes, generate_s):
    head = ["scenes", "CPU s, generate", "CPU s, train", "rows learnt, thousands", "worst family", "mean of families", *FAMILIES]
    rows = []
    for size in sizes:
        of = [run for run in runs if run["size"] == size]
        mean = lambda value: study.mean_spread([value(run) for run in of])
        plain = lambda value, scale=1.0: f"{mean(value)['mean'] * scale:.1f}"
        balanced = [study.percent_spread(mean(lambda run: run["families"][family]["balanced_accuracy"])) for family in FAMILIES]
        rows.append([size, f"{generate_s[size]:.0f}", plain(lambda run: run["train_cpu_s"]),
                     plain(lambda run: run["rows_learnt"], 1e-3), study.percent_spread(mean(worst_family)),
                     study.percent_spread(mean(mean_of_families)), *balanced])
    return study.markdown(head, rows)


def kinds_of_error(runs, size):
    of = [run for run in runs if run["size"] == size]
    rows = []
    for family in FAMILIES:
        mean = lambda key: study.percent_spread(study.mean_spread([run["families"][family][key] for run in of]))
        rows.append([family, f"{of[0]['families'][family]['cells']:,}", mean("missed_untraversable"),
                     mean("false_untraversable"), mean("auc")])
    return study.markdown(["family", "cells", "missed %", "false %", "AUC %"], rows)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", default="140,400,1200")
    parser.add_argument("--seeds", default="1,2,3")
    parser.add_argument("--test-scenes", default=1000, type=int, help="of the test corpus, before its split (default 1000)")
    parser.add_argument("--test-seed", default=99, type=int, help="seed of the test corpus (default 99); give another work folder with it")
    study.add_arguments(parser, "learning_curve")
    options = parser.parse_args()
    sizes, seeds = [int(n) for n in options.sizes.split(",")], [int(n) for n in options.seeds.split(",")]
    test_scenes = options.test_scenes
    if options.quick:
        sizes, seeds, test_scenes = [70, 140], [1], 140
    marsyard = study.Marsyard(options.marsyard, options.work, options.threads)
    test = marsyard.corpus("test", CONFIG, [f"seed={options.test_seed}"], test_scenes, PER_SHARD)
    corpora, generate_s = {}, {}
    for size in sizes:
        corpora[size], generate_s[size] = timed(
            marsyard.work, f"generate-{size}", lambda: marsyard.corpus(f"mixed-{size}", CONFIG, [], size, PER_SHARD))
    runs = [trained(marsyard, corpora[size], size, seed, test) for seed in seeds for size in sizes]
    text = "\n\n".join([
        "# What more scenes teach about yards of other families",
        f"`python scripts/learning_curve.py`, {study.versions(marsyard)['marsyard']}; {len(seeds)} seeds of the training, "
        f"mean ± standard deviation over them. Balanced accuracy by cells, percent. Test: {test_scenes} scenes of another seed, of them the "
        "test split. CPU seconds of this machine, beside other work.",
        table(runs, sizes, generate_s),
        f"## Kinds of error, {sizes[-1]} scenes",
        kinds_of_error(runs, sizes[-1])]) + "\n"
    results = {"versions": study.versions(marsyard), "generate_cpu_s": generate_s, "runs": runs}
    study.write_results(options.out, "learning_curve", results, text)


if __name__ == "__main__":
    main()
