"""What networks that learnt from simulated yards alone are worth on real scans that people have labelled.

Usage:  cargo build --release
        python scripts/real_scans.py --data FOLDER [--sizes 140,400,2000] [--seeds 1,2,3] [--quick]

FOLDER holds the scans that scripts/real_scans.yaml lists (it says where they come from): KITTI .bin files with their .label files, the height of the
sensor, and which file of configs/labels says what a small rover can cross. No network, no setting and no yard was chosen by them; whoever
decides something by a figure of this study needs other scans.

What goes in: corpora of configs/mixed.yaml at each size, and at the middle one of scripts/broad.yaml. Networks by default learn them, with the labels as they are
and, of the largest corpus, for the wheels of two rovers (`train --labels`), by the squared error in place of the logarithmic loss, and with every second
member of rectified neurons; those of the largest judge a second and a third time, with the sensors said to stand 0.1 m lower and higher than elsewhere in this study, by which some other cells are judged; at the middle size the Kalman filter (configs/train/ekf.yaml) and
trees (LightGBM, held_out.py) too. One threshold on the height difference within a cell is chosen on the validation scenes of the largest corpus.

Each scan is read by `marsyard classify --sensor-height`, as a user without poses would: it fits the ground, levels the scan and bins it. A cell with a
point that people call an obstacle is untraversable, one whose points they call ground is traversable; points without a label count in
the features and nowhere else, and cells of none but those are not judged.

Scans of a place see nearly the same (of the streets: five scans of some 90 m), so rates are of all scans of a place together, and means are over places. Intervals of 95 %
come from draws of places and of trainings, with the same draws of places for all learners, and of both recordings where a spot was recorded twice: they say how places
of these kinds differ, not what another site has, for all of them are of four sites. Three trainings make them somewhat too narrow.

The area under the ROC curve is of each place's cells by their output, and log loss of their calibrated probabilities, in nats; means over places.

What comes out: rates of each place by the default network, its probabilities and what `--doubtful 1%` leaves; what share of the points of each label, such as wall or grass,
lies in cells that the network of the first training calls untraversable; and of each learner the mean over places and of each site, with differences to the
networks of the largest and of the middle corpus.

Needs numpy, pyarrow, pyyaml, lightgbm, scikit-learn and scipy. Writes real_scans.json and real_scans.md into scripts/results.
"""

import argparse
import pathlib
import shutil

import numpy as np
import pyarrow.parquet as parquet
import yaml
from sklearn.metrics import roc_auc_score

import held_out
import study
from compare_measures import best_threshold
from doubt import Network, calibration_error, doubtful_row, log_loss
from fresh_families import labels_for, wheel_of
from transfer import outputs

HERE = study.ROOT / "scripts"
LABELS = study.ROOT / "configs" / "labels"
HEIGHT = "height_difference_m"
ALLOWED = 0.01
#: Labels of fewer judged points are not told.
FEWEST_POINTS = 2000
#: Types of a PLY's properties.
PLY = {"double": "<f8", "float": "<f4", "int": "<i4", "char": "i1", "uchar": "u1"}
ROVERS = ["pioneer-3at", "husky-a200"]
#: What the stated height of a sensor may be off by.
WRONG_BY_M = [-0.1, 0.1]
DRAWS = 10_000
#: Where each measure of a learner at a place stands.
MISSED, FALSE, BALANCED, AREA = range(4)


class Places:
    """Where the scans are from, and what `classify` makes of them for a network's columns."""

    def __init__(self, marsyard, data, quick):
        self.marsyard, self.data, self.quick = marsyard, data, quick
        self.list = yaml.safe_load((HERE / "real_scans.yaml").read_text())["places"]
        self.names = [place["name"] for place in self.list]
        self.kinds = [place["kind"] for place in self.list]
        # Where a place was recorded twice, its spot is the first recording.
        self.spots = [self.names.index(place.get("spot", place["name"])) for place in self.list]
        self.scans = [self.scans_of(place) for place in self.list]

    def scans_of(self, place):
        labelled = lambda scan: scan.with_suffix(".label").exists() or (scan.parents[1] / "labels" / f"{scan.stem}.label").exists()
        scans = [scan for scan in sorted(self.data.glob(place["scans"])) if labelled(scan)]
        assert scans, f"{self.data} has no labelled scan {place['scans']}: scripts/real_scans.yaml says where they come from"
        return scans[:2] if self.quick else scans

    def classified(self, name, place):
        scans = self.scans[self.names.index(place["name"])]
        return self.marsyard.work / "classified" / f"{name}-{place['name']}-{len(scans)}".replace(" ", "-")

    def cells(self, name, run, higher_m=0.0):
        """The labelled cells as a network of `run` meets them, with the place of each; the sensor is said to stand so much higher than stated."""
        found = []
        name = f"{name}-{higher_m:+g}" if higher_m else name
        for number, (place, scans) in enumerate(zip(self.list, self.scans)):
            out = self.classified(name, place)
            if not (out / "cells.parquet").exists():
                study.note(f"classify {place['name']} for {name}")
                shutil.rmtree(out, ignore_errors=True)
                self.marsyard.run("classify", run, *scans, "--sensor-height", round(place["sensor_height_m"] + higher_m, 3),
                                  "--labels", LABELS / f"{place['labels']}.yaml", "--out", out, "--no-pictures")
            table = parquet.read_table(out / "cells.parquet")
            table = table.filter(table["label"].is_valid())
            found.append({column: table[column].to_numpy() for column in table.column_names} | {"place": np.full(len(table), number)})
        return {column: np.concatenate([of[column] for of in found]) for column in found[0]}

    def by_label(self, name):
        """What of each label's points lies in cells that were called untraversable, where a cell was judged: rows of a table."""
        rows = []
        for kind in dict.fromkeys(self.kinds):
            places = [place for place in self.list if place["kind"] == kind]
            labels, called = zip(*(of for place in places for of in map(read_labelled, sorted(self.classified(name, place).glob("*-labelled.ply")))))
            labels, called = np.concatenate(labels), np.concatenate(called)
            told = names_of_labels(LABELS / f"{places[0]['labels']}.yaml")
            counts = sorted(((int((labels == number).sum()), number) for number in np.unique(labels)), reverse=True)
            rows += [[kind, told[number][0], told[number][1], f"{count:,}", f"{100 * called[labels == number].mean():.1f}"]
                     for count, number in counts if count >= FEWEST_POINTS and told[number][1] != "ignore"]
        return rows


def read_labelled(path):
    """Of the points in judged cells: the label that people gave, and whether the cell was called untraversable."""
    content = path.read_bytes()
    start = content.index(b"end_header\n") + len(b"end_header\n")
    head = [line.split() for line in content[:start].decode().splitlines()]
    [count] = [int(words[2]) for words in head if words[:2] == ["element", "vertex"]]
    points = np.frombuffer(content, [(words[2], PLY[words[1]]) for words in head if words[0] == "property"], count, start)
    judged = points["class"] >= 0
    return points["label"][judged] & 0xFFFF, points["class"][judged] == 1


def names_of_labels(path):
    """Number of a label -> its name, which stands behind it as a comment, and what it means."""
    lines = [line.partition("#") for line in path.read_text().splitlines() if line.startswith("  ")]
    return {int(key): (name.strip(), meaning.strip()) for (key, _, meaning), name in ((rule.partition(":"), name) for rule, _, name in lines)}


class Learner:
    """Scores of its trainings on its cells."""

    def __init__(self, places, cells, scores, number, judged=None):
        """Means are over the places `judged`, all of them by default."""
        self.cells, self.scores = cells, scores
        self.judged = list(range(len(places.names))) if judged is None else judged
        by_place = {"label": cells["label"], "scene": cells["place"], "family_of_scene": places.names}
        rates = held_out.rates(np.array([held_out.counts(by_place, of) for of in scores], dtype=float))
        areas = np.full((len(scores), len(places.names), 1), np.nan)
        for place in self.judged:
            at = cells["place"] == place
            areas[:, place, 0] = [roc_auc_score(cells["label"][at], of[at]) for of in scores]
        self.measures = np.concatenate([rates, areas], axis=2)
        # Spots are drawn alike for all learners, with all that was recorded there, and each learner's trainings apart: the same seed says nothing of
        # another corpus.
        spots, spot_of = np.unique([places.spots[place] for place in self.judged], return_inverse=True)
        drawn = np.random.default_rng(1).multinomial(len(spots), np.full(len(spots), 1 / len(spots)), size=DRAWS)[:, spot_of]
        by_training = np.einsum("dp,tpr->dtr", drawn / drawn.sum(axis=1, keepdims=True), self.measures[:, self.judged])
        self.draws = held_out.drawn_trainings(by_training, [1, number])

    def mean(self, measure=BALANCED):
        """The mean over places of a measure, and its draws."""
        return self.measures[:, self.judged, measure].mean(), self.draws[:, measure]

    def of_kind(self, kinds_of_places, kind, measure=BALANCED):
        return self.measures[:, [of == kind for of in kinds_of_places], measure].mean()


def default_of(scenes):
    """The learner by default of so many scenes; real_labels.py takes its runs."""
    return f"mixed.yaml, {scenes} scenes"


def run_name(learner):
    """What its run folders are named by."""
    return "".join(letter if letter.isalnum() or letter in "-." else "-" for letter in learner)


class Studied:
    """All learners, by name; the first is the default network of the largest corpus."""

    def __init__(self, marsyard, places, sizes, seeds):
        self.marsyard, self.places, self.seeds, self.learners, self.cells = marsyard, places, seeds, {}, None
        self.log_losses = {}
        corpora = {size: marsyard.corpus(f"mixed-{size}", held_out.CONFIG, [], size, held_out.PER_SHARD) for size in sizes}
        small, middle, large = sizes
        self.networks = self.network(default_of(large), corpora[large])
        for higher_m in WRONG_BY_M:
            cells = places.cells(self.classifier, marsyard.work / "runs" / self.classifier, higher_m)
            self.learn(f"the same, sensors said {abs(higher_m)} m {'higher' if higher_m > 0 else 'lower'}",
                       [outputs(network.exported, cells) for network in self.networks], cells)
        for wheel_m in map(wheel_of, ROVERS):
            self.network(f"the same, for a wheel of {wheel_m} m", corpora[large], [labels_for(wheel_m)])
        self.network("the same, squared error", corpora[large], study.SQUARED)
        self.network("the same, one of two rectified", corpora[large], ["network.activation=both"])
        self.of_middle = default_of(middle)
        self.network(self.of_middle, corpora[middle])
        self.network(f"{self.of_middle}, squared error", corpora[middle], study.SQUARED)
        self.network(default_of(small), corpora[small])
        self.network(f"Kalman filter, mixed.yaml, {middle} scenes", corpora[middle], study.KALMAN_FILTER)
        self.network(f"broad.yaml, {middle} scenes", marsyard.corpus(f"broad-{middle}", HERE / "broad.yaml", [], middle, held_out.PER_SHARD))
        columns = self.networks[0].about["features"]
        self.learn(f"trees, mixed.yaml, {middle} scenes", [self.trees(corpora[middle], list(columns), seed)(self.cells) for seed in seeds])
        validation = held_out.read(corpora[large], [HEIGHT], ["validation"])
        self.least_m, _ = best_threshold(validation["label"], validation[HEIGHT].astype(float))
        self.learn("one height threshold", [0.5 + self.cells[HEIGHT].astype(float) - self.least_m])

    def learn(self, learner, scores, cells=None):
        self.learners[learner] = Learner(self.places, self.cells if cells is None else cells, scores, len(self.learners))

    def network(self, learner, corpus, sets=()):
        """Trains the networks of a learner, and scores the cells; the first network's `classify` makes these, all take the same columns."""
        runs = [self.marsyard.train(run_name(learner), [corpus], seed, sets) for seed in self.seeds]
        networks = [Network(self.marsyard, run) for run in runs]
        if self.cells is None:
            self.classifier = runs[0].name
            self.cells = self.places.cells(self.classifier, runs[0])
        # Log losses are of the cells of the stated heights alone.
        scores = [outputs(network.exported, self.cells) for network in networks]
        self.learn(learner, scores)
        at, untraversable = self.cells["place"], self.cells["label"] == 1
        of_places = lambda p: np.mean([log_loss(p[at == place], untraversable[at == place]) for place in range(len(self.places.names))])
        self.log_losses[learner] = float(np.mean([of_places(network.probabilities(of)) for network, of in zip(networks, scores)]))
        return networks

    def trees(self, corpus, columns, seed):
        study.note(f"trees of {corpus.name}, seed {seed}")
        read = lambda split: held_out.read(corpus, columns, [split], most=held_out.MOST_CELLS)
        return held_out.trees(read("train"), read("validation"), columns, seed)


def by_place(studied, default):
    """The network's rates, probabilities and doubt at each place: rows of the table, and facts."""
    rows, facts, cells = [], {}, default.cells
    for number, (name, scans) in enumerate(zip(studied.places.names, studied.places.scans)):
        at = cells["place"] == number
        untraversable, of = cells["label"][at] == 1, [scores[at] for scores in default.scores]
        probabilities = [network.probabilities(one) for network, one in zip(studied.networks, of)]
        error, loss = (float(np.mean([measure(p, untraversable) for p in probabilities])) for measure in (calibration_error, log_loss))
        left = doubtful_row(studied.networks, [{"test": [one]} for one in of], {"label": cells["label"][at]}, ALLOWED)
        missed, false, balanced = (float(rate) for rate in default.measures[:, number, :AREA].mean(axis=0))
        aside, _, missed_left, false_left = left
        rows.append([name, len(scans), f"{at.sum():,}", f"{100 * untraversable.mean():.1f}", *(f"{100 * rate:.1f}" for rate in (balanced, missed, false)),
                     f"{100 * error:.2f}", f"{loss:.3f}", aside, missed_left, false_left])
        facts[name] = {"scans": len(scans), "cells": int(at.sum()), "untraversable_share": float(untraversable.mean()), "balanced_accuracy": balanced,
                       "missed_untraversable": missed, "false_untraversable": false, "calibration_error": error, "log_loss_nats": loss,
                       "doubtful_percent": float(aside), "doubtful_missed_percent": float(missed_left), "doubtful_false_percent": float(false_left)}
    return rows, facts


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", required=True, type=pathlib.Path, help="folder of the scans: scripts/real_scans.yaml says what lies there")
    parser.add_argument("--sizes", default="140,400,2000", help="scenes of three corpora of mixed.yaml (default 140,400,2000)")
    parser.add_argument("--seeds", default="1,2,3")
    study.add_arguments(parser, "real_scans")
    options = parser.parse_args()
    sizes, seeds = [int(n) for n in options.sizes.split(",")], [int(n) for n in options.seeds.split(",")]
    if options.quick:
        sizes, seeds = [70, 140, 210], seeds[:1]
    marsyard = study.Marsyard(options.marsyard, options.work, options.threads)
    places = Places(marsyard, options.data, options.quick)
    studied = Studied(marsyard, places, sizes, seeds)
    learners, default = studied.learners, next(iter(studied.learners.values()))
    rows, facts = by_place(studied, default)
    named = places.by_label(studied.classifier)
    groups = list(dict.fromkeys(places.kinds))
    middle = learners[studied.of_middle]
    less = lambda of, other: "" if of is other else held_out.told_difference(of.mean(), other.mean())
    compared = [[name, len(of.scores), held_out.told(of.mean()), less(of, default), less(of, middle), *(f"{100 * of.mean(rate)[0]:.1f}" for rate in (MISSED, FALSE)),
                 *(f"{100 * of.of_kind(places.kinds, kind):.1f}" for kind in groups)] for name, of in learners.items()]
    head = ["", "scans", "cells", "untraversable", "balanced accuracy", "missed", "false", "calibration error", "log loss, nats", "doubtful at 1 %", "missed", "false"]
    areas = [[name, held_out.told(of.mean(AREA)), "" if of is default else held_out.told_difference(of.mean(AREA), default.mean(AREA)),
              f"{studied.log_losses[name]:.3f}" if name in studied.log_losses else "", *(f"{100 * of.of_kind(places.kinds, kind, AREA):.1f}" for kind in groups)]
             for name, of in learners.items()]
    text = f"""# Networks from simulated yards on real scans

`python scripts/real_scans.py --data FOLDER`, {study.versions(marsyard)['marsyard']}. {sum(map(len, places.scans))} scans of {len(places.list)} places; where they come from is said in scripts/real_scans.yaml, what is measured at the head of
the script. By cells at 0.5, percent, means of {len(seeds)} trainings. No setting may be chosen by these figures.

## The default network, {sizes[2]} scenes of mixed.yaml

Calibration error in points, of the model's probabilities. Last: what `--doubtful 1%` sets aside, and what is missed and falsely called all the same.

{study.markdown(head, rows)}

## What people call it

Of the points in cells that were judged, with their label and what it stands for: the share whose cell the network of the first training calls untraversable, percent.

{study.markdown(["", "label", "stands for", "points", "called untraversable"], named)}

## All learners

Means over places with intervals of 95 % over places (both recordings of a spot together) and trainings; differences in points. The height threshold is {studied.least_m:.3f} m.

{study.markdown(["", "trainings", "balanced accuracy", "less the first", f"less {sizes[1]} scenes", "missed", "false", *groups], compared)}

Of the same: the area under the ROC curve, percent, which knows no threshold, and the log loss of the model's probabilities, nats.

{study.markdown(["", "area", "less the first", "log loss", *groups], areas)}
"""
    results = {"versions": study.versions(marsyard, np), "sizes": sizes, "seeds": seeds, "by_place": facts, "by_label": named, "height_threshold_m": studied.least_m,
               "learners": {name: {"trainings": len(of.scores), "balanced_accuracy": float(of.mean()[0]), "missed_untraversable": float(of.mean(MISSED)[0]),
                                   "false_untraversable": float(of.mean(FALSE)[0]), "area": float(of.mean(AREA)[0]), "log_loss_nats": studied.log_losses.get(name),
                                   "areas": dict(zip(places.names, map(float, of.measures[:, :, AREA].mean(axis=0)))), "places": dict(zip(places.names, map(float, of.measures[:, :, BALANCED].mean(axis=0))))}
                            for name, of in learners.items()}}
    study.write_results(options.out, "real_scans", results, text)


if __name__ == "__main__":
    main()
