#!/usr/bin/env python3
"""marsyard's network beside scikit-learn's equivalents of three of MATLAB's presets: figure 9 of Hewitt, Ellery & de Ruiter 2017.

    cargo run --release -- generate configs/paper.yaml
    cargo build --release --example train_rows
    pip install numpy scipy scikit-learn pyarrow matplotlib
    python scripts/compare_classifiers.py corpora/paper            # 24 minutes on 2 busy cores; --quick: about 2

Measured, for each of five seeds (other scenes, other initial weights), on the same 100,000 rows of whole scenes of the test split:

- the 16-16 network at marsyard's defaults, the fine Gaussian SVM, the fine KNN and the complex tree, all trained on the same 20,000 rows
  of whole scenes, with and without class weights; the network again on all training rows;
- the same with rows drawn at random from fewer scenes' cells (70/15/15, split by cell as the paper may have done), judged on the held-out
  cells of the same scenes and on the test split: the difference is what a split by cell inflates;
- the network with one feature alone, and without each group of features.

Baselines get inputs standardised by the mean and standard deviation of their training rows; the network scales by itself.

- fine Gaussian SVM: SVC, C = 1, exp(-gamma |x-y|^2) with gamma = 16 / features (MATLAB's KernelScale = sqrt(features) / 4).
- fine KNN: one neighbour, Euclidean. A vote of one cannot be weighted; "weights" there means that the more frequent class is thinned at
  random to as many rows as the other. Its AUC is that of its hard answers.
- complex tree: Gini, at most 100 splits (101 leaves), nodes of at least 10 rows are split. scikit-learn splits the best node first wherever
  it is; MATLAB grows level by level and takes back the least useful splits of the last level. The sizes are equal, the shapes may differ.
- not in the paper: medium Gaussian SVM (gamma = 1 / features), and gradient boosting as scikit-learn has it.

Weights are `balance: classes` for the network and class_weight="balanced" for the others. The network stops by 60,000 rows of the
validation split; in the row "stopped by few" by 15/70 as many as it learns from. Baselines have no use for validation rows, but for the
column "BA at own threshold": there the threshold of every classifier with a score is the one with the best balanced accuracy on the same
20,000 validation rows. Nothing is ever chosen on test rows. The CPU seconds of the network include its looks at the validation rows.
"""

import argparse
import json
import multiprocessing
import os
import pathlib
import platform
import tempfile
import time

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import numpy as np
import scipy
import sklearn
from scipy.stats import rankdata
from sklearn.ensemble import HistGradientBoostingClassifier
from sklearn.neighbors import KNeighborsClassifier
from sklearn.svm import SVC
from sklearn.tree import DecisionTreeClassifier

import compare_report
from train_rows import FULL, LISTED, NEIGHBOURS, ROOT, TRAINER, Cells, train

BASELINES = {
    "fine Gaussian SVM": lambda inputs, weight: SVC(gamma=16 / inputs, C=1.0, class_weight=weight, cache_size=1000),
    "fine KNN": lambda inputs, weight: KNeighborsClassifier(1),
    "complex tree": lambda inputs, weight: DecisionTreeClassifier(
        max_leaf_nodes=101, min_samples_split=10, class_weight=weight, random_state=0
    ),
}
BEYOND = {
    "medium Gaussian SVM": lambda inputs, weight: SVC(gamma=1 / inputs, C=1.0, class_weight=weight, cache_size=1000),
    "gradient boosting": lambda inputs, weight: HistGradientBoostingClassifier(class_weight=weight, random_state=0),
}
ABOVE_ROVER = "neighbours above the rover"
GROUPS = {
    "mean height": ["mean_height_m"],
    "variance": ["height_variance_m2"],
    "height difference": ["height_difference_m"],
    "point count": ["point_count"],
    "pitch and roll": ["pitch_rad", "roll_rad"],
    "neighbours": NEIGHBOURS,
}


def figures(labels, answers, scores):
    """Everything that is said of one classifier's answers. `scores` rise with untraversable."""
    wrong = answers != labels
    positive = labels == 1
    tp, fn = int((positive & ~wrong).sum()), int((positive & wrong).sum())
    fp, tn = int((~positive & wrong).sum()), int((~positive & ~wrong).sum())
    product = float(tp + fp) * (tp + fn) * (tn + fp) * (tn + fn)
    ranks = rankdata(scores)
    return {
        "tn": tn, "fp": fp, "fn": fn, "tp": tp,
        "accuracy": (tp + tn) / len(labels),
        "balanced_accuracy": (tp / (tp + fn) + tn / (tn + fp)) / 2,
        "mcc": (tp * tn - fp * fn) / product**0.5 if product else 0.0,
        "auc": float((ranks[positive].sum() - (tp + fn) * (tp + fn + 1) / 2) / ((tp + fn) * (tn + fp))),
        "missed_untraversable": fn / (tp + fn),
        "false_untraversable": fp / (tn + fp),
    }  # fmt: skip


def best_threshold(labels, scores):
    """The score from which rows are called untraversable, by the best balanced accuracy."""
    order = np.argsort(-scores, kind="stable")
    hits = np.cumsum(labels[order] == 1)
    false = np.arange(1, len(order) + 1) - hits
    gain = hits / hits[-1] - false / false[-1]
    gain[:-1][np.diff(scores[order]) == 0] = -1  # equal scores stay together
    return scores[order][np.argmax(gain)]


class Rows:
    """What the classifiers of one seed and one split see: (values, labels) by purpose."""

    def __init__(self, train, validation, few, threshold, judged, names=tuple(FULL)):
        self.train, self.validation, self.few, self.threshold, self.judged = train, validation, few, threshold, judged
        self.names = names

    def columns(self, names):
        at = [FULL.index(name) for name in names]
        cut = lambda rows: (rows[0][:, at], rows[1])
        judged = {name: cut(rows) for name, rows in self.judged.items()}
        return Rows(cut(self.train), cut(self.validation), cut(self.few), cut(self.threshold), judged, tuple(names))


def judge(rows, answer, scores, scores_on_threshold):
    """`answer`: scores -> answers. Scores come for the judged rows in their order."""
    results = {}
    threshold = None if scores_on_threshold is None else best_threshold(rows.threshold[1], scores_on_threshold)
    for (name, (_, labels)), score in zip(rows.judged.items(), scores):
        results[name] = figures(labels, answer(score), score)
        if threshold is not None:
            results[name]["balanced_accuracy_own_threshold"] = figures(labels, score >= threshold, score)["balanced_accuracy"]
    return results


def network(rows, weighted, seed, few=False, neighbours="above_cell"):
    validation = rows.few if few else rows.validation
    judged = [rows.threshold[0], *(values for values, _ in rows.judged.values())]
    settings = {"seed": seed, "balance": "classes" if weighted else "none", "neighbours": neighbours}
    (threshold, *scores), told = train(rows.train, validation, judged, settings, ARGUMENTS.trainer, rows.names)
    facts = {"seconds": told["cpu_s"], "rows_learnt": told["rows_learnt"], "best_after_rows": told["best"]["rows"]}
    return judge(rows, lambda score: score >= 0.5, scores, threshold), facts


def baseline(make, rows, weighted, seed):
    values, labels = rows.train
    mean, scale = values.mean(axis=0, dtype=float), values.std(axis=0, ddof=1, dtype=float)
    scaled = lambda values: (values - mean) / np.where(scale > 0, scale, 1)
    classifier = make(values.shape[1], "balanced" if weighted else None)
    one_neighbour = isinstance(classifier, KNeighborsClassifier)
    if one_neighbour and weighted:
        rng, by_class = np.random.default_rng([4, seed]), [np.flatnonzero(labels == c) for c in (0, 1)]
        keep = min(map(len, by_class))
        kept = np.concatenate([rng.choice(rows, keep, replace=False) for rows in by_class])
        values, labels = values[kept], labels[kept]
    begun = time.process_time()
    classifier.fit(scaled(values), labels)
    facts = {"seconds": time.process_time() - begun}
    if one_neighbour:
        scores = [classifier.predict(scaled(values)).astype(float) for values, _ in rows.judged.values()]
        return judge(rows, lambda score: score >= 0.5, scores, None), facts
    decides = isinstance(classifier, SVC)
    score = classifier.decision_function if decides else lambda values: classifier.predict_proba(values)[:, 1]
    scores = [score(scaled(values)) for values, _ in rows.judged.values()]
    border = 0.0 if decides else 0.5
    return judge(rows, lambda score: score > border, scores, score(scaled(rows.threshold[0]))), facts


def scenes(split, rows, *seed):
    """The rows of whole scenes, drawn by this seed."""
    chosen = CELLS[split].whole_scenes(rows, np.random.default_rng(seed))
    return CELLS[split].values[chosen], CELLS[split].labels[chosen]


def by_scene(seed, rows):
    """Other training scenes for each seed, the same rows to judge by."""
    train, few = scenes("train", rows, 1, seed), scenes("validation", rows * 15 // 70, 2, seed)
    validation, threshold = scenes("validation", ARGUMENTS.validation_rows, 0), scenes("validation", ARGUMENTS.threshold_rows, 0)
    return Rows(train, validation, few, threshold, {"test scenes": scenes("test", ARGUMENTS.test_rows, 0)})


def by_cell(seed, rows):
    values, labels = scenes("train", rows * 100 // 70, 1, seed)
    drawn = np.random.default_rng([3, seed]).permutation(len(labels))
    train, validation, held = ((values[i], labels[i]) for i in np.split(drawn, [rows, rows + rows * 15 // 70]))
    judged = {"held-out cells": held, "test scenes": scenes("test", ARGUMENTS.test_rows, 0)}
    return Rows(train, validation, validation, validation, judged)


def work(task):
    """One classifier on one choice of rows: (what, seed) -> records."""
    split, features, seed, weighted, name = task
    rows = by_cell(seed, ARGUMENTS.rows) if split == "cell" else by_scene(seed, 0 if "all rows" in name else ARGUMENTS.rows)
    rows = rows.columns({"listed": LISTED, "full": FULL}.get(features) or features)
    if name in BASELINES or name in BEYOND:
        results, facts = baseline((BASELINES | BEYOND)[name], rows, weighted, seed)
    else:
        neighbours = "above_rover" if name == ABOVE_ROVER else "above_cell"
        results, facts = network(rows, weighted, seed, "few" in name, neighbours)
    facts |= {"train_rows": len(rows.train[1]), "train_untraversable": int(rows.train[1].sum())}
    run = {"split": split, "features": features, "seed": seed, "weighted": weighted, "classifier": name}
    return [run | {"judged_on": judged_on} | found | facts for judged_on, found in results.items()]


def tasks(seeds, features):
    """In the order of their cost, the dearest first."""
    for weighted in (True, False):
        for seed in seeds:
            for inputs in features:
                if weighted or inputs == "listed":
                    yield "scene", inputs, seed, weighted, "network, all rows"
                for name in [*BASELINES, "network", *([*BEYOND, "network, stopped by few"] if inputs == "listed" else [])]:
                    yield "scene", inputs, seed, weighted, name
            for name in [*BASELINES, "network"]:
                yield "cell", "listed", seed, weighted, name
    for seed in seeds:
        yield "scene", "listed", seed, True, ABOVE_ROVER
        for name, group in (GROUPS | {"pitch": ["pitch_rad"], "roll": ["roll_rad"]}).items():
            yield "scene", tuple(group), seed, True, f"only {name}"
        for name, group in GROUPS.items():
            yield "scene", tuple(f for f in LISTED if f not in group), seed, True, f"without {name}"


def main():
    global ARGUMENTS, CELLS
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus", nargs="?", default=str(ROOT / "corpora" / "paper"))
    parser.add_argument("--rows", type=int, default=20_000, help="training rows, at least, in whole scenes")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--test-rows", type=int, default=100_000, help="judge on whole test scenes of so many rows; 0 = all")
    parser.add_argument("--validation-rows", type=int, default=60_000, help="the network stops by so many, in whole scenes; 0 = all")
    parser.add_argument("--threshold-rows", type=int, default=20_000, help="validation rows for the thresholds, in whole scenes")
    parser.add_argument("--trainer", default=str(TRAINER))
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--out", default=str(ROOT / "scripts" / "results" / "compare_classifiers.json"))
    parser.add_argument("--figure", help="also draw the balanced accuracies here (PNG or SVG)")
    parser.add_argument("--quick", action="store_true", help="two seeds, 30,000 test rows, 14 features; to the temporary folder")
    ARGUMENTS = parser.parse_args()
    features = ["listed", "full"]
    if ARGUMENTS.quick:
        ARGUMENTS.seeds, ARGUMENTS.test_rows, features = 2, 30_000, ["listed"]
        ARGUMENTS.validation_rows = 30_000
        ARGUMENTS.out = os.path.join(tempfile.gettempdir(), "compare_classifiers.json")
    CELLS = {split: Cells(ARGUMENTS.corpus, split) for split in ("train", "validation", "test")}
    begun, runs = time.time(), []
    todo = list(tasks(range(1, ARGUMENTS.seeds + 1), features))
    with multiprocessing.get_context("fork").Pool(ARGUMENTS.jobs) as pool:
        for done, records in enumerate(pool.imap_unordered(work, todo), 1):
            runs += records
            print(f"\r{done} of {len(todo)}, {time.time() - begun:.0f} s", end="", flush=True)
    print()
    runs.sort(key=lambda run: json.dumps([run[key] for key in ("split", "features", "weighted", "classifier", "judged_on", "seed")]))
    manifest = json.loads(pathlib.Path(ARGUMENTS.corpus, "manifest.json").read_text())
    about = {
        "corpus": manifest["name"], "corpus_id": manifest["corpus_id"], "scenes": manifest["scenes"], "seeds": ARGUMENTS.seeds,
        "rows": ARGUMENTS.rows, "test_rows": ARGUMENTS.test_rows or len(CELLS["test"].labels),
        "python": platform.python_version(), "numpy": np.__version__, "scipy": scipy.__version__, "scikit-learn": sklearn.__version__,
    }  # fmt: skip
    out = pathlib.Path(ARGUMENTS.out)
    out.parent.mkdir(parents=True, exist_ok=True)
    compare_report.write(out, about, runs)
    print(out.with_suffix(".md").read_text())
    if ARGUMENTS.figure:
        compare_report.figure(compare_report.summary(runs), ARGUMENTS.figure)


if __name__ == "__main__":
    main()
