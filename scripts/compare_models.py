"""The classifiers of compare_classifiers.py, each as somebody who knows it would set it. One thread each.

A classifier is a function of `Rows`, a seed and whether the rows are many; it gives a `Fitted`. Those with rounds or passes stop by the
weighted log loss of the validation rows, which all are given alike. SVM and threshold give scores that are no probabilities.

- fine Gaussian SVM, fine KNN, complex tree: scikit-learn's equivalents of the presets of MATLAB that the paper names. SVC with C = 1 and
  gamma = 16 / columns (KernelScale = sqrt(columns) / 4); one neighbour, where the more frequent class is thinned to as many rows as the
  other since a vote of one cannot be weighted; Gini with at most 100 splits, nodes of at least 10 rows split, best node first.
- one threshold: the column and direction of the largest area under ROC on the training rows.
"""

import dataclasses
import pickle
import time

import numpy as np
from catboost import CatBoostClassifier
from lightgbm import LGBMClassifier, early_stopping
from sklearn.ensemble import HistGradientBoostingClassifier, RandomForestClassifier
from sklearn.linear_model import LogisticRegression
from sklearn.neighbors import KNeighborsClassifier
from sklearn.svm import SVC
from sklearn.tree import DecisionTreeClassifier
from xgboost import XGBClassifier

import compare_torch
from compare_measures import area_under_roc
from train_rows import NETWORK, train


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
    """marsyard's trainer, all defaults."""
    own = {"seed": seed, "balance": "classes"}
    (choose, judge), told = train((rows.x, rows.y), (rows.choose_x, rows.choose_y), [rows.choose_x, rows.judge_x], own)
    probabilities = lambda outputs: np.clip((outputs - 0.1) / 0.8, 0, 1)
    judge_us = told["judge_us_a_row"] if len(judge) else None
    return Fitted(probabilities(choose), probabilities(judge), told["cpu_s"], judge_us, told["weights"], None, told["rows_learnt"])


def adam(rows, seed, many):
    learn = lambda: compare_torch.learn(lambda: compare_torch.mlp(rows.x.shape[1]), rows, seed, many, rate=0.03, one_cycle=True)
    return fitted(rows, learn, compare_torch.probability, compare_torch.size, rounds=lambda model: model.best_pass)


def tabm(rows, seed, many):
    learn = lambda: compare_torch.learn(lambda: compare_torch.TabM(rows.x.shape[1]), rows, seed, many, rate=2e-3, one_cycle=False)
    return fitted(rows, learn, compare_torch.probability, compare_torch.size, rounds=lambda model: model.best_pass)


def logistic(rows, seed, many):
    learn = lambda: LogisticRegression(max_iter=1000).fit(rows.x, rows.y, rows.weights)
    return fitted(rows, learn, probability, pickled(lambda model: model.coef_.size + 1))


def forest(rows, seed, many):
    settings = dict(n_estimators=50 if many else 100, min_samples_leaf=3, random_state=seed, max_samples=200_000 if many else None)
    learn = lambda: RandomForestClassifier(**settings).fit(rows.x, rows.y, rows.weights)
    return fitted(rows, learn, probability, pickled(lambda model: sum(tree_parameters(one.tree_) for one in model.estimators_)))


def histogram_boosting(rows, seed, many):
    def learn():
        model = HistGradientBoostingClassifier(max_iter=1000, learning_rate=0.1, max_leaf_nodes=63 if many else 31, early_stopping=True,
                                               n_iter_no_change=20, tol=0, random_state=seed)  # fmt: skip
        return model.fit(rows.x, rows.y, rows.weights, X_val=rows.choose_x, y_val=rows.choose_y, sample_weight_val=rows.choose_weights)

    def count(model):
        trees = [tree[0].nodes["is_leaf"] for tree in model._predictors]
        return sum(splits_and_leaves(len(leaf), int(leaf.sum())) for leaf in trees)

    return fitted(rows, learn, probability, pickled(count), rounds=lambda model: model.n_iter_)


def lightgbm(rows, seed, many):
    def learn():
        model = LGBMClassifier(n_estimators=2000, learning_rate=0.1 if many else 0.05, num_leaves=127 if many else 31, subsample=0.8,
                               subsample_freq=1, colsample_bytree=0.8, random_state=seed, n_jobs=1, verbose=-1)  # fmt: skip
        stop = early_stopping(30, verbose=False)
        return model.fit(rows.x, rows.y, rows.weights, eval_X=rows.choose_x, eval_y=rows.choose_y, eval_sample_weight=[rows.choose_weights], callbacks=[stop])

    def size(model):
        trees = model.booster_.dump_model()["tree_info"][: model.best_iteration_]
        return sum(3 * tree["num_leaves"] - 2 for tree in trees), len(model.booster_.model_to_string(num_iteration=model.best_iteration_))

    return fitted(rows, learn, lambda model, x: model.booster_.predict(x, num_threads=1), size, rounds=lambda model: model.best_iteration_)


def xgboost(rows, seed, many):
    def learn():
        model = XGBClassifier(n_estimators=2000, learning_rate=0.1 if many else 0.05, max_depth=8 if many else 6, subsample=0.8, colsample_bytree=0.8,
                              tree_method="hist", early_stopping_rounds=30, random_state=seed, n_jobs=1)  # fmt: skip
        return model.fit(rows.x, rows.y, sample_weight=rows.weights, eval_set=[(rows.choose_x, rows.choose_y)],
                         sample_weight_eval_set=[rows.choose_weights], verbose=False)  # fmt: skip

    def size(model):
        kept = model.get_booster()[: model.best_iteration + 1]
        leaves = sum(tree.count("leaf=") for tree in kept.get_dump())
        return 3 * leaves - 2 * (model.best_iteration + 1), len(kept.save_raw("ubj"))

    return fitted(rows, learn, probability, size, rounds=lambda model: model.best_iteration + 1)


def catboost(rows, seed, many):
    def learn():
        model = CatBoostClassifier(iterations=1000, learning_rate=0.15 if many else 0.08, depth=8 if many else 6, od_type="Iter", od_wait=30,
                                   use_best_model=True, random_seed=seed, thread_count=1, class_weights=list(rows.class_weights),
                                   verbose=False, allow_writing_files=False)  # fmt: skip
        return model.fit(rows.x, rows.y, eval_set=(rows.choose_x, rows.choose_y))

    # Trees are symmetric: a level is one split.
    count = lambda model: sum(2 * (len(leaves).bit_length() - 1) + len(leaves) for leaves in np.split(
        model.get_leaf_values(), np.cumsum(model.get_tree_leaf_counts())[:-1]))  # fmt: skip
    size = lambda model: (count(model), len(model._serialize_model()))
    return fitted(rows, learn, lambda model, x: model.predict_proba(x, thread_count=1)[:, 1], size, rounds=lambda model: model.tree_count_)


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


def one_threshold(rows, seed, many):
    def learn():
        areas = [area_under_roc(rows.y, column) for column in rows.x.T]
        best = int(np.argmax(np.abs(np.array(areas) - 0.5)))
        return best, 1.0 if areas[best] >= 0.5 else -1.0

    score = lambda model, x: model[1] * x[:, model[0]].astype(float)
    return fitted(rows, learn, score, lambda model: (3, len(pickle.dumps(model))), probabilities=False)


#: Name: (classifier, seeds of small rows, seeds at full size; 0 = not trained there). Those of one seed draw nothing, or take long; nothing is
#: gained by more: an interval over scenes is wider than what seeds move at full size.
CLASSIFIERS = {
    NETWORK: (network, 5, 3),
    "network (Adam)": (adam, 5, 3),
    "TabM": (tabm, 3, 1),
    "LightGBM": (lightgbm, 5, 1),
    "XGBoost": (xgboost, 5, 1),
    "CatBoost": (catboost, 5, 1),
    "HistGradientBoosting": (histogram_boosting, 5, 1),
    "random forest": (forest, 5, 1),
    "complex tree": (complex_tree, 5, 1),
    "logistic regression": (logistic, 5, 1),
    "fine Gaussian SVM": (fine_svm, 3, 0),
    "fine KNN": (fine_knn, 5, 0),
    "one threshold": (one_threshold, 5, 1),
}
