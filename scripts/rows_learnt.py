"""What it costs, and what it brings, to learn every row, or those that the network errs on: error against CPU seconds by size of corpus.

Usage:  cargo build --release
        python scripts/rows_learnt.py [--seeds 1,2,3] [--test-seed 51] [--quick]

Trains by the exact filter (`filter.ekf.rows: every`), by error (`by_error`, configs/train/ekf.yaml), and by that with narrower priors
(`noise.p0_over_r`, 10 by default), on corpora of several sizes of configs/mixed.yaml, quickstart.yaml, paper.yaml and mars.yaml, one
thread each, all other settings at their defaults: patience ends each. Networks of mixed.yaml are judged on the
held-out families of another seed (mean of the families, see held_out.py), others on all scenes of another seed. Balanced accuracy by cells,
percent; the spread is the standard deviation over the trainings. CPU seconds of this machine, user and system, beside other work; ways take
turns, so that what else runs falls on all of them.

Needs numpy and pyarrow. Writes rows_learnt.json and rows_learnt.md into scripts/results.
"""

import argparse
import json

import numpy as np

import held_out
import study
from columns import test_counts
from learning_curve import timed
from transfer import outputs

BY_ERROR = "filter.ekf.rows={by_error: {}}"
WAYS = {
    "every row": ["filter.ekf.rows=every"],
    "by error": [BY_ERROR],
    "by error, P0/R 3": [BY_ERROR, "filter.ekf.noise.p0_over_r=3"],
    "by error, P0/R 1": [BY_ERROR, "filter.ekf.noise.p0_over_r=1"],
}
SIZES = {"mixed": [14, 28, 140, 400], "quickstart": [14, 200], "paper": [14, 200], "mars": [28]}
TEST_SCENES = {"mixed": 280, "quickstart": 100, "paper": 100, "mars": 40}


class Judge:
    """Balanced accuracy of a network on the test corpus of a config, which is read once where it is large."""

    def __init__(self, marsyard, config, seed, scenes):
        self.marsyard, self.config, self.cells = marsyard, config, None
        if config == "mixed":
            self.place = held_out.corpus(marsyard, "test", seed, scenes)
        else:
            self.place = marsyard.corpus(f"{config}-test", study.ROOT / "configs" / f"{config}.yaml", [f"seed={seed}"], scenes, held_out.PER_SHARD)

    def __call__(self, run):
        model = held_out.network(self.marsyard, run)
        if self.config != "mixed":
            return float(held_out.rates(test_counts(self.place, model, "*").sum(axis=0))[2])
        if self.cells is None:
            self.cells = held_out.read(self.place, model["about"]["features"])
        counts = held_out.counts(self.cells, outputs(model, self.cells))
        return float(held_out.Judgement(self.cells, [counts]).mean()[0])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", default="1,2,3")
    parser.add_argument("--test-seed", default=51, type=int)
    study.add_arguments(parser, "rows_learnt")
    parser.set_defaults(threads=1)
    options = parser.parse_args()
    seeds = [1] if options.quick else [int(seed) for seed in options.seeds.split(",")]
    sizes = {"mixed": [14], "paper": [14]} if options.quick else SIZES
    marsyard, rows, runs = study.Marsyard(options.marsyard, options.work, options.threads), [], []
    for config, of_config in sizes.items():
        scenes = 20 if options.quick and config != "mixed" else TEST_SCENES[config] // (4 if options.quick else 1)
        judge = Judge(marsyard, config, options.test_seed, scenes)
        for size in of_config:
            corpus = marsyard.corpus(f"{config}-{size}", study.ROOT / "configs" / f"{config}.yaml", [], size, max(1, min(10, size // 14)))
            found = {way: [] for way in WAYS}
            for seed in seeds:
                for number, (way, sets) in enumerate(WAYS.items()):
                    name = f"{config}-{size}-{number}"
                    run, seconds = timed(marsyard.work, f"train-{name}-{seed}", lambda: marsyard.train(name, [corpus], seed, [*study.KALMAN_FILTER, *sets]))
                    training = json.loads((run / "training.json").read_text())
                    found[way].append({"config": config, "scenes": size, "way": way, "seed": seed, "cpu_s": seconds, "rows": training["rows_learnt"],
                                       "updates": training["counters"]["updates"], "balanced_accuracy": judge(run)})
            for way, of in found.items():
                mean = lambda key: np.mean([one[key] for one in of])
                judged = study.percent_spread(study.mean_spread([one["balanced_accuracy"] for one in of]), 1)
                rows.append([f"{config}, {size} scenes", way, f"{mean('cpu_s'):.1f}", f"{mean('rows') / 1e3:.0f}", f"{mean('updates') / 1e3:.0f}", judged])
                runs += of
    text = "\n\n".join([
        "# Rows learnt: every one, or by error",
        f"`python scripts/rows_learnt.py`, {study.versions(marsyard)['marsyard']}; {len(seeds)} trainings each, one thread. What is compared, and what on, is "
        "said at the head of the script.",
        study.markdown(["corpus", "learnt", "CPU s to train", "rows seen, thousands", "rows learnt, thousands", "balanced accuracy"], rows)]) + "\n"
    study.write_results(options.out, "rows_learnt", {"versions": study.versions(marsyard), "test_seed": options.test_seed, "runs": runs}, text)


if __name__ == "__main__":
    main()
