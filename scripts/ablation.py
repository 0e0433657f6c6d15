#!/usr/bin/env python3
"""What each ingredient of configs/mixed.yaml brings on families that training never had: left out one by one.

Usage:  cargo build --release
        python scripts/ablation.py [--scenes 140] [--seeds 1,2,3] [--only columns|yards] [--quick]

Columns are left out of what the network learns, from one corpus; parts of the yards and whole families of training are left out of a corpus
each. All networks have the default settings and are judged on one test corpus of another seed. Intervals are standard deviations over the
seeds of the training; that of a part of the yards holds, beside it, for one draw of the training scenes.

Writes ablation.json and ablation.md into scripts/results.
"""

import argparse

import learning_curve
import study

CURVATURE = [f"curvature_{which}_{cm}cm_m" for cm in (20, 40, 80) for which in ("least", "most")]
SQUARES = [f"surroundings_{what}_{cm}cm{unit}" for cm in (20, 40)
           for what, unit in (("height", "_m"), ("roughness", "_m"), ("spread", "_m"), ("cover", ""))]
OWN = ["height_variance_m2", "height_difference_m", "point_count"]
LOCAL, PLANE = ["local_height_m"], ["plane_height_m", "plane_slope"]
NEIGHBOURS = ["mean_height_m"] + [f"neighbour_{way}_m" for way in ("sw", "s", "se", "w", "e", "nw", "n", "ne")]

# What the network learns, where that is not the default.
COLUMNS = {
    "the paper's columns (features: listed)": None,
    "no squares around": OWN + PLANE + CURVATURE,
    "no curvature": OWN + PLANE + SQUARES,
    "no plane": OWN + CURVATURE + SQUARES,
    "no spread, difference and count of the cell": PLANE + CURVATURE + SQUARES,
    "and the height above a percentile of the ground": OWN + LOCAL + PLANE + CURVATURE + SQUARES,
    "and heights above the rover and the neighbours": OWN + NEIGHBOURS + PLANE + CURVATURE + SQUARES,
}
# Overrides of the config for the training scenes.
YARDS = {
    "no roughness": ["scene.ground.roughness=null"],
    "no landforms": ["scene.ground.features=[]", "families.5.scene.ground.features=[]"],
    "no grass": ["scene.vegetation.grass=null", "families.2.scene.vegetation.grass=null"],
    "no brush": ["families.3.scene.vegetation.brush=null"],
    "no dropout": ["sweep.effects.dropout=null"],
    "no range bias": ["sweep.effects.range_bias_m=null"],
    "no quantisation": ["sweep.effects.quantisation=null"],
}
TRAINING_FAMILIES = ["rock_field", "builders_yard", "orchard", "scrub", "bare_rough", "embankments"]


def judged(marsyard, name, corpus, seed, test, sets=()):
    run = marsyard.train(name, [corpus], seed, sets)
    report = marsyard.evaluate(run, test, "test")
    of = {"families": {family: learning_curve.rates(report, family) for family in learning_curve.FAMILIES}}
    return {"name": name, "seed": seed, **of}


def row(name, runs):
    of = [run for run in runs if run["name"] == name]
    rate = lambda value: study.percent_spread(study.mean_spread([value(run) for run in of]))
    balanced = [rate(lambda run: run["families"][family]["balanced_accuracy"]) for family in learning_curve.FAMILIES]
    return [name, rate(learning_curve.worst_family), rate(learning_curve.mean_of_families), *balanced]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", default=140, type=int)
    parser.add_argument("--seeds", default="1,2,3")
    parser.add_argument("--test-scenes", default=1000, type=int, help="of the test corpus, before its split (default 1000)")
    parser.add_argument("--only", choices=["columns", "yards"], help="one of the two tables")
    study.add_arguments(parser, "ablation")
    options = parser.parse_args()
    seeds = [int(n) for n in options.seeds.split(",")]
    scenes, test_scenes = options.scenes, options.test_scenes
    columns, yards = dict(COLUMNS), dict(YARDS)
    for k, family in enumerate(TRAINING_FAMILIES):
        yards[f"no {family} in training"] = [f"families.{k}.weight=1e-9"]
    if options.quick:
        seeds, scenes, test_scenes, columns, yards = [1], 70, 500, dict(list(columns.items())[:1]), dict(list(yards.items())[:1])
    columns = {} if options.only == "yards" else columns
    yards = {} if options.only == "columns" else yards
    marsyard = study.Marsyard(options.marsyard, options.work, options.threads)
    per_shard = learning_curve.PER_SHARD
    test = marsyard.corpus("test", learning_curve.CONFIG, ["seed=99"], test_scenes, per_shard)
    whole = marsyard.corpus("whole", learning_curve.CONFIG, [], scenes, per_shard)
    runs = [judged(marsyard, "all of it", whole, seed, test) for seed in seeds]
    for name, taken in columns.items():
        features = "features=listed" if taken is None else f"features={{columns: [{', '.join(taken)}]}}"
        runs += [judged(marsyard, name, whole, seed, test, [features]) for seed in seeds]
    for k, (name, sets) in enumerate(yards.items()):
        corpus = marsyard.corpus(f"yard-{k}", learning_curve.CONFIG, sets, scenes, per_shard)
        runs += [judged(marsyard, name, corpus, seed, test) for seed in seeds]
    head = ["", "worst family", "mean of families", *learning_curve.FAMILIES]
    tables = [("## Columns", columns), ("## Yards and families of training", yards)]
    text = "\n\n".join([
        "# What each ingredient of mixed.yaml brings on families held out",
        f"`python scripts/ablation.py`, {study.versions(marsyard)['marsyard']}; {scenes} scenes, {len(seeds)} seeds of the training, mean ± standard "
        f"deviation over them. Balanced accuracy by cells, percent. Test: {test_scenes} scenes of another seed, of them the test split.",
        *(part for title, names in tables if names
          for part in (title, study.markdown(head, [row(name, runs) for name in ["all of it", *names]])))]) + "\n"
    study.write_results(options.out, "ablation", {"versions": study.versions(marsyard), "runs": runs}, text)


if __name__ == "__main__":
    main()
