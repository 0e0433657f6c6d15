"""What the logarithmic loss is worth beside the squared one, on families of yards that no network learnt from.

Usage:  cargo build --release
        python scripts/losses.py [--sizes 400,2000] [--seeds 1,2,3] [--quick]

Cuts configs/mixed.yaml to each size and trains on it with the losses and neurons of WAYS; at the first size there are trees
(LightGBM, held_out.py) too. All are judged on the held-out families of mixed.yaml (one corpus of them alone, of another seed), on six
families by which no setting was chosen (scripts/fresh_families.yaml), and on five that are farther off (scripts/first_families.yaml), by the
labels that these corpora have, and by 1500 cells a scene at most, drawn: cells beside one another err alike. Means over families of

  balanced accuracy   by cells at the output 0.5, percent
  area                under the ROC curve, by the output, percent
  log loss            of the model's calibrated probabilities, nats; of trees, which have none, not told
  false at 1 %        of the traversable cells, called untraversable at the highest threshold that misses at most 1 % of the family's untraversable
                      cells, over all its scenes

with differences to the squared error of the same size. Intervals of 95 % come from draws of the scenes of each family and of trainings; the same
draws of scenes for all. Three trainings make them somewhat too narrow, and thresholds at 1 % are not drawn anew. Outputs stand in bins of equal numbers of
cells for the area: pairs in the same bin count half. Trees learn three million cells at most.

The six families are those by which no setting may be chosen: what is decided by this study goes by the held-out families and the five.

Needs numpy, pyarrow, pyyaml, lightgbm, scipy and scikit-learn. Writes losses.json and losses.md into scripts/results.
"""

import argparse
import json

import numpy as np

import held_out
import study
from doubt import Network, log_losses
from fresh_families import SCENES, Yards
from real_scans import run_name
from transfer import outputs

BOTH = "network.activation=both"
WAYS = {
    "squared error": study.SQUARED,
    "squared, one of two rectified": [*study.SQUARED, BOTH],
    "logarithmic loss (default)": [],
    "logarithmic, one of two rectified": [BOTH],
}
BALANCED, AREA, LOSS, FALSE = range(4)
NAMES = ("balanced_accuracy", "area", "log_loss_nats", "false_at_1_percent_missed")
MISSED = 0.01
BINS = 4000
CELLS_A_SCENE = 1500
DRAWS = 1000
#: A class stands in so many scenes of a family at least, or draws would lack it.
FEWEST_SCENES = 8


class Ground:
    """Cells of some families, and what draws of their scenes make of scores."""

    def __init__(self, name, cells, families):
        self.name, self.cells, self.families = name, cells, families
        rng = np.random.default_rng(1)
        self.scenes_of = [np.flatnonzero(cells["family_of_scene"] == number) for number in families]
        for of, number in zip(self.scenes_of, families):
            with_class = [len(np.unique(cells["scene"][(cells["label"] == label) & np.isin(cells["scene"], of)])) for label in (0, 1)]
            assert min(with_class) >= FEWEST_SCENES, f"{name}: family {number} has its classes in {with_class} scenes"
        # The first draw is of all scenes once.
        self.weights = [np.concatenate([np.ones((1, len(of))), rng.multinomial(len(of), np.full(len(of), 1 / len(of)), size=DRAWS)]) for of in self.scenes_of]

    def judged(self, scores, probabilities=None):
        """Measures of one training by draw, means over families: [1 + DRAWS, 4]."""
        scenes, scene, label = len(self.cells["family_of_scene"]), self.cells["scene"], self.cells["label"] == 1
        edges = np.unique(np.quantile(scores, np.linspace(0, 1, BINS + 1)[1:-1]))
        place = np.searchsorted(edges, scores, side="right")
        counts = held_out.counts(self.cells, scores).astype(float)
        losses = np.zeros(len(scores)) if probabilities is None else log_losses(probabilities, label)
        lost = np.stack([np.bincount(scene, losses, scenes), np.bincount(scene, minlength=scenes)], axis=1)
        shape = (scenes, len(edges) + 1)
        of_class = [np.bincount((scene * shape[1] + place)[at], minlength=shape[0] * shape[1]).reshape(shape).astype(np.float32) for at in (~label, label)]
        found = []
        for weights, of in zip(self.weights, self.scenes_of):
            no, yes = (weights @ table[of] for table in of_class)
            below = no.cumsum(axis=1) - no / 2
            area = (yes * below).sum(axis=1) / (no.sum(axis=1) * yes.sum(axis=1))
            missed = yes.cumsum(axis=1) / yes.sum(axis=1, keepdims=True)
            # The lower edge of this bin is the highest below which no more is missed.
            threshold = (missed[0] <= MISSED).sum()
            false = no[:, threshold:].sum(axis=1) / no.sum(axis=1)
            sums = weights @ lost[of]
            found.append(np.stack([held_out.rates(weights @ counts[of])[:, 2], area, sums[:, 0] / sums[:, 1], false], axis=1))
        return np.mean(found, axis=0)


class Learner:
    """Measures of its trainings: by draw, [1 + DRAWS, 4]; the first row is what is told."""

    def __init__(self, of_trainings, number):
        by_training = np.stack(of_trainings, axis=1)
        self.measures = np.concatenate([by_training[:1].mean(axis=1), held_out.drawn_trainings(by_training[1:], [1, number])])

    def told(self, measure, scale=100, digits=1):
        return f"{scale * self.measures[0, measure]:.{digits}f}"

    def facts(self):
        low, high = np.percentile(self.measures[1:], [2.5, 97.5], axis=0)
        return {name: [float(of) for of in (self.measures[0, k], low[k], high[k])] for k, name in enumerate(NAMES)}

    def less(self, other, measure, scale=100, digits=2):
        off = scale * (self.measures[:, measure] - other.measures[:, measure])
        low, high = np.percentile(off[1:], [2.5, 97.5])
        return f"{off[0]:+.{digits}f} [{low:+.{digits}f}, {high:+.{digits}f}]"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", default="400,2000")
    parser.add_argument("--seeds", default="1,2,3")
    study.add_arguments(parser, "losses")
    options = parser.parse_args()
    sizes, seeds = [int(n) for n in options.sizes.split(",")], [int(n) for n in options.seeds.split(",")]
    if options.quick:
        sizes, seeds = [70, 140], seeds[:1]
    marsyard = study.Marsyard(options.marsyard, options.work, options.threads)
    corpora = {size: marsyard.corpus(f"mixed-{size}", held_out.CONFIG, [], size, held_out.PER_SHARD) for size in sizes}
    networks, rows_learnt = {}, {}
    for size in sizes:
        for way, sets in WAYS.items():
            runs = [marsyard.train(run_name(f"losses {size} {way}"), [corpora[size]], seed, sets) for seed in seeds]
            networks[size, way] = [Network(marsyard, run) for run in runs]
            rows_learnt[size, way] = float(np.mean([json.loads((run / "training.json").read_text())["rows_learnt"] for run in runs]))
    columns = networks[sizes[0], next(iter(WAYS))][0].about["features"]
    read = lambda corpus, split: held_out.read(corpus, columns, [split], most=held_out.MOST_CELLS)
    first = corpora[sizes[0]]
    study.note("trees")
    trees = [held_out.trees(read(first, "train"), read(first, "validation"), columns, seed) for seed in seeds]
    tables, facts = [], {}
    for ground in grounds(marsyard, columns, options.quick):
        rows, cells = [], ground.cells
        for size in sizes:
            squared = None
            for number, way in enumerate(WAYS):
                of = [(network, outputs(network.exported, cells)) for network in networks[size, way]]
                learner = Learner([ground.judged(scores, network.probabilities(scores)) for network, scores in of], number)
                squared = squared or learner
                rows.append([size, way, f"{rows_learnt[size, way] / 1e6:.2f}", *row(learner, None if learner is squared else squared)])
                facts[f"{ground.name}, {size} scenes, {way}"] = learner.facts()
                study.note(f"{ground.name}: {size} scenes, {way}")
            if corpora[size] is first:
                learner = Learner([ground.judged(of(cells)) for of in trees], len(WAYS))
                rows.append([size, "trees", "", *row(learner, squared, has_loss=False)])
                facts[f"{ground.name}, {size} scenes, trees"] = {name: of for name, of in learner.facts().items() if name != NAMES[LOSS]}
        tables.append(f"## {ground.name}\n\n{len(cells['family_of_scene'])} scenes, {len(cells['label']):,} cells.\n\n{study.markdown(HEAD, rows)}\n")
    text = f"""# The logarithmic loss beside the squared one

`python scripts/losses.py`, {study.versions(marsyard)['marsyard']}; {len(seeds)} trainings each. Means over families; differences to the squared error of the same size, with
95 % intervals over scenes and trainings. What is measured is said at the head of the script.

""" + "\n".join(tables)
    study.write_results(options.out, "losses", {"versions": study.versions(marsyard, np), "sizes": sizes, "seeds": seeds, "rows_learnt": {f"{size} scenes, {way}": rows for (size, way), rows in rows_learnt.items()},
                                                "measures": facts}, text)


HEAD = ["scenes", "learnt by", "million rows learnt", "balanced accuracy", "difference, points", "area", "difference, points", "log loss", "difference, thousandths", "false at 1 % missed",
        "difference, points"]


def row(learner, squared, has_loss=True):
    differs = lambda *measure: "-" if squared is None else learner.less(squared, *measure)
    loss = [learner.told(LOSS, 1, 4), differs(LOSS, 1000, 1)] if has_loss else ["", ""]
    return [learner.told(BALANCED), differs(BALANCED), learner.told(AREA, 100, 2), differs(AREA, 100, 3), *loss, learner.told(FALSE), differs(FALSE)]


def sampled(cells):
    """At most so many cells of each scene."""
    rng = np.random.default_rng(2)
    order = np.lexsort((rng.random(len(cells["scene"])), cells["scene"]))
    sorted_scene = cells["scene"][order]
    place = np.arange(len(order)) - np.searchsorted(sorted_scene, sorted_scene)
    kept = np.sort(order[place < CELLS_A_SCENE])
    return {name: of[kept] if len(of) == len(order) else of for name, of in cells.items()}


def grounds(marsyard, columns, quick):
    scenes = 160 if quick else 560
    place = held_out.corpus(marsyard, f"held-out-{scenes}", 51, scenes)
    cells = sampled(held_out.read(place, columns))
    yield Ground("Held-out families of mixed.yaml", cells, [(held_out.TRAINING + held_out.FAMILIES).index(family) for family in held_out.FAMILIES])
    for name, what in (("fresh", "Six families by which no setting was chosen"), ("first", "Five families that are farther off")):
        yards = Yards(marsyard, name, 160 if quick else SCENES[name])
        yards.read(columns)
        yield Ground(what, sampled(yards.cells), range(len(yards.families)))


if __name__ == "__main__":
    main()
