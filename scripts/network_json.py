"""A network as `marsyard export --json` tells it, applied with NumPy in f64: what checks and studies share."""

import numpy as np


def inputs(about, rows):
    """Rows of features -> what the network takes: standardised features and, where the scaler has them, their normal scores."""
    scaler = about["scaler"]
    rows = np.asarray(rows, dtype=float)
    x = rows - np.stack([rows[:, other] if other is not None else np.zeros(len(rows)) for other in scaler["minus"]], axis=1)
    scores = [score(values, of) for values, of in zip(x.T, scaler.get("scores", []))]
    scaled = np.clip((x - scaler["mean"]) / scaler["scale"], -scaler["clip"], scaler["clip"])
    return np.concatenate([scaled, np.stack(scores, axis=1)], axis=1) if scores else scaled


def score(values, of):
    """The normal scores of a feature's values; 0 is a neighbour without points where such have a score of their own."""
    between = np.interp(values, of["at"], of["score"])
    return np.where(values == 0, of["unseen"], between) if "unseen" in of else between


def layer(of, x, is_rectified=False):
    sums = x @ np.array(of["weights"]).T + np.array(of["biases"])
    with np.errstate(over="ignore"):
        return np.maximum(sums, 0.0) if is_rectified else 1.0 / (1.0 + np.exp(-sums))


def place(about, outputs):
    """The logit of where outputs lie between the targets, as the calibration takes them."""
    (low, high), edge = about["targets"], about["calibration"].get("edge", 0.01)
    share = np.clip((outputs - low) / (high - low), edge, 1 - edge)
    return np.log(share / (1 - share))


def probabilities(about, outputs):
    """That cells of these outputs are untraversable."""
    calibration = about["calibration"]
    return 1 / (1 + np.exp(-(calibration["slope"] * place(about, outputs) + calibration["offset"])))


def outputs(model, rows):
    """The mean of the members' outputs."""
    scaled, found = inputs(model["about"], rows), []
    activation = model["about"].get("activation")
    for number, layers in enumerate(model["members"]):
        is_rectified = activation == "relu" or activation == "both" and number % 2 == 1
        x = scaled
        for of in layers[:-1]:
            x = layer(of, x, is_rectified)
        x = layer(layers[-1], x)
        found.append(x[:, 0])
    return np.mean(found, axis=0)
