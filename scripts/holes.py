"""How many cells of holes a network misses in yards of holes that it has never seen, and what it calls a hole where there is none.

Usage:  cargo build --release
        python scripts/holes.py [--seeds 1,2,3] [--work FOLDER] [--quick]

Trains on configs/holes.yaml, yards with trenches, holes, drop-offs, banks and stones under one laser, and judges on other yards (`HELD_OUT`): holes
0.2 to 1.5 m wide, deeper than the limit, on other ground, from another height, in another order of draws; and on the same yards with the
holes filled in, since their ground stands at the same addresses. Counted are cells whose centres lie 1 to 6 m from the sensor, of scans
of a rover that stands level within 10 degrees; a cell is untraversable where the ground falls by more than LIMIT_M (`max_drop_m`).

Beside the network (`features: seen+unseen`) stand the classical detector, which calls a cell by the drop, the excess and the nearness of its
gap, and gradient-boosted trees (LightGBM) on the network's own rows. The threshold of each is set at 3 % false calls on yards like those of
training without holes, which nothing learnt from; the filled yards then say what it is worth. Then: of which cells the misses are.

Needs numpy, pyarrow and lightgbm. Writes holes.json and holes.md into scripts/results.
"""

import argparse
import json

import numpy as np
import pyarrow
import pyarrow.parquet as parquet

import study
from transfer import outputs

#: The drop in metres that a rover must not take.
LIMIT_M = 0.15
#: Ranges that are judged, metres; greatest tilt of the rover.
NEAR_M, FAR_M, TILT_DEG = 1.0, 6.0, 10.0
#: False calls that thresholds are set for, on yards like those of training without holes.
FALSE = 0.03
KEYS = ["scene_id", "scan_id", "row", "col", "label", "points", "range_m", "truth_class", "truth_drop_m", "truth_pit_m", "pitch_rad", "roll_rad"]

CONFIG = study.ROOT / "configs" / "holes.yaml"
#: What differs in the yards of the test: other ground, fewer and smaller stones, another height of the sensor, another seed.
HELD_OUT = ["seed=77", "scene.ground.source={random: {rms_height_m: {uniform: [0.02, 0.25]}, correlation_length_m: {uniform: [4, 8]}}}",
            "scene.rocks={count: {uniform: [0, 10]}, diameter_m: {log_uniform: [0.1, 0.5]}}", "sweep.mount.z_m={uniform: [0.9, 1.3]}"]
NO_HOLES = "scene.ground.features=[]"
HOLES = ("scene.ground.features=["
         "{trench: {count: 2, depth_m: {uniform: [0.25, 1.2]}, width_m: {uniform: [0.2, 1.5]}, length_m: {uniform: [2, 5]}, rounding_m: 0.05, lip_m: {uniform: [0, 0.04]}}},"
         "{hole: {count: 8, depth_m: {uniform: [0.25, 1.2]}, width_m: {uniform: [0.2, 1.5]}, rounding_m: 0.05, lip_m: {uniform: [0, 0.04]}}}]")


def read(corpus, split):
    """The columns of a split (or of all) as arrays, with `judged`: level rover, range, known label."""
    paths = sorted((corpus / "data" / "cells").glob(f"{split}-*.parquet"))
    table = pyarrow.concat_tables([parquet.read_table(path) for path in paths])
    cells = {name: table[name].to_numpy() for name in table.column_names}
    label = table["label"].to_numpy(zero_copy_only=False).astype(float)
    tilt = np.hypot(cells["pitch_rad"], cells["roll_rad"])
    cells["judged"] = (tilt < np.radians(TILT_DEG)) & (cells["range_m"] >= NEAR_M) & (cells["range_m"] <= FAR_M) & ~np.isnan(label)
    # A hole's own cells; the lips, up to 0.3 m around, are another matter, and so are stones.
    cells["hole"] = cells["truth_pit_m"] > LIMIT_M
    cells["ground"] = label == 0
    return cells


def classical(cells):
    """A hole is where beams passed below the plane before a gap, or landed below it: at the gap and 0.3 m around it."""
    near = np.minimum(cells["gap_from_m"], cells["gap_to_m"]) > -0.3
    length = np.maximum(cells["gap_excess_m"], 0.0)
    return np.where(near & (length > 0), np.minimum(cells["gap_drop_m"], length), 0.0)


def threshold(scores, cells, share=FALSE):
    """The score that this share of the judged ground reaches."""
    ground = np.sort(scores[cells["judged"] & cells["ground"]])
    return np.nextafter(ground[int(np.ceil((1 - share) * len(ground))) - 1], np.inf)


def lips_found(cells, called):
    """Of a hole's outermost cells (with a cell that is none of a hole's in the eight around), the share with a called cell within one."""
    keys = np.stack([cells[name].astype(np.int64) for name in KEYS[:4]], axis=1)
    sets = {}
    for name, mask in [("outside", ~cells["hole"]), ("called", called)]:
        sets[name] = {tuple(key) for key in keys[mask]}
    around = [(r, c) for r in (-1, 0, 1) for c in (-1, 0, 1)]
    lips = found = 0
    for scene, scan, row, col in keys[cells["judged"] & cells["hole"]]:
        near = [(scene, scan, row + r, col + c) for r, c in around]
        if any(key in sets["outside"] for key in near):
            lips += 1
            found += any(key in sets["called"] for key in near)
    return found / max(lips, 1)


def rates(scores, least, holes, filled, scores_filled):
    hole = holes["judged"] & holes["hole"]
    seen = hole & (holes["points"] > 0)
    called = scores >= least
    ground = filled["judged"] & filled["ground"]
    beside = holes["judged"] & holes["ground"]
    return {
        "missed": 1 - called[hole].mean(), "missed_seen": 1 - called[seen].mean(),
        "missed_unseen": 1 - called[hole & ~seen].mean(), "false": (scores_filled >= least)[ground].mean(),
        "false_beside_holes": called[beside].mean(), "lips": lips_found(holes, called),
    }


def misses(scores, least, cells):
    """Missed shares by range, drop and what the beams know."""
    hole = cells["judged"] & cells["hole"]
    missed = scores < least
    found = {}
    for name, edges in [("range_m", [1, 2, 3, 4, 5, 6]), ("truth_pit_m", [0.15, 0.2, 0.3, 0.5, 1, 2]), ("points", [0, 1, 2, 5, 20, 1e9]),
                        ("gap_length_m", [0, 1e-6, 0.2, 0.4, 0.8, 1.6, 99]), ("gap_drop_m", [-9, 0.02, 0.05, 0.1, 0.2, 9])]:
        for low, high in zip(edges, edges[1:]):
            inside = hole & (cells[name] >= low) & (cells[name] < high)
            if inside.any():
                share = inside.sum() / hole.sum()
                found[f"{name} {low:g} to {high:g}"] = {"missed": float(missed[inside].mean()), "share": float(share)}
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    study.add_arguments(parser, "holes")
    parser.add_argument("--seeds", default="1,2,3", help="seeds of the trainings")
    arguments = parser.parse_args()
    import lightgbm

    seeds = [int(seed) for seed in arguments.seeds.split(",")][:1 if arguments.quick else None]
    marsyard = study.Marsyard(arguments.marsyard, arguments.work, arguments.threads)
    train_scenes, test_scenes = (60, 14) if arguments.quick else (140, 28)
    corpora = {"training": marsyard.corpus("training", CONFIG, [], train_scenes, train_scenes // 20)}
    for name, features, unseen in [("holes", HOLES, "{}"), ("filled", NO_HOLES, "{}"), ("wide", HOLES, "{ around_m: 5 }")]:
        sets = [*HELD_OUT, features, f"cells.unseen={unseen}"]
        corpora[name] = marsyard.corpus(name, CONFIG, sets, test_scenes, test_scenes // 7)
    holes, filled, wide = (read(corpora[name], "*") for name in ["holes", "filled", "wide"])
    corpora["even"] = marsyard.corpus("even", CONFIG, ["seed=12", NO_HOLES], test_scenes, test_scenes // 7)
    validation, learnt = read(corpora["even"], "*"), read(corpora["training"], "train")

    results = {"network": [], "trees": [], "classical": []}
    least = threshold(classical(validation), validation)
    results["classical"].append(rates(classical(holes), least, holes, filled, classical(filled)))
    where = {"classical": misses(classical(holes), least, holes)}
    for seed in seeds:
        run = marsyard.train("network", [corpora["training"]], seed, [*study.KALMAN_FILTER, "features=seen+unseen", "epochs=10"])
        model = json.loads(marsyard.run("export", "--json", "-", run))
        scores = {name: outputs(model, cells) for name, cells in [("validation", validation), ("holes", holes), ("filled", filled)]}
        least = threshold(scores["validation"], validation)
        results["network"].append(rates(scores["holes"], least, holes, filled, scores["filled"]))
        where.setdefault("network", misses(scores["holes"], least, holes))

        features = model["about"]["features"]
        table = lambda cells: np.stack([cells[name] for name in features], axis=1)
        known = learnt["judged"]
        trees = lightgbm.LGBMClassifier(n_estimators=400, num_leaves=63, learning_rate=0.05, random_state=seed, n_jobs=arguments.threads,
                                        class_weight="balanced", verbose=-1, deterministic=True)
        trees.fit(table(learnt)[known], (learnt["label"] == 1)[known])
        chance = lambda cells: trees.predict_proba(table(cells))[:, 1]
        least = threshold(chance(validation), validation)
        results["trees"].append(rates(chance(holes), least, holes, filled, chance(filled)))
        where.setdefault("trees", misses(chance(holes), least, holes))
    cells_of = lambda cells: int((cells["judged"] & cells["hole"]).sum())
    told = {
        "versions": study.versions(marsyard, np, pyarrow, lightgbm), "seeds": seeds,
        "rows": {"train": len(learnt["label"]), "hole_cells": cells_of(holes),
                 "hole_cells_without_points": int((holes["judged"] & holes["hole"] & (holes["points"] == 0)).sum()),
                 "ground_cells_filled": int((filled["judged"] & filled["ground"]).sum())},
        "coverage": cells_of(holes) / cells_of(wide),
        "rates": {who: {key: study.mean_spread([one[key] for one in all_of]) for key in all_of[0]} for who, all_of in results.items()},
        "misses": where,
    }
    study.write_results(arguments.out, "holes", told, page(told))


def page(told):
    names = {"missed": "missed", "missed_seen": "missed, with points", "missed_unseen": "missed, without points",
             "lips": "lips found", "false": "false, holes filled in", "false_beside_holes": "called beside holes"}
    rows = [[who, *(study.percent_spread(rates[key], 1) for key in names)] for who, rates in told["rates"].items()]
    where = [[key, study.percent(entry["share"], 1), *(study.percent(told["misses"][who].get(key, {}).get("missed"), 1) for who in
              ["network", "trees", "classical"])] for key, entry in told["misses"]["network"].items()]
    count = told["rows"]
    return f"""# Holes in yards that were never seen

`python scripts/holes.py`, seeds {told["seeds"]}: {count["train"]} training rows; {count["hole_cells"]} cells of holes are judged
({count["hole_cells_without_points"]} hold no point), and {count["ground_cells_filled"]} cells of the same yards with the holes filled in. Of all
the holes' cells with beams before and behind them {study.percent(told["coverage"], 1)} % have a row. Thresholds: {100 * FALSE:g} % false on yards
like those of training without holes. Percent, mean and standard deviation over seeds.

{study.markdown(["detector", *names.values()], rows)}

Goal: missed at most 5 %, false at most 3 %.

## Where the misses are

Share of the holes' cells, and of those the missed (percent; seed {told["seeds"][0]}):

{study.markdown(["cells with", "share", "network", "trees", "classical"], where)}
"""


if __name__ == "__main__":
    main()
