"""What networks of configs/mixed.yaml are worth on kinds of yard that no choice was measured on: five fresh families, judged once.

Usage:  cargo build --release
        python scripts/fresh_families.py [--sizes 400,2000] [--seeds 1,2,3] [--quick]

The held-out families of configs/mixed.yaml have become development data: columns, members, rates and forms of training were chosen by them. The
families of scripts/fresh_families.yaml (forest floor, gravel quarry, meadow, lava field, farmyard) were written, looked at in pictures and given
cells of both classes before any network was judged on them, and were left as they were afterwards. They stay fresh as long as this holds:
no setting, column or yard of this project may be chosen by them. Whoever has changed a thing because of a figure of this study needs other families.

What goes in is both configs. configs/mixed.yaml is cut to each size, and on it learn: the default network; at the smaller size also the Kalman
filter (configs/train/ekf.yaml) and the default trainer with the paper's columns alone (features: listed); trees (LightGBM, held_out.py) on the
default's columns and all rows, at the larger size with the first seed alone; and one threshold on the height difference within a cell, chosen on
the validation scenes of the larger size. None of them has seen a fresh yard. Beside them stand trees that learnt from other yards of the fresh
families, another seed's: what they leave of the error is in the columns and labels. All are judged on the same scenes at 0.5; see held_out.py for
the intervals.

What comes out: the default's rates by family at the larger size, what its probabilities and `--doubtful 1%` are worth there (doubt.py), and for
each learner the mean of the families, the worst one, and the paired differences to the default of the larger size.

Needs numpy, pyarrow, lightgbm, scikit-learn and scipy. Writes fresh_families.json and fresh_families.md into scripts/results.
"""

import argparse

import numpy as np
import pyarrow.parquet as parquet

import held_out
import study
from compare_measures import best_threshold
from doubt import Network, calibration_error, doubtful_row, log_loss
from transfer import outputs

CONFIG = study.ROOT / "scripts" / "fresh_families.yaml"
OWN_SEED = 2030
HEIGHT = "height_difference_m"
ALLOWED = 0.01


def families_of(place):
    """Names of the families that a corpus holds."""
    return sorted(set(parquet.read_table(place / "data" / "scenes", columns=["family"])["family"].to_pylist()))


def kept(path, make):
    """Scores that lie in the work folder, or are made and kept there."""
    if not path.exists():
        study.note(f"score {path.stem}")
        path.parent.mkdir(exist_ok=True)
        np.save(path, make())
    return np.load(path)


class Learners:
    """Scores of all learners on the fresh yards, by name: one array for each training."""

    def __init__(self, marsyard, sizes, seeds, test_scenes):
        self.marsyard, self.seeds, self.scores = marsyard, seeds, {}
        self.corpora = {size: marsyard.corpus(f"mixed-{size}", held_out.CONFIG, [], size, held_out.PER_SHARD) for size in sizes}
        self.test, self.own = (marsyard.corpus(name, CONFIG, sets, test_scenes, held_out.PER_SHARD)
                               for name, sets in (("fresh", []), ("fresh-own", [f"seed={OWN_SEED}"])))
        self.families = families_of(self.test)
        small, large = sizes[0], sizes[-1]
        self.default = self.networks(f"network, {large} scenes", large)
        others = self.networks(f"network, {small} scenes", small)
        others += self.networks(f"Kalman filter, {small} scenes", small, study.KALMAN_FILTER)
        others += self.networks(f"the paper's columns, {small} scenes", small, ["features=listed"])
        self.columns = self.default[0].about["features"]
        every_column = {name: None for network in self.default + others for name in network.about["features"]}
        self.cells = held_out.read(self.test, [*every_column, HEIGHT], families=self.families)
        for network in self.default + others:
            scores = kept(marsyard.work / "scores" / f"{network.run.name}.npy", lambda: outputs(network.exported, self.cells))
            self.scores.setdefault(network.learner, []).append(scores)
        self.trees(f"trees, {small} scenes", self.corpora[small], seeds)
        self.trees(f"trees, {large} scenes", self.corpora[large], seeds[:1])
        self.trees(f"trees, {test_scenes} other fresh yards", self.own, seeds, self.families)
        validation = held_out.read(self.corpora[large], [HEIGHT], ["validation"])
        self.least_m, _ = best_threshold(validation["label"], validation[HEIGHT].astype(float))
        self.scores["one height threshold"] = [0.5 + self.cells[HEIGHT].astype(float) - self.least_m]

    def networks(self, learner, size, sets=()):
        """Trained networks of one learner, each with its run folder and its learner's name."""
        found = []
        for seed in self.seeds:
            run = self.marsyard.train(learner.replace(" ", "-").replace(",", "").replace("'", ""), [self.corpora[size]], seed, sets)
            found.append(Network(self.marsyard, run))
            found[-1].run, found[-1].learner = run, learner
        return found

    def trees(self, learner, corpus, seeds, families=held_out.TRAINING + held_out.FAMILIES):
        def learn(seed):
            cells, validation = (held_out.read(corpus, self.columns, [split], families) for split in ("train", "validation"))
            return held_out.trees(cells, validation, self.columns, seed)(self.cells)

        name = learner.replace(" ", "-").replace(",", "")
        self.scores[learner] = [kept(self.marsyard.work / "scores" / f"{name}-{seed}.npy", lambda: learn(seed)) for seed in seeds]


def by_family(learners, judged, scores):
    """The default's rates, probabilities and doubt in each family: rows of the table, and facts."""
    rows, facts, family_of_cell = [], judged.facts(), learners.cells["family_of_scene"][learners.cells["scene"]]
    for number, family in enumerate(learners.families):
        at = family_of_cell == number
        untraversable = learners.cells["label"][at] == 1
        probabilities = [network.probabilities(of[at]) for network, of in zip(learners.default, scores)]
        error, loss = (np.mean([measure(p, untraversable) for p in probabilities]) for measure in (calibration_error, log_loss))
        here = [{"test": [of[at]]} for of in scores]
        aside, _, missed, false = doubtful_row(learners.default, here, {"label": learners.cells["label"][at]}, ALLOWED)
        intervals = [held_out.told((judged.by_family[family][k], judged.draws[family][:, k])) for k in (2, 0, 1)]
        rows.append([family, f"{untraversable.mean():.1%}", *intervals, f"{100 * error:.2f}", f"{loss:.3f}", aside, missed, false])
        facts[family] |= {"scenes": int((learners.cells["family_of_scene"] == number).sum()), "cells": len(untraversable),
                          "untraversable_share": float(untraversable.mean()), "calibration_error": float(error), "log_loss_nats": float(loss),
                          "doubtful_percent": float(aside), "doubtful_missed_percent": float(missed), "doubtful_false_percent": float(false)}
    return rows, facts


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", default="400,2000", help="scenes of the smaller and the larger training corpus (default 400,2000)")
    parser.add_argument("--seeds", default="1,2,3")
    parser.add_argument("--test-scenes", default=350, type=int, help="of the fresh families (default 350)")
    study.add_arguments(parser, "fresh_families")
    options = parser.parse_args()
    sizes, seeds, test_scenes = [int(n) for n in options.sizes.split(",")], [int(n) for n in options.seeds.split(",")], options.test_scenes
    if options.quick:
        sizes, seeds, test_scenes = [70, 140], seeds[:1], 70
    marsyard = study.Marsyard(options.marsyard, options.work, options.threads)
    learners = Learners(marsyard, sizes, seeds, test_scenes)
    counts = {name: [held_out.counts(learners.cells, scores) for scores in of] for name, of in learners.scores.items()}
    judged = {name: held_out.Judgement(learners.cells, of, learners.families, learners.families) for name, of in counts.items()}
    name_of_default = learners.default[0].learner
    default = judged[name_of_default]
    rows, facts = by_family(learners, default, learners.scores[name_of_default])
    less = lambda of, part: "" if of is default else held_out.told_difference(part(of), part(default))
    mean, worst = held_out.Judgement.mean, held_out.Judgement.worst
    compared = [[name, len(learners.scores[name]), held_out.told(of.mean()), less(of, mean), held_out.told(of.worst()), less(of, worst),
                 *(f"{100 * of.balanced(family)[0]:.1f}" for family in learners.families)] for name, of in judged.items()]
    head = ["", "untraversable", "balanced accuracy", "missed", "false", "calibration error", "log loss, nats", "doubtful at 1 %", "missed", "false"]
    text = f"""# Families of yards that no choice was measured on

`python scripts/fresh_families.py`, {study.versions(marsyard)['marsyard']}. {test_scenes} scenes, {len(learners.cells['label']):,} cells.
By cells at 0.5, percent, with 95 % intervals over scenes and trainings; differences in points. No setting may be chosen by these figures.

## The default network, {sizes[-1]} scenes of mixed.yaml, {len(seeds)} trainings

Calibration error in points, of the model's probabilities. Last: what `--doubtful 1%` sets aside, and what is missed and falsely called all the same.

{study.markdown(head, rows)}

## All learners

Differences are to the default of {sizes[-1]} scenes; each learner has its own worst family. The height threshold is {learners.least_m:.3f} m.

{study.markdown(["", "trainings", "mean of families", "less the default", "worst family", "less the default's worst", *learners.families], compared)}
"""
    told = {name: {"trainings": len(counts[name]), "mean_of_families": float(of.mean()[0]), "worst_family": float(of.worst()[0]),
                   "families": of.facts()} for name, of in judged.items()}
    results = {"versions": study.versions(marsyard, np), "sizes": sizes, "seeds": seeds, "default_by_family": facts,
               "height_threshold_m": learners.least_m, "learners": told}
    study.write_results(options.out, "fresh_families", results, text)


if __name__ == "__main__":
    main()
