"""Judging networks on scenes of a config that no build has: a corpus of another seed, balanced accuracy with intervals.

Of mixed.yaml the held-out families alone judge, each as much as the others; of configs without families all scenes. Rates and intervals are
those of held_out.py.

Needs numpy and pyarrow.
"""

import held_out
import study
from transfer import outputs

PER_SHARD = 50
#: Far from any that a build has.
TEST_SEED = 1_000_003


class Yards:
    """Cells of unseen scenes, by scene."""

    def __init__(self, marsyard, name, sets, columns, scenes):
        if name == "mixed":
            self.families, self.numbered = held_out.FAMILIES, held_out.TRAINING + held_out.FAMILIES
            place = held_out.corpus(marsyard, "test-mixed", TEST_SEED, 560, sets)
        else:
            self.families = self.numbered = ["default"]
            config = study.ROOT / "configs" / f"{name}.yaml"
            place = marsyard.corpus(f"test-{name}", config, [f"seed={TEST_SEED}", *sets], scenes, PER_SHARD)
        self.cells = held_out.read(place, columns, families=self.numbered)
        self.scenes = len(self.cells["family_of_scene"])

    def accuracy(self, models):
        """Balanced accuracy, the mean over families and trainings, and its draws; the same draws whatever is judged."""
        counts = [held_out.counts(self.cells, outputs(model, self.cells)) for model in models]
        return held_out.Judgement(self.cells, counts, self.families, self.numbered).mean()
