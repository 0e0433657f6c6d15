"""What the columns of the ground around a cell and of the beams bring: the shipped configs with them and without.

Usage:  cargo build --release
        python scripts/columns.py [--seeds 1,2] [--quick]

Builds configs/quickstart.yaml, configs/paper.yaml and configs/mars.yaml with the paper's columns alone, with `cells.local_height` (with
the plane), `cells.curvature` and `cells.surroundings`, and with `cells.beams` besides, trains on each with all defaults, and judges on the same test scenes. Balanced accuracy by
cells, percent; in brackets 95 % of a bootstrap over test scenes, means over the trainings, the same draws for all, so that differences are
paired; they are to the line above. Last the same corpora, learnt without normal scores (`network.normal_scores`). CPU seconds of this machine, beside other work.

Needs numpy and pyarrow. Writes columns.json and columns.md into scripts/results.
"""

import argparse

import numpy as np
import pyarrow
import pyarrow.parquet as parquet

import held_out
import study
from learning_curve import timed
from transfer import outputs

AROUND = {
    "local_height": "{radius_m: 1, percentile: 10, plane: true}",
    "curvature": "{radii_m: [0.2, 0.4, 0.8]}",
    "surroundings": "{radii_m: [0.2, 0.4]}",
    "beams": "null",
}
CELLS = {
    "listed": dict.fromkeys(AROUND, "null"),
    "around": AROUND,
    "beams": AROUND | {"beams": "{radii_m: [0.1, 0.2, 0.4]}"},
}
#: What is built, and how the training is set.
WAYS = {
    "paper's columns": ("listed", []),
    "with the ground around": ("around", []),
    "and the beams": ("beams", []),
    "standardised alone": ("beams", ["network.normal_scores=false"]),
}
SCENES = {"quickstart": 200, "paper": 200, "mars": 140}
PER_SHARD = {"quickstart": 10, "paper": 10, "mars": 5}
DRAWS = 1000


def test_counts(place, model, splits="test"):
    """By scene of the splits whose names match: untraversable cells missed and called, traversable cells called and passed."""
    names = ["scene_id", "label", *model["about"]["features"]]
    cells = pyarrow.concat_tables([parquet.read_table(path, columns=names) for path in sorted((place / "data" / "cells").glob(f"{splits}-*.parquet"))])
    cells = cells.filter(pyarrow.compute.is_valid(cells["label"]))
    found = {name: cells[name].to_numpy() for name in names}
    ids, found["scene"] = np.unique(found["scene_id"], return_inverse=True)
    found["family_of_scene"] = np.zeros(len(ids), int)
    return held_out.counts(found, outputs(model, found))


def balanced(of_trainings, drawn):
    """The mean over trainings, and its draws."""
    of = np.asarray(of_trainings, float)
    rates = lambda counts: held_out.rates(counts)[..., 2]
    return rates(of.sum(axis=1)).mean(), rates(np.einsum("ds,tsk->dtk", drawn, of)).mean(axis=1)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", default="1,2")
    study.add_arguments(parser, "columns")
    options = parser.parse_args()
    seeds = [1] if options.quick else [int(seed) for seed in options.seeds.split(",")]
    marsyard, rows, facts = study.Marsyard(options.marsyard, options.work, options.threads), [], {}
    for config, scenes in SCENES.items():
        scenes, judged, drawn = scenes // 4 if options.quick else scenes, {}, None
        for k, (way, (cells, train_sets)) in enumerate(WAYS.items()):
            name, sets = f"{config}-{cells}", [f"cells.{key}={value}" for key, value in CELLS[cells].items()]
            make = lambda: marsyard.corpus(name, study.ROOT / "configs" / f"{config}.yaml", sets, scenes, PER_SHARD[config])
            place, generate_s = timed(marsyard.work, f"generate-{name}", make)
            of, train_s = [], []
            for seed in seeds:
                run, seconds = timed(marsyard.work, f"train-{config}-{k}-{seed}", lambda: marsyard.train(f"{config}-{k}", [place], seed, train_sets))
                of.append(test_counts(place, held_out.network(marsyard, run)))
                train_s.append(seconds)
            if drawn is None:
                drawn = np.random.default_rng(1).multinomial(len(of[0]), np.full(len(of[0]), 1 / len(of[0])), size=DRAWS)
            judged[way] = balanced(of, drawn)
            missed, false, _ = held_out.rates(np.sum(of, axis=(0, 1)))
            facts[f"{config}, {way}"] = {"balanced_accuracy": float(judged[way][0]), "missed": float(missed), "false": float(false), "generate_cpu_s": generate_s, "train_cpu_s": train_s}
            before = list(judged.values())[-2:-1]
            rows.append([f"{config}, {scenes} scenes", way, f"{generate_s:.0f} + {np.mean(train_s):.0f}", held_out.told(judged[way]), f"{100 * missed:.1f}", f"{100 * false:.1f}",
                         *(held_out.told_difference(judged[way], one) for one in before), *([""] if not before else [])])
    text = "\n\n".join([
        "# What the ground around a cell and the beams bring",
        f"`python scripts/columns.py`, {study.versions(marsyard)['marsyard']}; {len(seeds)} trainings each, all defaults, judged on the same test scenes.",
        study.markdown(["config", "columns", "CPU s, generate + train", "balanced accuracy", "missed %", "false %", "difference, points"], rows)]) + "\n"
    study.write_results(options.out, "columns", {"versions": study.versions(marsyard), "runs": facts}, text)


if __name__ == "__main__":
    main()
