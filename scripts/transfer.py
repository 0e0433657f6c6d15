"""How well a network trained in simulation works on a sensor and a kind of yard that it has never seen.

Usage:  cargo build --release
        python scripts/transfer.py [--seeds 1,2,3,4,5] [--corpus FOLDER] [--variants base,listed,...] [--quick]

Trains the Kalman filter's network on the training families of configs/mixed.yaml and judges it on the family that is held out: another
sensor, another ground, all kinds of obstacle together. Rates are by points, each with its cell's label (the paper's reading), and by
cells; for all cells and for those of three points or more; with and without the points on flat tops. Beside the network stands one
height-difference threshold. Every threshold but 0.5 is chosen on the validation split, which holds none of the unseen family:

  balanced      best balanced accuracy by cells
  missed 4.74   the highest threshold that misses at most 4.74 % of untraversable points (the paper's rate)
  false 0.81    the lowest threshold that calls at most 0.81 % of traversable points untraversable (the paper's rate)

Then it shows what the errors are made of: kind of thing, height above the ground, range, points in the cell, share of obstacle points,
borders. `--variants` compares settings of the trainer without a look at the unseen family: each training family in turn is left out
and judged, and the threshold-free AUC decides. Outputs are computed in NumPy from `marsyard export --json`; rates at 0.5 are checked
against `marsyard evaluate`.

Needs numpy and pyarrow. Writes transfer.json and transfer.md into scripts/results.
"""

import argparse
import json
import pathlib

import numpy as np
import pyarrow
import pyarrow.parquet as parquet

import network_json
import study

#: Paper, table 1: of untraversable points missed, of traversable points called untraversable.
MARK = {"missed": 0.0474, "false": 0.0081}
TRAINING = ["rock_field", "builders_yard", "orchard", "scrub", "bare_rough"]
UNSEEN = "unseen"
KINDS = ["ground", "rock", "box", "trunk", "grass", "bush", "crown"]
#: What `--variants` can compare: overrides of the default training.
VARIANTS = {
    "base": [], "patience20": ["patience=20"], "listed": ["features=listed"], "all": ["features=all"], "clip4": ["clip=4"],
    "natural": ["balance=none"], "small": ["network.hidden=[8]"], "slow": ["filter={ekf: {noise: {p0_over_r: 3}}}"],
    "targets01": ["targets=[0.0, 1.0]"],
}
TRUTH = ["scene_id", "scan_id", "row", "col", "label", "points", "range_m", "truth_obstacle_points", "truth_top_points",
         "truth_class"]


def read(corpus, split, features, family=None):
    """Columns of a split as arrays, in the order of the shards."""
    parts = []
    names = list(dict.fromkeys([*TRUTH, "mean_height_m", "height_difference_m", *features]))
    for path in sorted((corpus / "data" / "cells").glob(f"{split}-*.parquet")):
        table = parquet.read_table(path, columns=names)
        if family:
            scenes = parquet.read_table(corpus / "data" / "scenes" / path.name, columns=["scene_id", "family"])
            wanted = np.asarray(scenes["scene_id"])[np.asarray(scenes["family"]) == family]
            table = table.filter(pyarrow.array(np.isin(np.asarray(table["scene_id"]), wanted)))
        parts.append(table)
    table = pyarrow.concat_tables(parts)
    return {name: np.asarray(table[name]) for name in names}


def outputs(model, cells):
    """The network's outputs in f64."""
    columns = [cells[name].astype(np.float64) for name in model["about"]["features"]]
    found = np.empty(len(columns[0]))
    for start in range(0, len(found), 100_000):
        rows = np.stack([column[start:start + 100_000] for column in columns], axis=1)
        found[start:start + 100_000] = network_json.outputs(model, rows)
    return found


def curve(scores, untraversable, weights):
    """Thresholds ascending, with what is missed and what gives false alarm from each on."""
    order = np.argsort(scores, kind="stable")
    sorted_scores = scores[order]
    last = np.append(sorted_scores[1:] != sorted_scores[:-1], True)
    missed = np.cumsum(np.where(untraversable, weights, 0)[order])[last]
    passed = np.cumsum(np.where(untraversable, 0, weights)[order])[last]
    # From just above each score on: what scores that much or less is called traversable.
    middles = np.append(0.5 * (sorted_scores[last][:-1] + sorted_scores[last][1:]), sorted_scores[-1] + 1e-9)
    thresholds = np.insert(middles, 0, sorted_scores[0])
    return thresholds, np.insert(missed / missed[-1], 0, 0.0), np.insert(1.0 - passed / passed[-1], 0, 1.0)


def choose(scores, cells):
    """Thresholds by the three rules."""
    untraversable = cells["label"] == 1
    thresholds, missed, false = curve(scores, untraversable, np.ones(len(scores)))
    chosen = {"balanced": thresholds[np.argmin(missed + false)]}
    thresholds, missed, false = curve(scores, untraversable, cells["points"].astype(np.float64))
    chosen["missed 4.74"] = thresholds[np.flatnonzero(missed <= MARK["missed"])[-1]]
    chosen["false 0.81"] = thresholds[np.flatnonzero(false <= MARK["false"])[0]]
    return {rule: float(value) for rule, value in chosen.items()}


def five_rows(untraversable, called, weights):
    """The rows of table 1, and accuracies."""
    truly, wrong = weights[untraversable].sum(), weights[~untraversable].sum()
    missed = weights[untraversable & ~called].sum() / truly if truly else None
    false = weights[~untraversable & called].sum() / wrong if wrong else None
    everything = truly + wrong
    errors = weights[untraversable != called].sum()
    both = missed is not None and false is not None
    return {
        "untraversable": int(truly), "traversable": int(wrong), "missed_untraversable": missed, "false_untraversable": false,
        "all_wrong": errors / everything if everything else None,
        "balanced_accuracy": 1 - 0.5 * (missed + false) if both else None,
    }


def judge(cells, scores, threshold):
    """Table 1 by points and by cells, with and without tops, for all cells and for the well-seen ones."""
    called, untraversable = scores >= threshold, cells["label"] == 1
    points = cells["points"].astype(np.int64)
    tops = np.where(untraversable, np.minimum(cells["truth_top_points"], cells["truth_obstacle_points"]), 0)
    whole_top = (tops > 0) & (tops == cells["truth_obstacle_points"])
    ways = {"points": points, "cells": np.ones_like(points), "points_without_tops": points - tops,
            "cells_without_tops": np.where(whole_top, 0, 1)}
    judged = {}
    for group, least in (("all", 1), ("three", 3)):
        seen = points >= least
        judged[group] = {way: five_rows(untraversable[seen], called[seen], w[seen]) for way, w in ways.items()}
    return judged


def above_ground(cells):
    """Mean height over the mean of the true ground cells within a square of 2.1 m; NaN where there are none."""
    found = np.full(len(cells["row"]), np.nan)
    scan = cells["scene_id"] * 4096 + cells["scan_id"]
    borders = np.flatnonzero(np.diff(scan)) + 1
    for part in np.split(np.arange(len(scan)), borders):
        row, col = cells["row"][part] - cells["row"][part].min(), cells["col"][part] - cells["col"][part].min()
        ground = cells["truth_class"][part] == 0
        sums = np.zeros((2, row.max() + 22, col.max() + 22))
        sums[0, row[ground] + 11, col[ground] + 11] = cells["mean_height_m"][part][ground]
        sums[1, row[ground] + 11, col[ground] + 11] = 1
        sums = sums.cumsum(axis=1).cumsum(axis=2)
        high, low, right, left = np.minimum(row + 21, sums.shape[1] - 1), row, np.minimum(col + 21, sums.shape[2] - 1), col
        box = sums[:, high, right] - sums[:, low, right] - sums[:, high, left] + sums[:, low, left]
        with np.errstate(invalid="ignore"):
            found[part] = cells["mean_height_m"][part] - np.where(box[1] > 0.5, box[0] / box[1], np.nan)
    return found


def borders(cells):
    """Whether one of the eight neighbours that hold points has the other label."""
    scan = np.unique(cells["scene_id"] * 4096 + cells["scan_id"], return_inverse=True)[1].astype(np.int64)
    row, col = cells["row"].astype(np.int64), cells["col"].astype(np.int64)
    row, col = row - row.min() + 1, col - col.min() + 1
    width = col.max() + 2
    key = (scan * (row.max() + 2) + row) * width + col
    order = np.argsort(key)
    ordered = key[order]
    other = np.zeros(len(key), bool)
    for step in (-width - 1, -width, -width + 1, -1, 1, width - 1, width, width + 1):
        at = np.minimum(np.searchsorted(ordered, key + step), len(key) - 1)
        there = ordered[at] == key + step
        other |= there & (cells["label"][order[at]] != cells["label"])
    return other


def groupings(cells):
    """Names of groups, and each cell's group, for the tables of errors; grouping uses the truth, judging never does."""
    def binned(values, edges):
        names = [f"below {edges[0]:g} m", *[f"{a:g} to {b:g} m" for a, b in zip(edges, edges[1:])], f"from {edges[-1]:g} m",
                 "no ground seen within 1 m"]
        return names, np.where(np.isnan(values), len(edges) + 1, np.digitize(values, edges))

    points = np.digitize(cells["points"], [2, 3, 5, 9, 17])
    share = cells["truth_obstacle_points"] / cells["points"]
    return {
        "tallest thing in the cell": (KINDS, cells["truth_class"].astype(np.int64)),
        "mean height above the ground": binned(above_ground(cells), [-0.05, 0.05, 0.1, 0.2, 0.4]),
        "range": binned(cells["range_m"].astype(np.float64), [2, 4, 6, 8]),
        "points in the cell": (["1", "2", "3-4", "5-8", "9-16", "17 and more"], points),
        "height difference": binned(cells["height_difference_m"].astype(np.float64), [0.02, 0.05, 0.1, 0.2, 0.4]),
        "share of obstacle points": (["none", "up to a half", "more than a half", "all"],
                                     np.where(share == 0, 0, np.where(share <= 0.5, 1, np.where(share < 1, 2, 3)))),
        "border": (["within its kind", "beside a cell of the other label"], borders(cells).astype(np.int64)),
    }


def error_tables(cells, called_by_seed, groups):
    """Per grouping and group: points of each label, and the mean over seeds of what is missed, and of false alarms."""
    untraversable, points = cells["label"] == 1, cells["points"].astype(np.float64)
    found = {}
    for title, (names, group) in groups.items():
        rows = []
        for k, name in enumerate(names):
            row = {"group": name}
            for kind, truth in (("untraversable", untraversable), ("traversable", ~untraversable)):
                here = truth & (group == k)
                wrong = [points[here & (called != untraversable)].sum() for called in called_by_seed]
                every = [points[truth & (called != untraversable)].sum() for called in called_by_seed]
                total = points[here].sum()
                row[kind] = {
                    "points": int(total), "cells": int(here.sum()),
                    "wrong": float(np.mean(wrong) / total) if total else None,
                    "share_of_errors": float(np.sum(wrong) / max(np.sum(every), 1)),
                }
            if row["untraversable"]["points"] + row["traversable"]["points"]:
                rows.append(row)
        found[title] = rows
    return found


def leave_one_out(marsyard, corpora, variant, seeds):
    """Each training family judged by networks that learnt the four others, without thresholds."""
    rows = []
    for seed in seeds:
        for family in TRAINING:
            others = [corpora[name] for name in TRAINING if name != family]
            run = marsyard.train(f"{variant}-without-{family}", others, seed, [*study.KALMAN_FILTER, *VARIANTS[variant]])
            groups = marsyard.evaluate(run, corpora[family], "left-out")["groups"]
            at = groups[0]["network"]["at"][0]
            rows.append({"family": family, "seed": seed, "auc": groups[0]["network"]["auc"],
                         "auc_three": groups[1]["network"]["auc"], "balanced_accuracy": at["cells"]["balanced_accuracy"]})
    return rows


def table_1(title, judged, rules):
    """Rows of rules; columns of rates, mean and spread over seeds."""
    head = [title, "missed %", "false %", "all wrong %", "missed without tops %", "balanced, cells %", "missed, cells %", "false, cells %"]
    rows = []
    for name, seeds in rules:
        of = lambda way, rate: study.percent_spread(study.mean_spread([s[judged][way][rate] for s in seeds]))
        rows.append([name, of("points", "missed_untraversable"), of("points", "false_untraversable"), of("points", "all_wrong"),
                     of("points_without_tops", "missed_untraversable"), of("cells", "balanced_accuracy"),
                     of("cells", "missed_untraversable"), of("cells", "false_untraversable")])
    return study.markdown(head, rows)


def errors_text(tables):
    text = ""
    for title, rows in tables.items():
        head = [title, "untraversable points", "missed %", "of all missed %", "traversable points", "false %", "of all false %"]
        body = []
        for row in rows:
            cells = []
            for kind in ("untraversable", "traversable"):
                part = row[kind]
                share = study.percent(part["share_of_errors"], 1) if part["points"] else "-"
                cells += [f"{part['points']:,}", study.percent(part["wrong"], 1), share]
            body.append([row["group"], *cells])
        text += study.markdown(head, body) + "\n\n"
    return text


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    study.add_arguments(parser, "transfer")
    parser.add_argument("--config", default=study.ROOT / "configs" / "mixed.yaml", type=pathlib.Path)
    parser.add_argument("--corpus", type=pathlib.Path, help="a finished corpus of that config (default: built in the work folder)")
    parser.add_argument("--scenes", default=2000, type=int, help="of the corpus that is built (default 2000)")
    parser.add_argument("--seeds", default="1,2,3,4,5", help="of the networks (default 1,2,3,4,5)")
    parser.add_argument("--variants", default="", help=f"compare training settings by leaving families out: {', '.join(VARIANTS)}")
    parser.add_argument("--variant-seeds", default="1", help="of these networks (default 1)")
    parser.add_argument("--set", action="append", default=[], dest="sets", help="override of the training, as `marsyard train` takes it")
    arguments = parser.parse_args()
    seeds = [1] if arguments.quick else [int(seed) for seed in arguments.seeds.split(",")]
    scenes = 100 if arguments.quick else arguments.scenes
    marsyard = study.Marsyard(arguments.marsyard, arguments.work, arguments.threads)
    corpus = arguments.corpus or marsyard.corpus("mixed", arguments.config, [], scenes, max(scenes // 40, 1))

    features, models = [], {}
    for seed in seeds:
        run = marsyard.train("network", [corpus], seed, [*study.KALMAN_FILTER, *arguments.sets])
        models[seed] = json.loads(marsyard.run("export", "--json", "-", run))
        features = models[seed]["about"]["features"]
    validation, test = read(corpus, "validation", features), read(corpus, "test", features, UNSEEN)

    rules = {name: [] for name in ("0.5", "balanced", "missed 4.74", "false 0.81")}
    chosen, called, nearest, checked = {name: [] for name in rules}, [], [], []
    of_seed = {seed: outputs(model, test) for seed, model in models.items()}
    for seed, model in models.items():
        scores = of_seed[seed]
        thresholds = {"0.5": 0.5, **choose(outputs(model, validation), validation)}
        for name, threshold in thresholds.items():
            rules[name].append(judge(test, scores, threshold))
            chosen[name].append(threshold)
        called.append(scores >= thresholds["balanced"])
        _, missed, false = curve(scores, test["label"] == 1, test["points"].astype(np.float64))
        nearest.append({"false_at_missed_4.74": float(false[np.flatnonzero(missed <= MARK["missed"])[-1]]),
                        "missed_at_false_0.81": float(missed[np.flatnonzero(false <= MARK["false"])[0]])})
        report = marsyard.evaluate(arguments.work / "runs" / f"network-{seed}", corpus, "on-test")
        ours = five_rows(test["label"] == 1, scores >= 0.5, test["points"].astype(np.int64))
        [group] = [group for group in report["groups"] if group["group"] == {"family": UNSEEN}]
        theirs = group["network"]["at"][0]["points"]
        checked.append(max(abs(ours[rate] - theirs[rate]) for rate in ("missed_untraversable", "false_untraversable")))
    height = choose(validation["height_difference_m"].astype(np.float64), validation)
    height_rules = {name: [judge(test, test["height_difference_m"].astype(np.float64), t)] for name, t in height.items()}
    errors = error_tables(test, called, groupings(test))

    parts = {"everything": np.ones(len(test["points"]), bool)}
    parts["without cells of grass"] = test["truth_class"] != KINDS.index("grass")
    parts["solid things and ground alone"] = np.isin(test["truth_class"], [0, 1, 2, 3])
    parts["and of these, three points or more"] = parts["solid things and ground alone"] & (test["points"] >= 3)
    part_rows = {}
    for name, here in parts.items():
        untraversable = test["label"][here] == 1
        seeds_of = [five_rows(untraversable, c[here], test["points"][here].astype(np.int64)) for c in called]
        best = []
        for scores in of_seed.values():
            _, missed, false = curve(scores[here], untraversable, test["points"][here].astype(np.float64))
            best.append(float(false[np.flatnonzero(missed <= MARK["missed"])[-1]]))
        part_rows[name] = {"missed": study.mean_spread([s["missed_untraversable"] for s in seeds_of]),
                           "false": study.mean_spread([s["false_untraversable"] for s in seeds_of]),
                           "false_at_missed_4.74": study.mean_spread(best), "points": int(test["points"][here].sum())}

    variants = {}
    wanted = [name for name in arguments.variants.split(",") if name]
    if wanted:
        corpora = {}
        for k, name in enumerate(TRAINING):
            others = [f"families.{j}.weight=0" for j in range(len(TRAINING) + 1) if j != k]
            size = 20 if arguments.quick else 400
            corpora[name] = marsyard.corpus(name, arguments.config, others, size, size // 20)
        for variant in wanted:
            variants[variant] = leave_one_out(marsyard, corpora, variant, [int(s) for s in arguments.variant_seeds.split(",")])

    example = rules["0.5"][0]["all"]["points"]
    near = {key: study.mean_spread([n[key] for n in nearest]) for key in nearest[0]}
    network_rows = [(f"network, {name} (from {np.mean(chosen[name]):.3f})", s) for name, s in rules.items()]
    height_rows = [(f"height, {name} (from {height[name]:.3f} m)", s) for name, s in height_rules.items()]
    text = f"""# Trained in simulation, judged on what was never seen

`python scripts/transfer.py --seeds {','.join(map(str, seeds))}`: the Kalman filter's network, trained on the training families of `configs/mixed.yaml`, judged on its
held-out family `unseen` (another sensor, another ground, all kinds of obstacle together): {len(test['points']):,} cells with {test['points'].sum():,} points, {example['untraversable']:,}
untraversable and {example['traversable']:,} traversable ({study.percent(example['untraversable'] / (example['untraversable'] + example['traversable']), 1)} %). Mean ± standard deviation of {len(seeds)} seeds. By points unless a column says cells. Thresholds but
0.5 are chosen on the validation split, where the unseen family is not. Largest difference of a rate to what `marsyard evaluate`
says of that family: {max(checked):.1e}.

The paper, on real scans of another place: 4.74 % missed, 0.81 % false, 0.96 % all wrong; 3.65 % of its points were untraversable.

{table_1("all cells", "all", network_rows + height_rows)}

{table_1("cells of three points or more", "three", network_rows + height_rows)}

On the test's own curve, which no rule may look at: at 4.74 % missed, {study.percent_spread(near['false_at_missed_4.74'])} % false; at 0.81 % false, {study.percent_spread(near['missed_at_false_0.81'])} % missed.

## Which points, and why

At the balanced threshold, by points, mean over seeds.

{errors_text(errors)}The same network on parts of the same scans (the grouping uses the truth), at the balanced threshold; last, false alarms where the test's
own curve misses 4.74 %:

{study.markdown(["part", "points", "missed %", "false %", "false % at 4.74 % missed"], [[n, f"{r['points']:,}", study.percent_spread(r["missed"]), study.percent_spread(r["false"]), study.percent_spread(r["false_at_missed_4.74"])] for n, r in part_rows.items()])}
"""
    if variants:
        of = lambda rows, rate, family=None: study.mean_spread([r[rate] for r in rows if family in (None, r["family"])])["mean"]
        body = [[name, study.percent(of(rows, "auc")), study.percent(of(rows, "auc_three")), study.percent(of(rows, "balanced_accuracy")),
                 *[study.percent(of(rows, "auc", family)) for family in TRAINING]] for name, rows in variants.items()]
        text += f"""
## Settings, compared without the unseen family

Each training family left out in turn and judged by a network that learnt the other four (seeds {arguments.variant_seeds}): AUC by cells, percent. `base` is
the default.

{study.markdown(["setting", "AUC", "AUC, 3 points", "balanced at 0.5", *TRAINING], body)}
"""
    results = {"versions": study.versions(marsyard, np, pyarrow), "seeds": seeds, "training_overrides": arguments.sets,
               "mark": MARK, "thresholds": chosen, "height_thresholds_m": height, "network": rules, "height": height_rules,
               "nearest_to_mark": nearest, "difference_to_evaluate": checked, "errors": errors, "parts": part_rows,
               "leave_one_out": variants}
    study.write_results(arguments.out, "transfer", results, text)


if __name__ == "__main__":
    main()
