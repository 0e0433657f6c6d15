"""What is said of a classifier's scores: rates, area under ROC, calibration, and intervals over scenes and trainings.

Calibration error and log loss are of a world in which both classes are equally frequent, as all classifiers were told by class weights:
each row weighs so much that both classes sum to one half. No classifier may be surer than 99.9 %, so that one row cannot decide a log loss.
"""

import numpy as np
from scipy.stats import rankdata

SURE = 1e-3
BINS = 15
RESAMPLES = 2000
COUNTS = ["tp", "fn", "fp", "tn"]


def area_under_roc(labels, scores):
    positive = labels == 1
    ones, zeros = int(positive.sum()), int((~positive).sum())
    return float((rankdata(scores)[positive].sum() - ones * (ones + 1) / 2) / (ones * zeros))


def balanced_weights(labels):
    return (len(labels) / (2 * np.bincount(labels, minlength=2)))[labels]


def losses(labels, probabilities):
    sure = np.clip(probabilities.astype(float), SURE, 1 - SURE)
    return -np.where(labels == 1, np.log(sure), np.log1p(-sure))


def calibration_error(labels, probabilities, weights):
    """Expected calibration error over bins of equal mass; equal probabilities share a bin."""
    levels, place = np.unique(probabilities, return_inverse=True)
    mass = np.bincount(place, weights)
    middle = (np.cumsum(mass) - mass / 2) / mass.sum()
    bins = np.minimum((middle * BINS).astype(int), BINS - 1)[place]
    gap = np.bincount(bins, weights * (labels - probabilities), minlength=BINS)
    return float(np.abs(gap).sum() / weights.sum())


def best_threshold(labels, scores):
    """The score from which rows are called untraversable, and its balanced accuracy: the best there is, halfway to the next score below."""
    order = np.argsort(-scores, kind="stable")
    hits = np.cumsum(labels[order] == 1)
    false = np.arange(1, len(order) + 1) - hits
    gain = hits / hits[-1] - false / false[-1]
    gain[:-1][np.diff(scores[order]) == 0] = -1  # equal scores stay together
    at = int(np.argmax(gain))
    below = scores[order][min(at + 1, len(order) - 1)]
    return float((scores[order][at] + below) / 2), float((1 + gain[at]) / 2)


def scene_counts(labels, called, scene, scenes):
    """Counts of each scene, from which everything that a threshold decides follows."""
    kinds = {"tp": (labels == 1) & called, "fn": (labels == 1) & ~called, "fp": (labels == 0) & called, "tn": (labels == 0) & ~called}
    return {kind: np.bincount(scene[rows], minlength=scenes).tolist() for kind, rows in kinds.items()}


def rates(counts):
    """Of counts by name, numbers or arrays."""
    with np.errstate(invalid="ignore", divide="ignore"):
        missed, false = counts["fn"] / (counts["tp"] + counts["fn"]), counts["fp"] / (counts["fp"] + counts["tn"])
        return {"balanced_accuracy": 1 - (missed + false) / 2, "missed": missed, "false": false, "precision": counts["tp"] / (counts["tp"] + counts["fp"])}


class Bootstrap:
    """Resamples of the test scenes, within each family, and of the seeds, by which rows to learn and trainings are drawn; the same for all classifiers, so that differences are paired."""

    def __init__(self, families, seeds):
        rng = np.random.default_rng(7)
        families = np.array(families)
        self.members = {name: np.flatnonzero(families == name) for name in sorted(set(families))}
        self.times = np.zeros((RESAMPLES + 1, len(families)))
        self.times[0] = 1  # the scenes as they are
        for members in self.members.values():
            drawn = rng.multinomial(len(members), np.full(len(members), 1 / len(members)), RESAMPLES)
            self.times[1:, members] = drawn
        self.seeds, self.shares = sorted(seeds), np.full((RESAMPLES + 1, len(seeds)), 1 / len(seeds))
        self.shares[1:] = rng.multinomial(len(seeds), self.shares[0], RESAMPLES) / len(seeds)

    def rates(self, run, members=slice(None)):
        return rates({kind: self.times[:, members] @ np.array(run["scenes"][kind], float)[members] for kind in COUNTS})

    def by_seed(self, runs):
        """Of runs of one classifier, one a seed: each rate, averaged over the seeds, for every resample; balanced accuracy by family, too."""
        runs = sorted(runs, key=lambda run: run["seed"])
        assert [run["seed"] for run in runs] == self.seeds, "each seed once"
        mean = lambda tables: {rate: sum(share * table[rate] for share, table in zip(self.shares.T, tables)) for rate in tables[0]}
        found = mean([self.rates(run) for run in runs])
        found["families"] = {name: mean([self.rates(run, members) for run in runs])["balanced_accuracy"] for name, members in self.members.items()}
        of_families = np.array(list(found["families"].values()))
        return found | {"worst_family": of_families.min(axis=0), "mean_of_families": of_families.mean(axis=0)}


def interval(resampled):
    """Value, and the interval that holds 95 % of the resamples."""
    low, high = np.nanpercentile(resampled[1:], [2.5, 97.5])
    return {"value": float(resampled[0]), "low": float(low), "high": float(high)}


def check_on_scikit_learn():
    """These measures are scikit-learn's, on rows with ties and with weights; a difference ends the study."""
    from sklearn.calibration import calibration_curve
    from sklearn.metrics import balanced_accuracy_score, log_loss, precision_score, roc_auc_score

    rng = np.random.default_rng(11)
    labels = (rng.random(30_000) < 0.1).astype(np.int8)
    scores = np.clip(np.round(rng.normal(0.3 + 0.3 * labels, 0.2), 2), 0.01, 0.99)  # rounded, so that many are equal
    weights = balanced_weights(labels)
    threshold, balanced = best_threshold(labels, scores)
    called = scores >= threshold
    told = rates({kind: sum(of) for kind, of in scene_counts(labels, called, np.zeros(len(labels), int), 1).items()})
    smooth = rng.random(30_000)  # no ties, so that bins of equal mass are quantiles
    drawn = (rng.random(30_000) < smooth**1.5).astype(np.int8)
    true, said = calibration_curve(drawn, smooth, n_bins=BINS, strategy="quantile")
    pairs = {
        "AUC": (area_under_roc(labels, scores), roc_auc_score(labels, scores)),
        "log loss": (np.average(losses(labels, scores), weights=weights), log_loss(labels, np.clip(scores, SURE, 1 - SURE), sample_weight=weights)),
        "balanced accuracy": (told["balanced_accuracy"], balanced_accuracy_score(labels, called)),
        "best threshold": (balanced, max(balanced_accuracy_score(labels, scores >= level) for level in np.unique(scores))),
        "precision": (told["precision"], precision_score(labels, called)),
        "calibration error": (calibration_error(drawn, smooth, np.ones(30_000)), np.abs(true - said).mean()),
    }  # fmt: skip
    for name, (ours, theirs) in pairs.items():
        if abs(ours - theirs) > 1e-9:
            raise SystemExit(f"compare_measures.py: {name} is {ours}, scikit-learn says {theirs}")
    return {name: abs(ours - theirs) for name, (ours, theirs) in pairs.items()}
