"""The rows of compare_classifiers.py: which columns, in which forms, of which scenes. Every classifier is given the same arrays.

A form is a choice of how columns are written before they are standardised by the training rows and cut at 8 standard deviations, as the
network's own scaling does; or of whether their normal scores stand beside them, as the default network takes them by itself. Differences are taken here for all, so that nobody has a form that another is not given.
"""

import json
import pathlib

import numpy as np
import pyarrow.parquet as pq
from scipy.stats import norm

from train_rows import NEIGHBOURS, Cells

CLIP = 8.0
MEAN, VARIANCE, COUNT = "mean_height_m", "height_variance_m2", "point_count"
#: What each form does to the columns: in the order in which a tie is decided.
FORMS = {
    "as stored": (),
    "above the cell": ("neighbours",),
    "above the cell, log count": ("neighbours", "count"),
    "above the cell, standard deviation": ("neighbours", "spread"),
    "above the cell, both": ("neighbours", "count", "spread"),
    "above the cell, normal scores": ("neighbours", "scores"),
}
#: Parts of equal shares that the knots of normal scores bound, and the score of a neighbour without points, as the trainer's.
PARTS, UNSEEN = 64, -3.5


def forms(names):
    """The forms that differ for these columns: one without neighbours has none above the cell."""
    has = {"neighbours": MEAN in names and NEIGHBOURS[0] in names, "count": COUNT in names, "spread": VARIANCE in names, "scores": True}
    found = {}
    for name, parts in FORMS.items():
        kept = tuple(part for part in parts if has[part])
        if kept not in found.values():
            found[name if has["neighbours"] else name.replace("above the cell, ", "")] = kept
    return found


def written(values, names, parts):
    """The columns in a form."""
    values = values.copy()
    at = names.index
    if "neighbours" in parts:
        for neighbour in NEIGHBOURS:
            values[:, at(neighbour)] -= values[:, at(MEAN)]
    if "count" in parts:
        values[:, at(COUNT)] = np.log(np.maximum(values[:, at(COUNT)], 1))
    if "spread" in parts:
        values[:, at(VARIANCE)] = np.sqrt(np.maximum(values[:, at(VARIANCE)], 0))
    return values


def normal_scores(learn, above):
    """By rows to learn: what gives the normal score of each column, in place of its values, of mean 0 and variance 1; src/train/normal_scores.rs.

    `above`: the columns of neighbours' heights above the cell, where 0 is a neighbour without points."""
    shares, knots = np.linspace(0, 1, PARTS + 1), []
    for number, column in enumerate(learn.T):
        seen = column[column != 0] if number in above else column
        seen = seen if len(seen) else np.zeros(1)
        quantiles = np.quantile(seen, shares)
        at = np.unique(quantiles)
        middles = 0.5 * (shares[np.searchsorted(quantiles, at, "left")] + shares[np.searchsorted(quantiles, at, "right") - 1])
        found = norm.ppf(np.clip(middles, 0.5 / PARTS, 1 - 0.5 / PARTS))
        of_seen = np.interp(seen, at, found)
        knots.append((at, (found - of_seen.mean()) / (of_seen.std() or 1)))

    def scores(values):
        found = np.stack([np.interp(column, *of) for column, of in zip(values.T, knots)], axis=1).clip(-CLIP, CLIP)
        for number in above:
            found[values[:, number] == 0, number] = UNSEEN
        return found

    return scores


class Rows:
    """Arrays of one task: standardised inputs and labels to learn, to choose by and to judge; and the same in `stored` before neighbours are
    related to the cell and anything is standardised, for marsyard's trainer, which does both."""

    def __init__(self, learn, choose, judge, names, parts):
        unrelated = [part for part in parts if part != "neighbours"]
        self.stored = [written(values, names, unrelated).astype(np.float32) for values, _ in (learn, choose, judge)]
        self.neighbours = "above_cell" if "neighbours" in parts else "above_rover"
        inputs = written(learn[0], names, parts)
        mean, scale = inputs.mean(axis=0, dtype=float), inputs.std(axis=0, dtype=float)
        standardised = lambda values: np.clip((values - mean) / np.where(scale > 0, scale, 1), -CLIP, CLIP)
        above = [names.index(name) for name in NEIGHBOURS] if "neighbours" in parts else []
        scores = normal_scores(inputs, above) if "scores" in parts else lambda values: values[:, :0]
        scaled = lambda values: np.concatenate([standardised(values), scores(values)], axis=1).astype(np.float32)
        self.x, self.y = scaled(inputs), learn[1]
        self.choose_x, self.choose_y = scaled(written(choose[0], names, parts)), choose[1]
        self.judge_x = scaled(written(judge[0], names, parts))
        self.names = names
        counts = np.bincount(self.y, minlength=2)
        if not counts.all():
            raise SystemExit("the drawn training rows hold one class only: give more --rows, or a corpus with both classes")
        self.class_weights = len(self.y) / (2 * counts)

    @property
    def weights(self):
        """Of the training rows: both classes count alike."""
        return self.class_weights[self.y]

    @property
    def choose_weights(self):
        return self.class_weights[self.choose_y]


def families(place, split):
    """The family of each scene of a split."""
    tables = [pq.read_table(file, columns=["scene_id", "family"]) for file in sorted(pathlib.Path(place, "data", "scenes").glob(f"{split}-*.parquet"))]
    return {scene: of for table in tables for scene, of in zip(table["scene_id"].to_pylist(), table["family"].to_pylist())}


def judged(place, test_place, scenes):
    """Which rows of test scenes judge: where the test split has families that training never had, those of these alone."""
    family, learnt = families(test_place, "test"), set(families(place, "train").values())
    unseen = [scene for scene, of in family.items() if of not in learnt]
    return np.isin(scenes, unseen) if unseen else np.ones(len(scenes), bool)


class Corpus:
    """The splits of a corpus in memory; test rows may come from a corpus of another seed."""

    def __init__(self, name, place, test_place, names, sizes):
        self.name, self.names = name, list(names)
        self.train = Cells(place, "train", names, sizes.full_rows)
        self.validation = Cells(place, "validation", names, sizes.validation_rows)
        self.test = Cells(test_place, "test", names, sizes.test_rows)
        self.manifest = json.loads(pathlib.Path(test_place, "manifest.json").read_text())
        self.test.keep(judged(place, test_place, self.test.scenes))
        family = families(test_place, "test")
        self.scenes, self.scene = np.unique(self.test.scenes, return_inverse=True)
        self.families = [family[scene] for scene in self.scenes.tolist()]

    def rows(self, form, seed, at_least):
        """`at_least`: training rows in whole scenes, drawn by the seed; 0 = all."""
        drawn = self.train.whole_scenes(at_least, np.random.default_rng([1, seed]))
        pair = lambda cells, chosen=slice(None): (cells.values[chosen], cells.labels[chosen])
        return Rows(pair(self.train, drawn), pair(self.validation), pair(self.test), self.names, forms(self.names)[form])

    def about(self):
        count = lambda cells: {"rows": len(cells.labels), "scenes": len(np.unique(cells.scenes)), "untraversable": int(cells.labels.sum())}
        return {"columns": self.names, "forms": list(forms(self.names)), "train": count(self.train), "validation": count(self.validation),
                "test": count(self.test) | {"corpus_id": self.manifest["corpus_id"]}}  # fmt: skip
