"""What networks of configs/mixed.yaml are worth on kinds of yard by which no setting was chosen.

Usage:  cargo build --release
        python scripts/fresh_families.py [--sizes 400,2000,8000] [--seeds 1,2,3] [--quick]

The held-out families of configs/mixed.yaml have become development data: columns, members, rates and forms of training were chosen by them. Five
other families (scripts/first_families.yaml: forest floor, gravel quarry, meadow, lava field, farmyard) were judged once by networks of
mixed.yaml. What was missed there led to scripts/broad.yaml, in whose yards all of it is drawn over wide ranges, and which was chosen of some
variants by these five; so they are development data now, too. The six of scripts/fresh_families.yaml were written before any network was
judged on them, by somebody who had not seen broad.yaml, and no setting of the trainer and no yard was moved after that. One thing was decided by them: that broad.yaml is not shipped in
the place of mixed.yaml, or beside it. Whoever decides another because of a figure of this study needs other families.

What goes in: mixed.yaml and broad.yaml at each of three sizes, the largest with the first seed alone, and the fresh and the first families. A rover's
wheel says what is an obstacle, no column tells it, and the families have rovers of three wheels; whoever trains knows their own. So a learner *for the
wheel* is three of them, whose labels are those of the three wheels (`train --labels`; of trees, by the formula of docs/columns.md), and each family is
judged by the one of its rover. Those that are not for the wheel have their corpus's own labels: of mixed.yaml those of the rover of each
family, of broad.yaml those of one rover (husky-a200). Beside the default network learn the Kalman filter (configs/train/ekf.yaml) on mixed.yaml at the
smallest size, and trees (LightGBM, held_out.py) on the default's columns, of mixed.yaml at the smallest size and of broad.yaml at the middle one, this with the first seed
alone. One threshold on the height difference within a cell is chosen on the validation scenes of mixed.yaml at the middle size. None of them has
seen a fresh yard. Beside them stand trees that learnt from other yards of the fresh families, another seed's, with the labels of its rovers: what they leave of the error is
in the columns, the labels, the wheel that they are not told, and the number of scenes. All are judged on the same scenes at 0.5; see held_out.py for the intervals.

What comes out: of the network of mixed.yaml at the middle size, for the wheel, the rates by fresh family, and what its probabilities and
`--doubtful 1%` are worth there (doubt.py); of each learner the mean of the families, the worst one, and the paired differences to that network; and
the same of the networks on the first families.

Trees learn 3 million cells at most, of the first scenes (held_out.py): of broad.yaml at the middle size half of them. Labels for another wheel are those that the stored truth
answers: where a plant that is as tall hides a stone in a cell, the cell is the plant's (docs/columns.md).

Needs numpy, pyarrow, pyyaml, lightgbm, scikit-learn and scipy. Writes fresh_families.json and fresh_families.md into scripts/results.
"""

import argparse

import numpy as np
import pyarrow.parquet as parquet
import yaml

import held_out
import study
from compare_measures import best_threshold
from doubt import Network, calibration_error, doubtful_row, log_loss
from transfer import outputs

HERE = study.ROOT / "scripts"
MIXED, BROAD = held_out.CONFIG, HERE / "broad.yaml"
OWN_SEED = 2030
HEIGHT = "height_difference_m"
TRUTH = ["truth_class", "truth_protrusion_m", "truth_obstacle_points", "truth_slope_rad"]
STEEP_DEG = 45
ALLOWED = 0.01
#: Of the families to be judged on, by the name of their config.
SCENES = {"fresh": 360, "first": 350}


def families_of(place):
    """Names of the families that a corpus holds."""
    return sorted(set(parquet.read_table(place / "data" / "scenes", columns=["family"])["family"].to_pylist()))


def wheel_of(rover):
    """Diameter of a shipped rover's wheels, metres."""
    return yaml.safe_load((study.ROOT / "configs" / "rovers" / f"{rover}.yaml").read_text())["wheel_diameter_m"]


def labels_for(wheel_m):
    """The rule of these configs for another wheel, as `train` takes it."""
    return f"labels={{obstacle: {{taller_than_m: {wheel_m}}}, max_ground_slope_deg: {STEEP_DEG}}}"


def labelled_for(cells, wheel_m):
    """The same rule as numbers: docs/columns.md has the formula."""
    solid = np.isin(cells["truth_class"], [1, 2, 3])
    plant = (cells["truth_class"] != 0) & (cells["truth_obstacle_points"] >= 1)
    obstacle = np.where(solid, cells["truth_protrusion_m"].astype(float) > wheel_m, plant)
    return {**cells, "label": (obstacle | (cells["truth_slope_rad"] > np.radians(STEEP_DEG))).astype(np.int8)}


class Yards:
    """Families to be judged on: their cells, and the wheel of each."""

    def __init__(self, marsyard, name, scenes):
        self.path = HERE / f"{name}_families.yaml"
        config = yaml.safe_load(self.path.read_text())
        self.place = marsyard.corpus(f"{name}-{scenes}", self.path, [], scenes, held_out.PER_SHARD)
        self.families = families_of(self.place)
        wheel = {family["name"]: wheel_of(family["drive"]["rover"]) for family in config["families"]}
        self.wheels = [wheel[family] for family in self.families]
        self.scenes = scenes

    def read(self, columns):
        self.cells = held_out.read(self.place, columns, families=self.families)
        self.family_of_cell = self.cells["family_of_scene"][self.cells["scene"]]

    def by_wheel(self, scores_of):
        """Scores of all cells, each family's by what is for its wheel: `scores_of(wheel, cells)`."""
        scores = np.empty(len(self.cells["label"]))
        for number, wheel in enumerate(self.wheels):
            at = self.family_of_cell == number
            scores[at] = scores_of(wheel, {name: of[at] for name, of in self.cells.items() if len(of) == len(at)})
        return scores


class Studied:
    """All learners, by name; each its trainings by seed, and a training a function of (wheel, cells) that gives scores."""

    def __init__(self, marsyard, sizes, seeds, scenes):
        self.marsyard, self.seeds, self.learners, self.networks = marsyard, seeds, {}, {}
        self.yards = [Yards(marsyard, name, scenes[name]) for name in scenes]
        self.wheels = sorted({wheel for yards in self.yards for wheel in yards.wheels})
        small, middle, large = sizes
        corpora = {(config.stem, size): marsyard.corpus(f"{config.stem}-{size}", config, [], size, held_out.PER_SHARD)
                   for config in (MIXED, BROAD) for size in sizes}
        self.default = f"mixed.yaml, {middle} scenes"
        for config in ("mixed", "broad"):
            for size in (middle, small, large):
                self.network(f"{config}.yaml, {size} scenes", corpora[config, size], seeds=seeds[:1] if size == large else seeds)
            self.network(f"{config}.yaml, {middle} scenes, not for the wheel", corpora[config, middle], for_wheel=False)
        self.network(f"Kalman filter, mixed.yaml, {small} scenes", corpora["mixed", small], study.KALMAN_FILTER)
        names = {name: None for of in self.networks.values() for by_wheel in of for network in by_wheel.values() for name in network.about["features"]}
        [first] = {tuple(network.about["features"]) for network in self.networks[self.default][0].values()}
        self.columns = list(first)
        for yards in self.yards:
            yards.read([*names, HEIGHT])
        self.trees(f"trees, mixed.yaml, {small} scenes", corpora["mixed", small], seeds)
        self.trees(f"trees, broad.yaml, {middle} scenes", corpora["broad", middle], seeds[:1])
        validation = held_out.read(corpora["mixed", middle], [HEIGHT], ["validation"])
        self.least_m, _ = best_threshold(validation["label"], validation[HEIGHT].astype(float))
        self.learners["one height threshold"] = {0: lambda _, cells: 0.5 + cells[HEIGHT].astype(float) - self.least_m}
        fresh = self.yards[0]
        own = marsyard.corpus(f"fresh-own-{fresh.scenes}", fresh.path, [f"seed={OWN_SEED}"], fresh.scenes, held_out.PER_SHARD)
        self.trees(f"trees, {fresh.scenes} other fresh yards", own, seeds, for_wheel=False)

    def network(self, learner, corpus, sets=(), for_wheel=True, seeds=None):
        """Trains the networks of a learner."""
        of_seeds = {}
        for seed in seeds or self.seeds:
            by_wheel = {}
            for wheel in self.wheels if for_wheel else [None]:
                name = f"{learner}-{wheel or 'own labels'}".replace(" ", "-").replace(",", "").replace(".yaml", "")
                run = self.marsyard.train(name, [corpus], seed, [*sets, *([labels_for(wheel)] if wheel else [])])
                by_wheel[wheel] = Network(self.marsyard, run)
            of_seeds[seed] = by_wheel
        self.networks[learner] = list(of_seeds.values())
        pick = lambda by_wheel, wheel: by_wheel.get(wheel) or by_wheel[None]
        self.learners[learner] = {seed: lambda wheel, cells, of=of: outputs(pick(of, wheel).exported, cells) for seed, of in of_seeds.items()}

    def trees(self, learner, corpus, seeds, for_wheel=True):
        models = {}

        def scores(wheel, cells, seed):
            of = (wheel if for_wheel else None, seed)
            if of not in models:
                models[of] = self.trees_of(corpus, seed, of[0])
            return models[of](cells)

        self.learners[learner] = {seed: lambda wheel, cells, seed=seed: scores(wheel, cells, seed) for seed in seeds}

    def trees_of(self, corpus, seed, wheel=None):
        study.note(f"trees of {corpus.name}, wheel {wheel}, seed {seed}")
        read = lambda split: held_out.read(corpus, [*self.columns, *TRUTH], [split], families_of(corpus), most=held_out.MOST_CELLS)
        cells, validation = (read(split) if wheel is None else labelled_for(read(split), wheel) for split in ("train", "validation"))
        return held_out.trees(cells, validation, self.columns, seed)

    def scores(self, learner, yards):
        """Of each training; kept in the work folder."""
        found = []
        for seed, training in self.learners[learner].items():
            name = f"{yards.place.name} {learner} {seed}".replace(" ", "-").replace(",", "")
            path = self.marsyard.work / "scores" / f"{name}.npy"
            if not path.exists():
                study.note(f"score {name}")
                path.parent.mkdir(exist_ok=True)
                np.save(path, yards.by_wheel(training))
            found.append(np.load(path))
        return found


def by_family(studied, yards, judged, scores):
    """The network's rates, probabilities and doubt in each family: rows of the table, and facts."""
    rows, facts = [], judged.facts()
    for number, (family, wheel) in enumerate(zip(yards.families, yards.wheels)):
        at = yards.family_of_cell == number
        networks = [by_wheel[wheel] for by_wheel in studied.networks[studied.default]]
        untraversable = yards.cells["label"][at] == 1
        probabilities = [network.probabilities(of[at]) for network, of in zip(networks, scores)]
        error, loss = (np.mean([measure(p, untraversable) for p in probabilities]) for measure in (calibration_error, log_loss))
        aside, _, missed, false = doubtful_row(networks, [{"test": [of[at]]} for of in scores], {"label": yards.cells["label"][at]}, ALLOWED)
        intervals = [held_out.told((judged.by_family[family][k], judged.draws[family][:, k])) for k in (2, 0, 1)]
        rows.append([family, f"{wheel:.2f} m", f"{untraversable.mean():.1%}", *intervals, f"{100 * error:.2f}", f"{loss:.3f}", aside, missed, false])
        facts[family] |= {"scenes": int((yards.cells["family_of_scene"] == number).sum()), "cells": len(untraversable), "wheel_m": wheel,
                          "untraversable_share": float(untraversable.mean()), "calibration_error": float(error), "log_loss_nats": float(loss),
                          "doubtful_percent": float(aside), "doubtful_missed_percent": float(missed), "doubtful_false_percent": float(false)}
    return rows, facts


def compared(studied, yards, learners):
    """Learners on some families: the table, what is told of each, and the network's judgement and scores."""
    scores = {name: studied.scores(name, yards) for name in learners}
    judged = {name: held_out.Judgement(yards.cells, [held_out.counts(yards.cells, one) for one in of], yards.families, yards.families)
              for name, of in scores.items()}
    default, mean, worst = judged[studied.default], held_out.Judgement.mean, held_out.Judgement.worst
    less = lambda of, part: "" if of is default else held_out.told_difference(part(of), part(default))
    rows = [[name, len(scores[name]), held_out.told(of.mean()), less(of, mean), held_out.told(of.worst()), less(of, worst),
             *(f"{100 * of.balanced(family)[0]:.1f}" for family in yards.families)] for name, of in judged.items()]
    head = ["", "trainings", "mean of families", "less the first", "worst family", "less the first's worst", *yards.families]
    told = {name: {"trainings": len(scores[name]), "mean_of_families": float(of.mean()[0]), "worst_family": float(of.worst()[0]),
                   "families": of.facts()} for name, of in judged.items()}
    return study.markdown(head, rows), told, default, scores[studied.default]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", default="400,2000,8000", help="scenes of three training corpora (default 400,2000,8000)")
    parser.add_argument("--seeds", default="1,2,3")
    study.add_arguments(parser, "fresh_families")
    options = parser.parse_args()
    sizes, seeds, scenes = [int(n) for n in options.sizes.split(",")], [int(n) for n in options.seeds.split(",")], SCENES
    if options.quick:
        sizes, seeds, scenes = [70, 140, 280], seeds[:1], {"fresh": 60, "first": 50}
    marsyard = study.Marsyard(options.marsyard, options.work, options.threads)
    studied = Studied(marsyard, sizes, seeds, scenes)
    fresh, first = studied.yards
    table, told, default, scores = compared(studied, fresh, studied.learners)
    rows, facts = by_family(studied, fresh, default, scores)
    table_of_first, told_of_first, *_ = compared(studied, first, studied.networks)
    head = ["", "wheel", "untraversable", "balanced accuracy", "missed", "false", "calibration error", "log loss, nats", "doubtful at 1 %", "missed", "false"]
    text = f"""# Families of yards by which no setting was chosen

`python scripts/fresh_families.py`, {study.versions(marsyard)['marsyard']}. {fresh.scenes} scenes, {len(fresh.cells['label']):,} cells.
By cells at 0.5, percent, with 95 % intervals over scenes and trainings; differences in points. No setting may be chosen by these figures.
Networks and trees of mixed.yaml and broad.yaml are for the wheel of the rover at hand where nothing else is said; what that is, is said at the head of the script. Intervals
of learners with one training are over scenes alone. One thing was decided by these figures: that broad.yaml is not shipped.

## The default network, {sizes[1]} scenes of mixed.yaml, {len(seeds)} trainings

Calibration error in points, of the model's probabilities. Last: what `--doubtful 1%` sets aside, and what is missed and falsely called all the same.

{study.markdown(head, rows)}

## All learners

Differences are to the first row; each learner has its own worst family. The height threshold is {studied.least_m:.3f} m.

{table}

## The five families by which broad.yaml was chosen

{first.scenes} scenes, {len(first.cells['label']):,} cells. What broad.yaml gains here it was chosen for; above is what such a choice is worth on other ground.

{table_of_first}
"""
    results = {"versions": study.versions(marsyard, np), "sizes": sizes, "seeds": seeds, "default_by_family": facts,
               "height_threshold_m": studied.least_m, "learners": told, "learners_on_first_families": told_of_first}
    study.write_results(options.out, "fresh_families", results, text)


if __name__ == "__main__":
    main()
