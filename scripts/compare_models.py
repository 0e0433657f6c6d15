"""The classifiers of compare_classifiers.py, each as somebody who knows it would set it. One thread each.

A classifier is a function of `Rows`, a seed and whether the rows are many; it gives a `Fitted`. Those with rounds or passes stop by the
weighted log loss of the validation rows, which all are given alike. SVM and threshold give scores that are no probabilities.

- network (default): marsyard's trainer with all defaults, which standardises by itself; network (squared): the same by the squared error.
- network (EKF), fine Gaussian SVM, fine KNN, complex tree: compare_paper.py.
- network (Adam): PyTorch's, of the Kalman filter's size and neurons; two of 64-64 (Adam): of the default's size, rectified, at the rate that
  time_to_error.py's search finds on quickstart.yaml and paper.yaml (on mixed.yaml it finds 0.003 in batches of 256; mars.yaml is not searched).
- LightGBM, regularised: those of held_out.py, which learning_curve.py and anatomy.py learn: small trees of many cells each, for yards of other families.
- one threshold: the column and direction of the largest area under ROC on the training rows.
"""

import pickle

import numpy as np
from catboost import CatBoostClassifier
from lightgbm import LGBMClassifier, early_stopping
from sklearn.ensemble import HistGradientBoostingClassifier, RandomForestClassifier
from sklearn.linear_model import LogisticRegression
from torch import nn
from xgboost import XGBClassifier

import compare_torch
from compare_measures import area_under_roc
from compare_paper import complex_tree, fine_knn, fine_svm, fitted, network, pickled, probability, splits_and_leaves, taught, tree_parameters
from held_out import TREE_ROUNDS, TREES
from timed_learners import Members
from train_rows import DEFAULT, DEFAULT_NETWORK, NETWORK, SQUARED, SQUARED_NETWORK


def by_default(but=()):
    """marsyard's default, but for some settings."""
    return lambda rows, seed, many: taught(rows.stored, rows, {"seed": seed, "neighbours": rows.neighbours, **DEFAULT, **dict(but)}, rows.names)


def by_torch(make, rate, one_cycle):
    """`make`: a network for so many inputs."""

    def learner(rows, seed, many):
        learn = lambda: compare_torch.learn(lambda: make(rows.x.shape[1]), rows, seed, many, rate, one_cycle)
        return fitted(rows, learn, compare_torch.probability, compare_torch.size, rounds=lambda model: model.best_pass)

    return learner


def kalman_sized(inputs):
    return compare_torch.mlp(inputs, (16, 16), nn.Sigmoid)


def default_sized(inputs):
    return Members(*(compare_torch.mlp(inputs, (64, 64), nn.ReLU) for _ in range(2)))


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
    settings = dict(n_estimators=2000, learning_rate=0.1 if many else 0.05, num_leaves=127 if many else 31, subsample=0.8, subsample_freq=1,
                    colsample_bytree=0.8)
    return light_trees(rows, seed, settings)


def lightgbm_regularised(rows, seed, many):
    return light_trees(rows, seed, dict(n_estimators=TREE_ROUNDS, **TREES))


def light_trees(rows, seed, settings):
    def learn():
        model = LGBMClassifier(**settings, random_state=seed, n_jobs=1, verbose=-1)
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


def one_threshold(rows, seed, many):
    def learn():
        areas = [area_under_roc(rows.y, column) for column in rows.x.T]
        best = int(np.argmax(np.abs(np.array(areas) - 0.5)))
        return best, 1.0 if areas[best] >= 0.5 else -1.0

    score = lambda model, x: model[1] * x[:, model[0]].astype(float)
    return fitted(rows, learn, score, lambda model: (3, len(pickle.dumps(model))), probabilities=False)


#: What forms normal scores by itself: forms that have them are not tried.
OWN_SCORES = {DEFAULT_NETWORK, SQUARED_NETWORK}
CLASSIFIERS = {
    DEFAULT_NETWORK: by_default(),
    NETWORK: network,
    SQUARED_NETWORK: by_default(SQUARED),
    "network (Adam)": by_torch(kalman_sized, rate=0.03, one_cycle=True),
    "two of 64-64 (Adam)": by_torch(default_sized, rate=0.01, one_cycle=True),
    "TabM": by_torch(compare_torch.TabM, rate=2e-3, one_cycle=False),
    "LightGBM": lightgbm,
    "LightGBM, regularised": lightgbm_regularised,
    "XGBoost": xgboost,
    "CatBoost": catboost,
    "HistGradientBoosting": histogram_boosting,
    "random forest": forest,
    "complex tree": complex_tree,
    "logistic regression": logistic,
    "fine Gaussian SVM": fine_svm,
    "fine KNN": fine_knn,
    "one threshold": one_threshold,
}
#: What learns small rows alone: full size would take it days.
SMALL_ALONE = {"fine Gaussian SVM", "fine KNN"}
