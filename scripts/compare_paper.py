"""The four classifiers of the paper's Figure 9, on equal rows: marsyard's network, and scikit-learn's equivalents of the presets of MATLAB that it names.

A classifier is a function of `Rows`, a seed and whether the rows are many; it gives a `Fitted`. The SVM gives scores that are no probabilities.

- fine Gaussian SVM: C = 1 and gamma = 16 / columns (KernelScale = sqrt(columns) / 4).
- fine KNN: one neighbour; the more frequent class is thinned to as many rows as the other, since a vote of one cannot be weighted.
- complex tree: Gini with at most 100 splits, nodes of at least 10 rows split, best node first.
"""

import dataclasses
import pickle
import time

import numpy as np
from sklearn.neighbors import KNeighborsClassifier
from sklearn.svm import SVC
from sklearn.tree import DecisionTreeClassifier

from train_rows import train


@dataclasses.dataclass
class Fitted:
    """Scores rise with untraversable. `cpu_s` is what training took, `judge_us` what judging a row takes, `rounds` what stopping left."""

    choose: np.ndarray
    judge: np.ndarray | None
    cpu_s: float
    judge_us: float | None
    parameters: int
    bytes: int | None
    rounds: int | None = None
    probabilities: bool = True


def fitted(rows, learn, score, size, probabilities=True, rounds=None):
    """Times learning and judging. `size`: model -> (parameters, bytes)."""
    begun = time.process_time()
    model = learn()
    cpu_s = time.process_time() - begun
    parameters, held = size(model)
    choose, judge, judge_us = score(model, rows.choose_x), None, None
    if len(rows.judge_x):
        begun = time.process_time()
        judge = score(model, rows.judge_x)
        judge_us = (time.process_time() - begun) * 1e6 / len(rows.judge_x)
    return Fitted(choose, judge, cpu_s, judge_us, parameters, held, rounds(model) if rounds else None, probabilities)


def probability(model, x):
    return model.predict_proba(x)[:, 1].astype(float)


def pickled(count):
    return lambda model: (int(count(model)), len(pickle.dumps(model)))


def splits_and_leaves(nodes, leaves):
    """A split is a column and a value, a leaf a value."""
    return 2 * (nodes - leaves) + leaves


def tree_parameters(tree):
    return splits_and_leaves(tree.node_count, tree.n_leaves)


def network(rows, seed, many):
    """marsyard's trainer by the Kalman filter of configs/train/ekf.yaml."""
    return taught([rows.x, rows.choose_x, rows.judge_x], rows, {"seed": seed})


def taught(inputs, rows, settings, names=None):
    """marsyard's trainer on rows to learn, to choose by and to judge."""
    learn, choose, judge = inputs
    settings = {"balance": "classes", **settings}
    (choose, judge), told = train((learn, rows.y), (choose, rows.choose_y), [choose, judge], settings, names=names)
    low, high = told["config"]["targets"]
    probabilities = lambda outputs: np.clip((outputs - low) / (high - low), 0, 1)
    judge_us = told["judge_us_a_row"] if len(judge) else None
    return Fitted(probabilities(choose), probabilities(judge), told["cpu_s"], judge_us, told["weights"], None, told["rows_learnt"])


def fine_svm(rows, seed, many):
    weights = dict(enumerate(rows.class_weights))
    learn = lambda: SVC(gamma=16 / rows.x.shape[1], C=1.0, class_weight=weights, cache_size=500).fit(rows.x, rows.y)
    size = pickled(lambda model: model.support_vectors_.size + model.dual_coef_.size + 1)
    return fitted(rows, learn, SVC.decision_function, size, probabilities=False)


def fine_knn(rows, seed, many):
    rng, by_class = np.random.default_rng([4, seed]), [np.flatnonzero(rows.y == c) for c in (0, 1)]
    kept = np.concatenate([rng.choice(of, min(map(len, by_class)), replace=False) for of in by_class])
    learn = lambda: KNeighborsClassifier(1).fit(rows.x[kept], rows.y[kept])
    return fitted(rows, learn, probability, pickled(lambda model: rows.x[kept].size + len(kept)))


def complex_tree(rows, seed, many):
    learn = lambda: DecisionTreeClassifier(max_leaf_nodes=101, min_samples_split=10, random_state=seed).fit(rows.x, rows.y, rows.weights)
    return fitted(rows, learn, probability, pickled(lambda model: tree_parameters(model.tree_)))
