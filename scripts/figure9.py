#!/usr/bin/env python3
"""The paper's Figure 9: its network, fine Gaussian SVM, fine KNN and complex tree on a balanced set of simulated cells.

    cargo build --release --example train_rows
    python scripts/figure9.py [--rows 20000] [--seeds 5]

The paper tells four accuracies and not how many of the cells were untraversable; 80.7 to 92.5 % are below what calling all cells of a yard
traversable gets, so its set was far more balanced than a yard is. Recipe: of the cells of configs/paper.yaml as many of one class as of the other
are drawn at random, 70 % to learn, 15 % to stop training, 15 % to judge; the paper's 14 inputs as they are stored; untraversable from one half on.
Scenes are parted first (what a rover meets: other yards), or cells alone (cells of the same scans are learnt and judged; the paper does not
say which). Accuracy on such a set is the balanced accuracy that `marsyard evaluate` tells of any. Writes figure9.json and figure9.md into
scripts/results.
"""

import argparse
import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "RAYON_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import numpy as np
import sklearn

import study
from compare_paper import complex_tree, fine_knn, fine_svm, network
from compare_rows import Rows
from train_rows import LISTED, NETWORK, Cells

#: Name: (classifier, its score from which on a cell is called untraversable, the paper's accuracy in percent).
FOUR = {
    NETWORK: (network, 0.5, 90.2),
    "fine Gaussian SVM": (fine_svm, 0.0, 89.0),
    "fine KNN": (fine_knn, 0.5, 92.5),
    "complex tree": (complex_tree, 0.5, 80.7),
}
SPLITS = ("by scene", "by cell")


def balanced(labels, rows, rng):
    """Indices of so many rows, half of each class, in a drawn order."""
    of = [np.flatnonzero(labels == label) for label in (0, 1)]
    if min(map(len, of)) < rows // 2:
        raise SystemExit(f"{min(map(len, of))} cells of a class, {rows // 2} are wanted: more --scenes or fewer --rows")
    return rng.permutation(np.concatenate([rng.choice(one, rows // 2, replace=False) for one in of]))


def drawn(cells, split, rows, seed):
    """(values, labels) to learn, to stop by and to judge."""
    rng = np.random.default_rng([9, seed])
    sizes = [rows * 70 // 100, rows * 15 // 100, rows * 15 // 100]
    if split == "by scene":
        parts = [(of, balanced(of.labels, size, rng)) for of, size in zip(cells, sizes)]
    else:
        whole = balanced(cells[0].labels, sum(sizes), rng)
        parts = [(cells[0], part) for part in np.split(whole, np.cumsum(sizes)[:-1])]
    return [(of.values[part], of.labels[part]) for of, part in parts]


def matrix(labels, called):
    """Counts: [truly traversable, truly untraversable] x [called so, so]."""
    return np.array([[np.sum((labels == truth) & (called == call)) for call in (0, 1)] for truth in (0, 1)])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rows", type=int, default=20_000)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--scenes", type=int, default=1000)
    study.add_arguments(parser, "figure9")
    options = parser.parse_args()
    if options.quick:
        options.rows, options.seeds, options.scenes = 1000, 1, 60
    marsyard = study.Marsyard(options.marsyard, options.work, options.threads)
    place = marsyard.corpus(f"paper-{options.scenes}", study.ROOT / "configs" / "paper.yaml", [], options.scenes, max(options.scenes // 20, 1))
    cells = [Cells(place, split, LISTED) for split in ("train", "validation", "test")]
    share = np.mean(np.concatenate([of.labels for of in cells]))
    runs, matrices = [], {}
    for split in SPLITS:
        for seed in range(1, options.seeds + 1):
            learn, choose, judge = drawn(cells, split, options.rows, seed)
            rows = Rows(learn, choose, (judge[0], None), LISTED, ())
            for name, (classifier, least, _) in FOUR.items():
                counts = matrix(judge[1], classifier(rows, seed, False).judge >= least)
                matrices[split, name] = matrices.get((split, name), 0) + counts
                runs.append({"split": split, "seed": seed, "classifier": name, "matrix": counts.tolist(), "accuracy": counts.trace() / counts.sum()})
                study.note(f"{split}, seed {seed}, {name}: {runs[-1]['accuracy']:.4f}")

    def spread(name, split):
        return study.percent_spread(study.mean_spread([run["accuracy"] for run in runs if (run["classifier"], run["split"]) == (name, split)]))

    accuracies = [[name, f"{paper:.1f}", *(spread(name, split) for split in SPLITS)] for name, (_, _, paper) in FOUR.items()]
    text = [
        "# Figure 9: four classifiers on a balanced set",
        f"`python scripts/figure9.py`, {study.versions(marsyard)['marsyard']}, scikit-learn {sklearn.__version__}: {options.rows:,} cells of configs/paper.yaml ({options.scenes} "
        f"scenes), as many untraversable as traversable where a yard has {100 * share:.1f} %, 14 inputs; mean ± standard deviation over {options.seeds} draws.",
        study.markdown(["accuracy %", "the paper", *(f"split {split}" for split in SPLITS)], accuracies),
    ]
    for split in SPLITS:
        lines = []
        for name in FOUR:
            for truth, counts in zip(("traversable", "untraversable"), matrices[split, name]):
                lines.append([f"{name}: truly {truth}", *(f"{count:,} ({100 * count / counts.sum():.1f} %)" for count in counts)])
        text.append(study.markdown([f"split {split}, cells of all draws", "called traversable", "called untraversable"], lines))
    about = {"versions": study.versions(marsyard, np, sklearn), "untraversable_share": float(share)}
    study.write_results(options.out, "figure9", {"about": about, "runs": runs}, "\n\n".join(text) + "\n")


if __name__ == "__main__":
    main()
