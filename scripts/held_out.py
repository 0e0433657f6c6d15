"""Judging by the held-out families of configs/mixed.yaml: a test corpus of them alone, any learner's scores on it, rates with intervals.

A corpus of mixed.yaml has some fifteen test scenes of each held-out family, whose figures then depend on the draw of the scenes by a point.
The test corpus of the studies is of another seed and holds those families alone, so that each has some seventy. A learner is anything that
gives a cell a score; a cell is called untraversable from 0.5 on. Intervals are 95 % of a bootstrap that draws the scenes of each family
anew, and the seeds of the training with them; the same draws for all learners, so that differences are paired.

Needs numpy and pyarrow; `trees` needs lightgbm.
"""

import json

import numpy as np
import pyarrow
import pyarrow.parquet as parquet

import study

CONFIG = study.ROOT / "configs" / "mixed.yaml"
TRAINING = ["rock_field", "builders_yard", "orchard", "scrub", "bare_rough", "embankments", "excavations"]
FAMILIES = ["unseen_pattern", "unseen_density", "unseen_height", "unseen_frame", "unseen_slope", "unseen_kinds", "unseen_holes", "unseen"]
PER_SHARD = 10
DRAWS = 1000
#: Trees learn from no more cells than this, and no more validation cells decide when they stop; scenes in their order.
MOST_CELLS = 3_000_000
#: At this weight none of the scenes of a study is drawn from a family.
NONE = "1e-9"


def corpus(marsyard, name, seed, scenes, sets=()):
    """Scenes of the held-out families alone, in all three splits."""
    none = [f"families.{k}.weight={NONE}" for k in range(len(TRAINING))]
    free = [f"families.{len(TRAINING) + k}.hold_out=false" for k in range(len(FAMILIES))]
    return marsyard.corpus(name, CONFIG, [f"seed={seed}", *none, *free, *sets], scenes, PER_SHARD)


def corpus_of_training(marsyard, name, seed, scenes):
    """Scenes of the training families alone, for those that are left out of a training."""
    none = [f"families.{len(TRAINING) + k}.weight={NONE}" for k in range(len(FAMILIES))]
    return marsyard.corpus(name, CONFIG, [f"seed={seed}", *none], scenes, PER_SHARD)


def read(place, columns, splits=("train", "validation", "test"), families=TRAINING + FAMILIES, most=None):
    """Columns of the cells with a label, with `label`, and the scene and the family of each as numbers; no more cells than `most`, shards
    in their order."""
    paths = lambda kind: [path for split in splits for path in sorted((place / "data" / kind).glob(f"{split}-*.parquet"))]
    scenes = pyarrow.concat_tables([parquet.read_table(path, columns=["scene_id", "family"]) for path in paths("scenes")])
    family_of = dict(zip(scenes["scene_id"].to_pylist(), scenes["family"].to_pylist()))
    shards, cells_read = [], 0
    for path in paths("cells"):
        shard = parquet.read_table(path, columns=list(dict.fromkeys(["scene_id", "label", *columns])))
        shards.append(shard.filter(pyarrow.compute.is_valid(shard["label"])))
        cells_read += len(shards[-1])
        if most is not None and cells_read >= most:
            break
    cells = pyarrow.concat_tables(shards)[:most]
    ids, scene = np.unique(cells["scene_id"].to_numpy(), return_inverse=True)
    of_scene = np.array([families.index(family_of[scene_id]) for scene_id in ids])
    found = {name: cells[name].to_numpy() for name in ["label", *columns]}
    return {**found, "scene": scene, "family_of_scene": of_scene}


def network(marsyard, run):
    """A trained network as its export tells it: inputs, scaling, weights."""
    return json.loads(marsyard.run("export", "--json", "-", run))


#: Of LightGBM, by the names of its scikit-learn class: small trees of many cells each.
TREES = dict(num_leaves=31, learning_rate=0.1, min_child_samples=100, subsample=0.7, subsample_freq=1, colsample_bytree=0.7, reg_lambda=5.0)
TREE_ROUNDS = 400


def table(cells, columns):
    """Columns of cells side by side, as trees take them."""
    return np.stack([cells[name] for name in columns], axis=1).astype(np.float32)


def trees(cells, validation, columns, seed):
    """LightGBM with weights by class, ended by the validation cells; what gives scores to cells."""
    import lightgbm

    def weighed(of):
        untraversable = of["label"] == 1
        weight = np.where(untraversable, (~untraversable).sum() / max(untraversable.sum(), 1), 1.0)
        return dict(data=table(of, columns), label=of["label"], weight=weight)

    settings = dict(objective="binary", **TREES, num_threads=1, seed=seed, verbose=-1)
    learnt = lightgbm.Dataset(**weighed(cells), params=settings)
    model = lightgbm.train(settings, learnt, TREE_ROUNDS, valid_sets=[lightgbm.Dataset(**weighed(validation), reference=learnt)],
                           callbacks=[lightgbm.early_stopping(30, verbose=False)])
    return lambda of: model.predict(table(of, columns), num_threads=1)


def counts(cells, scores):
    """By scene: untraversable cells missed and called, traversable cells called and passed."""
    called, untraversable = scores >= 0.5, cells["label"] == 1
    kinds = [untraversable & ~called, untraversable & called, ~untraversable & called, ~untraversable & ~called]
    scenes = len(cells["family_of_scene"])
    return np.stack([np.bincount(cells["scene"][kind], minlength=scenes) for kind in kinds], axis=1)


def rates(of):
    """Counts in the last axis -> missed, false and balanced accuracy there."""
    missed = of[..., 0] / np.maximum(of[..., 0] + of[..., 1], 1)
    false = of[..., 2] / np.maximum(of[..., 2] + of[..., 3], 1)
    return np.stack([missed, false, 1 - (missed + false) / 2], axis=-1)


def drawn_trainings(by_training, seed):
    """[draws, trainings, ...] -> for each draw the mean over trainings that are drawn anew."""
    drawn = np.random.default_rng(seed).integers(by_training.shape[1], size=by_training.shape[:2])
    return np.take_along_axis(by_training, drawn.reshape(*drawn.shape, *[1] * (by_training.ndim - 2)), axis=1).mean(axis=1)


class Judgement:
    """Counts of some trainings of one learner, [trainings, scenes, 4] -> rates by family, means over trainings, and their draws."""

    def __init__(self, cells, of_trainings, families=FAMILIES, numbered=TRAINING + FAMILIES):
        of_trainings, self.families = np.asarray(of_trainings, dtype=float), families
        trainings = len(of_trainings)
        rng = np.random.default_rng(1)
        self.by_family, self.draws = {}, {}
        for family in families:
            of = of_trainings[:, cells["family_of_scene"] == numbered.index(family)]
            weights = rng.multinomial(of.shape[1], np.full(of.shape[1], 1 / of.shape[1]), size=DRAWS)
            self.by_family[family] = rates(of.sum(axis=1)).mean(axis=0)
            by_training = rates(np.einsum("ds,tsk->dtk", weights, of))
            # By a seed of their own, so that learners of other numbers of trainings have the draws of scenes in common.
            self.draws[family] = drawn_trainings(by_training, [1, trainings])

    def balanced(self, family):
        return self.by_family[family][2], self.draws[family][:, 2]

    def mean(self):
        each = [self.balanced(family) for family in self.families]
        return np.mean([value for value, _ in each]), np.mean([draws for _, draws in each], axis=0)

    def worst(self):
        """The family that is worst on the scenes that there are, and its draws: the least of each draw would be too low."""
        return self.balanced(min(self.families, key=lambda family: self.balanced(family)[0]))

    def facts(self):
        names = ("missed_untraversable", "false_untraversable", "balanced_accuracy")
        return {family: dict(zip(names, map(float, self.by_family[family]))) for family in self.families}


def interval(value_and_draws):
    """A value and the ends of its interval of 95 %, as results keep them."""
    value, draws = value_and_draws
    return [float(value), *map(float, np.percentile(draws, [2.5, 97.5]))]


def told_interval(ends):
    """Percent with its interval: `97.3 [96.9, 97.6]`."""
    return "{:.1f} [{:.1f}, {:.1f}]".format(*(100 * value for value in ends))


def told(value_and_draws):
    return told_interval(interval(value_and_draws))


def told_difference(one, other):
    """The difference in points of two values with draws in common: `-0.42 [-0.61, -0.20]`."""
    low, high = np.percentile(one[1] - other[1], [2.5, 97.5])
    return f"{100 * (one[0] - other[0]):+.2f} [{100 * low:+.2f}, {100 * high:+.2f}]"
