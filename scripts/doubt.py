"""What a network's probabilities are worth on yards of other kinds, and what tells the cells that it should not be believed on.

Usage:  cargo build --release
        python scripts/doubt.py [--scenes 140] [--seeds 1,2,3,4,5] [--every 8] [--quick]

Trains on configs/mixed.yaml as `train` does by default and by the Kalman filter, whose covariance is what the variance is of, and judges on
one corpus of the held-out families alone (held_out.py), of which every eighth cell is taken. Three questions:

  Calibration   Expected calibration error (15 bins, points) and logarithmic loss (nats) by family: of the output with the way between its
                targets undone, of the model's calibration (two numbers, fitted to its validation scenes), and of isotonic regression on the same scenes
                (scikit-learn). Beside them the model's calibration set right for the share of classes of the family at hand, found from the
                outputs alone by expectation-maximisation (Saerens, Latinne & Decaestecker 2002).
                All of it for both trainings.
  Risk          Cells are set aside by how sure of them a network is; what is left is judged by balanced error, mean of the families. Sure by
                the distance of the output from the threshold, in logits of the way between the targets; by that distance over the root of 1 + c v, v the
                variance of the logit that the filter's own covariance gives (linearised: J P J'), c chosen on the validation scenes; and the
                distance of the mean of all trainings' outputs, an ensemble: of those by the Kalman filter, and of those by default.
  Variance      Is v higher where the network knows less? Area under ROC for telling held-out families from the training's own test scenes, cells with
                an input beyond the training's 0.1 and 99.9 % from others, cells of one point from cells of four and more, and wrong calls from right
                ones, beside what the distance from the threshold tells; 0.5 is nothing.

Needs numpy, pyarrow, scikit-learn and matplotlib. Writes doubt.json and doubt.md into scripts/results, and docs/risk-coverage.png.
"""

import argparse
import json
import struct

import numpy as np
from sklearn.isotonic import IsotonicRegression
from sklearn.metrics import roc_auc_score

import held_out
import network_json
import study
from transfer import outputs

BINS = 15
COVERAGES = [1.0, 0.98, 0.95, 0.9, 0.8]
WEIGHTS = [0.0, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0]
TINY = 1e-6
#: Ways to be sure: of one default network, and of several.
BY_DEFAULT, OF_DEFAULTS = "the default's probability", "ensemble of {} defaults"


def sigmoid(x):
    return 1 / (1 + np.exp(-x))


def logit(p):
    return np.log(p / (1 - p))


class Network:
    """A run: its network, of one member or several, and its calibration."""

    def __init__(self, marsyard, run):
        self.exported = held_out.network(marsyard, run)
        self.about = self.exported["about"]

    def judge(self, cells):
        """Output of each cell."""
        return [outputs(self.exported, cells)]

    def rare(self, cells):
        """Cells with an input beyond what all but 0.2 % of the training's rows have."""
        quantiles = np.array(self.about["quantiles"])
        columns = [cells[name].astype(float) for name in self.about["features"]]
        outside = [(column < low) | (column > high) for column, low, high in zip(columns, quantiles[:, 1], quantiles[:, 5])]
        return np.any(outside, axis=0)

    def probabilities(self, outputs):
        return network_json.probabilities(self.about, outputs)


class Filtered(Network):
    """One that the Kalman filter trained, with the covariance of its weights."""

    def __init__(self, marsyard, run):
        super().__init__(marsyard, run)
        [layers] = self.exported["members"]
        self.layers = [(np.array(layer["weights"]), np.array(layer["biases"])) for layer in layers]
        self.covariance = covariance(run / "filter.safetensors", sum(w.size + b.size for w, b in self.layers))

    def judge(self, cells):
        """Output, and the variance of its logit, of each cell."""
        x, found = network_json.inputs(self.about, np.stack([cells[name] for name in self.about["features"]], axis=1)), []
        for start in range(0, len(x), 20_000):
            values = [x[start:start + 20_000]]
            for weights, biases in self.layers:
                values.append(sigmoid(values[-1] @ weights.T + biases))
            slopes, parts = np.ones((len(values[0]), 1)), []
            for depth in range(len(self.layers) - 1, -1, -1):
                of_weights = (slopes[:, :, None] * np.concatenate([values[depth], np.ones((len(slopes), 1))], axis=1)[:, None, :])
                parts.append(of_weights.reshape(len(slopes), -1))
                slopes = (slopes @ self.layers[depth][0]) * values[depth] * (1 - values[depth])
            jacobian = np.concatenate(parts[::-1], axis=1)
            found.append([values[-1][:, 0], np.einsum("ij,ij->i", jacobian @ self.covariance, jacobian)])
        return np.concatenate(found, axis=1)


def covariance(path, weights):
    """P of the best weights: a triangle, what is pending of it, and what is not on its diagonal yet."""
    content = path.read_bytes()
    size = struct.unpack("<Q", content[:8])[0]
    header, types = json.loads(content[8:8 + size]), {"F32": "<f4", "F64": "<f8", "U64": "<u8"}

    def array(name):
        about = header[f"best/filter/{name}"]
        start, end = about["data_offsets"]
        return np.frombuffer(content[8 + size + start:8 + size + end], types[about["dtype"]])

    lower = np.zeros((weights, weights))
    lower[np.tril_indices(weights)] = array("covariance")
    pending = array("pending").reshape(int(array("pending_rank")[0]), weights).astype(float)
    return lower + np.tril(lower, -1).T + array("pending_q")[0] * np.eye(weights) - pending.T @ pending


def calibration_error(probabilities, untraversable):
    bins = np.minimum((probabilities * BINS).astype(int), BINS - 1)
    sums = lambda of: np.bincount(bins, weights=of, minlength=BINS)
    return np.abs(sums(probabilities) - sums(untraversable)).sum() / len(bins)


def log_losses(probabilities, untraversable):
    """Of each cell, nats."""
    return -np.log(np.clip(np.where(untraversable, probabilities, 1 - probabilities), TINY, 1))


def log_loss(probabilities, untraversable):
    return log_losses(probabilities, untraversable).mean()


def shifted(probabilities, share):
    """Probabilities under the share of untraversable cells that explains them best, and that share."""
    found = share
    for _ in range(200):
        for_it, against = probabilities * found / share, (1 - probabilities) * (1 - found) / (1 - share)
        probabilities_there = for_it / (for_it + against)
        found = probabilities_there.mean()
    return probabilities_there, found


def calibration_table(networks, judged, validation, test, family):
    """Means over the trainings, by family: the errors of the four ways to a probability."""
    rows, facts = [], {}
    untraversable = test["label"] == 1
    names = [*held_out.FAMILIES, "all"]
    errors = {name: [] for name in names}
    for network, of in zip(networks, judged):
        low, high = network.about["targets"]
        undone = np.clip((of["test"][0] - low) / (high - low), TINY, 1 - TINY)
        own = network.probabilities(of["test"][0])
        isotonic = IsotonicRegression(y_min=1e-4, y_max=1 - 1e-4, out_of_bounds="clip").fit(of["validation"][0], validation["label"])
        stepped = isotonic.predict(of["test"][0])
        share = (validation["label"] == 1).mean()
        for name in names:
            at = np.ones(len(family), bool) if name == "all" else family == name
            moved, _ = shifted(own[at], share)
            ways = [undone[at], own[at], stepped[at], moved]
            errors[name].append([[calibration_error(p, untraversable[at]), log_loss(p, untraversable[at])] for p in ways])
    for name in names:
        mean = np.mean(errors[name], axis=0)
        facts[name] = mean.tolist()
        rows.append([name, *[f"{100 * error:.2f}, {loss:.3f}" for error, loss in mean]])
    return study.markdown(["family", "output", "calibrated", "isotonic", "calibrated and shifted"], rows), facts


def kept_counts(cells, outputs, sureness, coverage):
    """Counts by scene of the cells that are not set aside."""
    kept = sureness >= np.quantile(sureness, 1 - coverage)
    left = {"label": cells["label"][kept], "scene": cells["scene"][kept], "family_of_scene": cells["family_of_scene"]}
    return held_out.counts(left, outputs[kept])


def balanced_error(cells, outputs, sureness, coverage):
    """Of all families as one, for the choice of c."""
    kept = sureness >= np.quantile(sureness, 1 - coverage)
    untraversable, called = cells["label"][kept] == 1, outputs[kept] >= 0.5
    return ((~called[untraversable]).mean() + called[~untraversable].mean()) / 2


def distance(network, outputs):
    """From the threshold, in logits of the way between the targets."""
    low, high = network.about["targets"]
    return np.abs(logit(np.clip((outputs - low) / (high - low), TINY, 1 - TINY)))


def risks(networks, judged, usual, judged_usual, validation, test):
    """By way and coverage: a judgement of the cells that are left."""
    found, weights = {}, []
    for network, of in zip(networks, judged):
        outputs, variance = of["validation"]
        unit = np.median(variance)
        by = [balanced_error(validation, outputs, distance(network, outputs) / np.sqrt(1 + c * variance / unit), 0.9) for c in WEIGHTS]
        weights.append((WEIGHTS[int(np.argmin(by))], unit))
    trained = {f"ensemble of {len(networks)} Kalman filters": (networks, judged), OF_DEFAULTS.format(len(usual)): (usual, judged_usual)}
    ensembles = {way: (of[0], np.mean([one["test"][0] for one in told], axis=0)) for way, (of, told) in trained.items()}
    for coverage in COVERAGES:
        counts = {"probability": [], "with the filter's variance": [], BY_DEFAULT: []}
        for network, of in zip(usual, judged_usual):
            outputs = of["test"][0]
            counts[BY_DEFAULT].append(kept_counts(test, outputs, distance(network, outputs), coverage))
        for network, of, (c, unit) in zip(networks, judged, weights):
            outputs, variance = of["test"]
            sure = distance(network, outputs)
            counts["probability"].append(kept_counts(test, outputs, sure, coverage))
            counts["with the filter's variance"].append(kept_counts(test, outputs, sure / np.sqrt(1 + c * variance / unit), coverage))
        for way, (network, outputs) in ensembles.items():
            counts[way] = [kept_counts(test, outputs, distance(network, outputs), coverage)]
        for way, of in counts.items():
            found.setdefault(way, []).append(held_out.Judgement(test, of))
    return found, [c for c, _ in weights]


def doubtful_row(networks, judged, test, share):
    """What `--doubtful SHARE` sets aside, and what is left wrong, mean of the trainings: percent."""
    untraversable, of_trainings = test["label"] == 1, []
    for network, of in zip(networks, judged):
        curve = np.array(network.about["calibration"]["curve"])
        low, high = curve[curve[:, 1] <= share][-1, 0], curve[curve[:, 2] <= share][0, 0]
        outputs = of["test"][0]
        aside = (outputs >= low) & (outputs < high)
        of_trainings.append([aside.mean(), aside[untraversable].mean(), (outputs[untraversable] < low).mean(), (outputs[~untraversable] >= max(low, high)).mean()])
    return [f"{100 * value:.2f}" for value in np.mean(of_trainings, axis=0)]


def variance_table(networks, judged, own, test, points):
    told = {"held-out families from the training's": [], "an input out of range": [], "one point from four and more": [], "wrong calls": []}
    for network, of in zip(networks, judged):
        outputs, variance = of["test"]
        near, own_near = -distance(network, outputs), -distance(network, of["own"][0])
        both = np.r_[np.zeros(len(of["own"][1])), np.ones(len(variance))]
        told["held-out families from the training's"].append([roc_auc_score(both, np.r_[of["own"][1], variance]), roc_auc_score(both, np.r_[own_near, near])])
        rare = network.rare(test)
        told["an input out of range"].append([roc_auc_score(rare, variance), roc_auc_score(rare, near)])
        thin = (points == 1) | (points >= 4)
        told["one point from four and more"].append([roc_auc_score(points[thin] == 1, variance[thin]), roc_auc_score(points[thin] == 1, near[thin])])
        wrong = (outputs >= 0.5) != (test["label"] == 1)
        told["wrong calls"].append([roc_auc_score(wrong, variance), roc_auc_score(wrong, near)])
    spread = lambda values: f"{np.mean(values):.2f} ({np.min(values):.2f} to {np.max(values):.2f})"
    rows = [[name, spread([one for one, _ in of]), spread([other for _, other in of])] for name, of in told.items()]
    return study.markdown(["telling", "by the filter's variance", "by the distance from the threshold"], rows), told


def chart(found, path):
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    figure, axes = plt.subplots(figsize=(7.2, 4.6), dpi=110)
    for (way, of), colour in zip(found.items(), ["#1f5fa8", "#d97b29", "#7a4fa3", "#3a7d44", "#b0413e"]):
        means = [judged.mean() for judged in of]
        values = [100 * (1 - value) for value, _ in means]
        low, high = zip(*[100 * (1 - np.percentile(draws, [97.5, 2.5])) for _, draws in means])
        axes.plot([100 * c for c in COVERAGES], values, marker="o", label=way, color=colour)
        axes.fill_between([100 * c for c in COVERAGES], low, high, color=colour, alpha=0.12, linewidth=0)
    axes.set(xlabel="cells that are not set aside, %", ylabel="balanced error of those, %, mean of the held-out families", ylim=(0, None))
    axes.invert_xaxis()
    axes.legend(frameon=False)
    axes.grid(alpha=0.3)
    figure.tight_layout()
    figure.savefig(path)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", default=140, type=int, help="of the training corpus (default 140)")
    parser.add_argument("--seeds", default="1,2,3,4,5")
    parser.add_argument("--test-scenes", default=560, type=int, help="of the test corpus (default 560)")
    parser.add_argument("--test-seed", default=51, type=int)
    parser.add_argument("--every", default=8, type=int, help="of the test cells one in so many (default 8)")
    study.add_arguments(parser, "doubt")
    options = parser.parse_args()
    seeds, scenes, test_scenes = [int(seed) for seed in options.seeds.split(",")], options.scenes, options.test_scenes
    if options.quick:
        seeds, scenes, test_scenes = [1, 2], 70, 70
    marsyard = study.Marsyard(options.marsyard, options.work, options.threads)
    corpus = marsyard.corpus(f"mixed-{scenes}", held_out.CONFIG, [], scenes, held_out.PER_SHARD)
    place = held_out.corpus(marsyard, f"test-{test_scenes}", options.test_seed, test_scenes)
    networks = [Filtered(marsyard, marsyard.train(f"mixed-{scenes}", [corpus], seed, study.KALMAN_FILTER)) for seed in seeds]
    usual = [Network(marsyard, marsyard.train(f"mixed-{scenes}-default", [corpus], seed)) for seed in seeds]
    columns = [*networks[0].about["features"], "points"]
    validation, own = (held_out.read(corpus, columns, [split]) for split in ("validation", "test"))
    of_training = np.isin(own["family_of_scene"][own["scene"]], range(len(held_out.TRAINING)))
    thinned = lambda cells, taken: {name: of if name == "family_of_scene" else of[taken] for name, of in cells.items()}
    own, test = thinned(own, of_training), held_out.read(place, columns)
    test = thinned(test, np.arange(0, len(test["label"]), options.every))
    family = np.array(held_out.TRAINING + held_out.FAMILIES)[test["family_of_scene"][test["scene"]]]
    of_all = lambda network: {"validation": network.judge(validation), "own": network.judge(own), "test": network.judge(test)}
    judged, judged_usual = [of_all(network) for network in networks], [of_all(network) for network in usual]

    calibration, calibration_facts = calibration_table(networks, judged, validation, test, family)
    usual_calibration, usual_facts = calibration_table(usual, judged_usual, validation, test, family)
    found, weights = risks(networks, judged, usual, judged_usual, validation, test)
    variance, variance_facts = variance_table(networks, judged, own, test, test["points"])
    error = lambda judgement: held_out.told((1 - judgement.mean()[0], 1 - judgement.mean()[1]))
    risk_rows = [[way, *[error(judgement) for judgement in of]] for way, of in found.items()]
    plain = found["probability"]
    less = lambda of, base: [held_out.told_difference(one.mean(), other.mean()) for one, other in zip(base, of)]
    differences = [[way, *less(of, plain)] for way, of in found.items() if of is not plain]
    of_defaults = OF_DEFAULTS.format(len(seeds))
    differences.append([f"{of_defaults}, less {BY_DEFAULT}", *less(found[of_defaults], found[BY_DEFAULT])])
    aside = [[f"{100 * share:g} %", *doubtful_row(usual, judged_usual, test, share), *doubtful_row(networks, judged, test, share)] for share in (0.005, 0.01, 0.02, 0.05)]
    chart(found, study.ROOT / "docs" / "risk-coverage.png" if not options.quick else options.out / "risk-coverage.png")
    head = [f"{100 * coverage:g} % kept" for coverage in COVERAGES]
    text = "\n\n".join([
        "# What the probabilities are worth, and what is doubtful",
        f"`python scripts/doubt.py`, {study.versions(marsyard)['marsyard']}: configs/mixed.yaml, {scenes} scenes, {len(seeds)} trainings; "
        f"test: {len(test['label']):,} cells of {test_scenes} scenes of the held-out families, seed {options.test_seed}.",
        "## Calibration",
        "Expected calibration error in points, logarithmic loss in nats; means over the trainings.",
        "By default:",
        usual_calibration,
        "By the Kalman filter:",
        calibration,
        "## Risk against coverage",
        "Balanced error of the cells that are left, percent, mean of the held-out families, with 95 % intervals over scenes and trainings. Where no other is named, "
        "the networks are the Kalman filter's.",
        study.markdown(["sure by", *head], risk_rows),
        f"Differences to the probability alone, points; c of the variance, chosen on validation scenes: {', '.join(f'{c:g}' for c in weights)}.",
        study.markdown(["sure by", *head], differences),
        "## `--doubtful SHARE`",
        "Percent of all cells and of the untraversable ones that are doubtful; then of each class what is called wrongly all the same: by default, "
        "and by the Kalman filter.",
        study.markdown(["allowed", *["doubtful", "of the untraversable", "missed", "false"], *["filter: doubtful", "of the untraversable", "missed", "false"]], aside),
        "## What the filter's variance tells",
        "Area under ROC, mean and range over the trainings; 0.5 is nothing.",
        variance]) + "\n"
    results = {
        "versions": study.versions(marsyard), "calibration": calibration_facts, "calibration_by_default": usual_facts, "variance": variance_facts, "weights_of_variance": weights,
        "risk": {way: [[float(1 - judgement.mean()[0]), *map(float, 1 - np.percentile(judgement.mean()[1], [97.5, 2.5]))] for judgement in of] for way, of in found.items()},
    }
    study.write_results(options.out, "doubt", results, text)


if __name__ == "__main__":
    main()
