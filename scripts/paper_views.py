#!/usr/bin/env python3
"""What drawn headings and goals, more rocks and the datasheet's noise in configs/paper.yaml are worth to a network, beside the earlier yard.

    python scripts/paper_views.py [--seeds 3] [--scenes 1000]

Three yards: the earlier one, whose rover looked at the nearest of fewer rocks and drove at it; the same noise with the views of paper.yaml;
paper.yaml. A network learns each (the Kalman filter's, configs/train/ekf.yaml) and is judged on the test scenes of all three of another seed, which nobody learnt
from. What scans show is of `marsyard inspect` and of the cells. Needs numpy and pyarrow. Writes paper_views.json and paper_views.md into scripts/results.
"""

import argparse
import json
import pathlib

import numpy as np
import pyarrow.compute as pc
import pyarrow.parquet as pq

import study

EARLIER_NOISE = ["sweep.effects.range_noise={}"]
EARLIER_VIEWS = [
    "scene.rocks.count={uniform: [10, 30]}",
    "drive.start.near_obstacle_m={uniform: [1, 4]}",
    "drive.path={toward_obstacle: {length_m: {uniform: [0.5, 3]}}}",
]
YARDS = {
    "earlier": [*EARLIER_NOISE, *EARLIER_VIEWS],
    "drawn views, earlier noise": EARLIER_NOISE,
    "paper.yaml": [],
}
JUDGED_SEED = 20172017
AHEAD = 6  # of the sectors of 30 degrees that `inspect` tells bearings in


def slug(name):
    return "-".join(name.replace(",", "").replace(".", "-").split())


def of_obstacles(place):
    """Over scenes, each with one scan: the median of the least range of a cell with points of a rock, metres, and the mean share of such points that
    lie on one rock."""
    nearest_m, shares = [], []
    for file in sorted(pathlib.Path(place, "data", "cells").glob("*.parquet")):
        table = pq.read_table(file, columns=["scene_id", "range_m", "truth_object_id", "truth_obstacle_points"])
        table = table.filter(pc.greater(table["truth_obstacle_points"], 0))
        scenes, ranges_m, objects, points = (table[name].to_numpy() for name in table.column_names)
        for scene in np.unique(scenes):
            of = scenes == scene
            nearest_m.append(ranges_m[of].min())
            on_each = np.bincount(objects[of], points[of])
            shares.append(on_each.max() / on_each.sum())
    return float(np.median(nearest_m)), float(np.mean(shares))


def shown(marsyard, place):
    """What scans show of rocks, and the share of untraversable cells."""
    told = json.loads(marsyard.run("inspect", place, "--json"))
    views = told["views"]["default"]
    whole = lambda counts: max(sum(counts), 1)
    nearest_m, on_one = of_obstacles(place)
    return {
        "ahead": views["nearest_bearings"][AHEAD] / whole(views["nearest_bearings"]),
        "two_and_more": sum(views["obstacles_in_view"][2:]) / whole(views["obstacles_in_view"]),
        "nearest_m": nearest_m,
        "on_one": on_one,
        "untraversable": told["splits"]["train"]["untraversable_share"],
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--scenes", type=int, default=1000)
    study.add_arguments(parser, "paper_views")
    options = parser.parse_args()
    if options.quick:
        options.seeds, options.scenes = 1, 40
    marsyard = study.Marsyard(options.marsyard, options.work, options.threads)
    config, shard = study.ROOT / "configs" / "paper.yaml", max(options.scenes // 20, 1)
    learnt = {name: marsyard.corpus(slug(name), config, sets, options.scenes, shard) for name, sets in YARDS.items()}
    judged = {name: marsyard.corpus(slug(name) + "-judged", config, [*sets, f"seed={JUDGED_SEED}"], options.scenes, shard) for name, sets in YARDS.items()}
    facts = {name: shown(marsyard, place) for name, place in learnt.items()}
    runs, spreads = [], {"points_per_cell": {}, "range_m": {}}
    for name in YARDS:
        for seed in range(1, options.seeds + 1):
            run = marsyard.train(slug(name), [learnt[name]], seed, study.KALMAN_FILTER)
            for of, place in judged.items():
                report = marsyard.evaluate(run, place, f"on-{slug(of)}")
                rates = report["groups"][0]["network"]["at"][0]["cells"]
                keys = ("balanced_accuracy", "missed_untraversable", "false_untraversable")
                runs.append({"learnt": name, "judged": of, "seed": seed} | {key: rates[key] for key in keys})
                if name == of == "paper.yaml":
                    for spread, bins in spreads.items():
                        for told in report[spread]["bins"]:
                            bins.setdefault((told["from"], told["to"]), []).append((told["false_untraversable"], told["missed_untraversable"]))

    def cell(of, on, key, digits=2):
        values = [run[key] for run in runs if (run["learnt"], run["judged"]) == (of, on)]
        return study.percent_spread(study.mean_spread(values), digits)

    head = ["the yard", "nearest rock, m (median)", "within 15 degrees of ahead", "two rocks and more in view", "rock points on one rock", "untraversable cells"]
    shares = ("ahead", "two_and_more", "on_one", "untraversable")
    table = [[name, f"{fact['nearest_m']:.2f}", *(study.percent(fact[key], 1) + " %" for key in shares)] for name, fact in facts.items()]
    text = [
        "# The views of paper.yaml",
        f"`python scripts/paper_views.py`, {study.versions(marsyard)['marsyard']}; {options.scenes} scenes a yard, networks of the Kalman filter (configs/train/ekf.yaml), mean ± standard "
        f"deviation over {options.seeds} trainings; judged on the test scenes of seed {JUDGED_SEED}.",
        study.markdown(head, table),
    ]
    for key, title in (("balanced_accuracy", "balanced accuracy %"), ("missed_untraversable", "missed %"), ("false_untraversable", "false alarms %")):
        rows = [[f"learnt on {of}", *(cell(of, on, key) for on in YARDS)] for of in YARDS]
        text.append(study.markdown([title, *(f"judged on {on}" for on in YARDS)], rows))
    for spread, title in (("points_per_cell", "points in the cell"), ("range_m", "range, m")):
        means = lambda told: [study.percent_spread(study.mean_spread([both[k] for both in told])) for k in (0, 1)]
        rows = [[f"{least:g} and more" if most is None else f"{least:g} to below {most:g}", *means(told)] for (least, most), told in spreads[spread].items()]
        text.append(study.markdown([f"learnt and judged on paper.yaml: {title}", "false alarms %", "missed %"], rows))
    study.write_results(options.out, "paper_views", {"versions": study.versions(marsyard, np), "scans": facts, "runs": runs}, "\n\n".join(text) + "\n")


if __name__ == "__main__":
    main()
