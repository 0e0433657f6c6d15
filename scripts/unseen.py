"""Judging networks on scenes of a config that no build has: a corpus of another seed, balanced accuracy with intervals.

Of mixed.yaml the held-out families alone judge, each as much as the others (held_out.py); of other configs all scenes. Intervals of 95 % draw
scenes (within their families) and trainings anew, the same draws whatever is judged, so that differences are paired.

Needs numpy and pyarrow.
"""

import resource

import numpy as np
import pyarrow
import pyarrow.parquet as parquet

import held_out
import study
from transfer import outputs

PER_SHARD, DRAWS = 50, 1000
#: Far from any that a build has.
TEST_SEED = 1_000_003


def cpu_s(marsyard, *arguments):
    """CPU seconds of a verb."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    marsyard.run(*arguments)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


class Yards:
    """Cells of unseen scenes, by scene; a family's scenes are drawn anew together."""

    def __init__(self, marsyard, name, sets, columns, scenes=400):
        if name == "mixed":
            place = held_out.corpus(marsyard, "test-mixed", TEST_SEED, 560, sets)
            self.cells = held_out.read(place, columns)
        else:
            config = study.ROOT / "configs" / f"{name}.yaml"
            place = marsyard.corpus(f"test-{name}", config, [f"seed={TEST_SEED}", *sets], scenes, PER_SHARD)
            paths = sorted((place / "data" / "cells").glob("*.parquet"))
            table = pyarrow.concat_tables([parquet.read_table(path, columns=["scene_id", "label", *columns]) for path in paths])
            table = table.filter(pyarrow.compute.is_valid(table["label"]))
            ids, scene = np.unique(table["scene_id"].to_numpy(), return_inverse=True)
            self.cells = {column: table[column].to_numpy() for column in ["label", *columns]}
            self.cells |= {"scene": scene, "family_of_scene": np.zeros(len(ids), dtype=int)}
        self.scenes = len(self.cells["family_of_scene"])

    def accuracy(self, models):
        """Balanced accuracy, the mean over families and trainings, and its draws; the same draws whatever is judged."""
        counts = np.array([held_out.counts(self.cells, outputs(model, self.cells)) for model in models], dtype=float)
        rng = np.random.default_rng(1)
        trainings = rng.integers(len(models), size=(DRAWS, len(models)))
        means, draws = [], []
        for family in np.unique(self.cells["family_of_scene"]):
            of = counts[:, self.cells["family_of_scene"] == family]
            weights = rng.multinomial(of.shape[1], np.full(of.shape[1], 1 / of.shape[1]), size=DRAWS)
            means.append(held_out.rates(of.sum(axis=1))[..., 2].mean())
            drawn = held_out.rates(np.einsum("ds,tsk->dtk", weights, of))[..., 2]
            draws.append(np.take_along_axis(drawn, trainings, axis=1).mean(axis=1))
        return np.mean(means), np.mean(draws, axis=0)
