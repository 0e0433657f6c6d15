#!/usr/bin/env python3
"""How long marsyard's Kalman filter takes to a given validation error, beside PyTorch's Adam and scikit-learn's MLPClassifier.

    cargo run --release -- generate configs/paper.yaml
    cargo build --release --example train_rows
    pip install numpy scikit-learn pyarrow torch
    python scripts/time_to_error.py corpora/paper                 # some 7 minutes of CPU time; --quick: 1 minute

All train the same network (14 inputs, two hidden layers of 16, logistic neurons, biases) on the same 100,000 rows of whole scenes, with
inputs standardised by these rows and clipped at 8, and both classes weighing alike. The error is marsyard's own: the weighted mean squared
error of the outputs against 0.1 and 0.9, on 40,000 rows of whole validation scenes, looked at after every 20,000 rows. Everybody has one
thread and the same CPU seconds to learn in (looks are not counted), engines take turns, seed by seed: other initial weights and order.

- marsyard: the EKF at its defaults (f32 covariance, one row at a time); it goes on after its patience ends, so that its whole curve is seen.
- torch: Adam (fused), mean squared error on 0.1 and 0.9 with the same weights, eager mode, f32, batches of 1, 32, 256 and 1024.
- sklearn: MLPClassifier with solver adam and sample weights, batches of 32 and 200. It learns by log loss, its output p is judged as 0.1 + 0.8 p.

The learning rate of each batch size is the best of two or three for seed 1 by its lowest error; the search is not charged.
"""

import argparse
import json
import os
import pathlib
import platform
import tempfile
import time

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "RAYON_NUM_THREADS"):
    os.environ[variable] = "1"

import numpy as np
import sklearn
import torch
from sklearn.metrics import roc_auc_score
from sklearn.neural_network import MLPClassifier

from train_rows import FULL, LISTED, ROOT, TRAINER, Cells, train

torch.set_num_threads(1)
TARGETS = np.array([0.1, 0.9])
LOOK_ROWS = 20_000
#: Multiples of the lowest error that Adam reaches.
STEPS = [3.0, 2.0, 1.5, 1.2, 1.1, 1.05, 1.01, 1.0]


class Task:
    """Rows to learn and to judge by."""

    def __init__(self, corpus, rows, validation_rows):
        columns = [FULL.index(name) for name in LISTED]

        def draw(split, count):
            cells = Cells(corpus, split)
            chosen = cells.whole_scenes(count, np.random.default_rng([5, count]))
            return cells.values[chosen][:, columns], cells.labels[chosen]

        self.raw, self.raw_validation = draw("train", rows), draw("validation", validation_rows)
        mean, scale = self.raw[0].mean(axis=0, dtype=float), self.raw[0].std(axis=0, dtype=float)
        scaled = lambda values: np.clip((values - mean) / scale, -8, 8).astype(np.float32)
        self.x, self.labels = scaled(self.raw[0]), self.raw[1]
        self.vx, self.vlabels = scaled(self.raw_validation[0]), self.raw_validation[1]
        self.class_weights = len(self.labels) / (2 * np.bincount(self.labels, minlength=2))

    def error(self, outputs):
        weights = self.class_weights[self.vlabels]
        return float((weights * (TARGETS[self.vlabels] - outputs) ** 2).sum() / weights.sum())

    def judge(self, outputs):
        positive = self.vlabels == 1
        balanced = ((outputs[positive] >= 0.5).mean() + (outputs[~positive] < 0.5).mean()) / 2
        return {"auc": float(roc_auc_score(self.vlabels, outputs)), "balanced_accuracy": float(balanced)}


class Curve:
    """Errors by rows learnt and CPU seconds of learning."""

    def __init__(self, task, budget_s):
        self.task, self.budget_s, self.looks, self.best = task, budget_s, [], None

    def look(self, rows, cpu_s, outputs):
        """Whether there is time left."""
        error = self.task.error(outputs)
        if self.best is None or error < self.best["error"]:
            self.best = {"error": error, "rows": rows, "cpu_s": cpu_s} | self.task.judge(outputs)
        self.looks.append((rows, cpu_s, error))
        return cpu_s < self.budget_s

    def told(self):
        return {"best": self.best, "looks": self.looks}


def marsyard(task, budget_s, seed, trainer, passes):
    settings = {"seed": seed, "epochs": passes, "patience": 100_000, "validate_every": LOOK_ROWS}
    (outputs,), told = train(task.raw, task.raw_validation, [task.raw_validation[0]], settings, trainer)
    looks = [(look["rows"], look["cpu_learning_s"], look["validation_error"]) for look in told["looks"]]
    looks = [look for look in looks if look[1] <= budget_s]
    rows, cpu_s, error = min(looks, key=lambda look: look[2])
    if error == told["best"]["validation_error"]:
        # Both sides mean the same by the error.
        assert abs(task.error(outputs) - error) < 1e-4 * error, (task.error(outputs), error)
    return {"best": {"error": error, "rows": rows, "cpu_s": cpu_s} | task.judge(outputs), "looks": looks}


def adam(task, budget_s, seed, batch, rate):
    torch.manual_seed(seed)
    sizes = [len(LISTED), 16, 16, 1]
    layers = [part for a, b in zip(sizes[:-1], sizes[1:]) for part in (torch.nn.Linear(a, b), torch.nn.Sigmoid())]
    network = torch.nn.Sequential(*layers)
    optimiser = torch.optim.Adam(network.parameters(), lr=rate, fused=True)
    x, vx = torch.from_numpy(task.x), torch.from_numpy(task.vx)
    target = torch.from_numpy(TARGETS[task.labels].astype(np.float32))[:, None]
    weight = torch.from_numpy(task.class_weights[task.labels].astype(np.float32))[:, None]

    def outputs():
        with torch.no_grad():
            return network(vx).numpy()[:, 0].astype(float)

    curve, rows, cpu_s, next_look = Curve(task, budget_s), 0, 0.0, LOOK_ROWS
    curve.look(0, 0.0, outputs())
    while True:
        begun = time.process_time()
        for part in torch.randperm(len(x)).split(batch):
            optimiser.zero_grad()
            (weight[part] * (network(x[part]) - target[part]).square()).mean().backward()
            optimiser.step()
            rows += len(part)
            if rows >= next_look:
                cpu_s += time.process_time() - begun
                next_look += LOOK_ROWS
                if not curve.look(rows, cpu_s, outputs()):
                    return curve.told()
                begun = time.process_time()
        cpu_s += time.process_time() - begun


def mlp_classifier(task, budget_s, seed, batch, rate):
    network = MLPClassifier((16, 16), activation="logistic", solver="adam", batch_size=batch, learning_rate_init=rate, random_state=seed)
    rng, curve, rows, cpu_s = np.random.default_rng(seed), Curve(task, budget_s), 0, 0.0
    weights = task.class_weights[task.labels]
    while True:
        begun = time.process_time()
        order = rng.permutation(len(task.x))
        for part in np.split(order, range(LOOK_ROWS, len(order), LOOK_ROWS)):
            network.partial_fit(task.x[part], task.labels[part], classes=[0, 1], sample_weight=weights[part])
            rows += len(part)
            cpu_s += time.process_time() - begun
            if not curve.look(rows, cpu_s, 0.1 + 0.8 * network.predict_proba(task.vx)[:, 1]):
                return curve.told()
            begun = time.process_time()
        cpu_s += time.process_time() - begun


ENGINES = {"torch": (adam, {1: [1e-3, 3e-3], 32: [3e-3, 1e-2, 3e-2], 256: [1e-2, 3e-2, 1e-1], 1024: [1e-2, 3e-2, 1e-1]}),
           "sklearn": (mlp_classifier, {32: [3e-3, 1e-2, 3e-2], 200: [3e-3, 1e-2, 3e-2]})}  # fmt: skip


def reached(run, target):
    """Rows and CPU seconds to the first look at or below the target."""
    return next(((rows, cpu_s) for rows, cpu_s, error in run["looks"] if error <= target), None)


def table(about, runs, rows):
    """Medians over the seeds, counted where the target was reached."""
    names = list(dict.fromkeys(run["engine"] for run in runs))
    of = {name: [run for run in runs if run["engine"] == name] for name in names}
    median_best = {name: float(np.median([run["best"]["error"] for run in of[name]])) for name in names}
    goal = min(error for name, error in median_best.items() if name != "marsyard EKF")
    text = "# Time to a validation error\n\n"
    text += f"16-16 network, 14 inputs, {rows:,} training rows (corpus `{about['corpus']}`, corpus_id {about['corpus_id'][:12]}), one thread, {about['budget_s']:g} CPU seconds "
    text += f"each; medians of {about['seeds']} seeds. Lowest error of Adam, median over the seeds: {goal:.5f}. Python {about['python']}, torch {about['torch']}, scikit-learn "
    text += f"{about['scikit-learn']}. Written by `scripts/time_to_error.py`, whose head says what is compared.\n\n"
    text += "| error at most | " + " | ".join(names) + " |\n|---" * 1 + "|---" * len(names) + "|\n"
    summary = {"goal": goal, "best": median_best, "targets": []}
    for step in STEPS:
        cells, line = [], {"multiple": step, "error": step * goal, "engines": {}}
        for name in names:
            found = [r for r in (reached(run, step * goal) for run in of[name]) if r]
            if found:
                passes, cpu_s = np.median([r[0] for r in found]) / rows, np.median([r[1] for r in found])
                line["engines"][name] = {"passes": float(passes), "cpu_s": float(cpu_s), "seeds": len(found)}
                fewer = "" if len(found) == len(of[name]) else f" ({len(found)} of {len(of[name])} seeds)"
                cells.append(f"{passes:.1f} passes, {cpu_s:.2f} s{fewer}")
            else:
                cells.append("not reached")
        summary["targets"].append(line)
        text += f"| {step * goal:.5f} (Adam's lowest x {step:g}) | " + " | ".join(cells) + " |\n"
    bests = [[np.median([run["best"][key] for run in of[name]]) for name in names] for key in ("error", "rows", "cpu_s", "balanced_accuracy", "auc")]
    shown = [f"{e:.5f} ({r / rows:.1f} passes, {s:.1f} s)<br>balanced accuracy {100 * b:.2f} %, AUC {a:.4f}" for e, r, s, b, a in zip(*bests)]
    text += "| lowest error, and what it brings | " + " | ".join(shown) + " |\n"
    spread = [" to ".join(f"{v:.5f}" for v in (min(x), max(x))) for x in ([run["best"]["error"] for run in of[name]] for name in names)]
    text += "| lowest error, over the seeds | " + " | ".join(spread) + " |\n\nLearning rates, and the lowest error of seed 1 with each:\n\n"
    for name in names:
        if tried := of[name][0].get("tried"):
            text += f"- {name}: " + ", ".join(f"{rate} {error:.5f}" for rate, error in tried.items()) + f"; chosen {of[name][0]['rate']:g}\n"
    return text, summary


def write(out, about, summary, runs, text):
    lines = ",\n  ".join(json.dumps(run) for run in runs)
    out.write_text(f'{{\n "about": {json.dumps(about)},\n "summary": {json.dumps(summary)},\n "runs": [\n  {lines}\n ]\n}}\n')
    out.with_suffix(".md").write_text(text)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus", nargs="?", default=str(ROOT / "corpora" / "paper"))
    parser.add_argument("--rows", type=int, default=100_000, help="training rows, at least, in whole scenes")
    parser.add_argument("--validation-rows", type=int, default=40_000)
    parser.add_argument("--budget", type=float, default=10.0, help="CPU seconds of learning, each")
    parser.add_argument("--passes", type=int, default=10, help="of marsyard, at most")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--trainer", default=str(TRAINER))
    parser.add_argument("--out", default=str(ROOT / "scripts" / "results" / "time_to_error.json"))
    parser.add_argument("--quick", action="store_true", help="2 seconds each, one seed; to the temporary folder")
    arguments = parser.parse_args()
    if arguments.quick:
        arguments.budget, arguments.seeds, arguments.passes = 2.0, 1, 3
        arguments.out = os.path.join(tempfile.gettempdir(), "time_to_error.json")
    task = Task(arguments.corpus, arguments.rows, arguments.validation_rows)
    runs, chosen = [], {}
    for seed in range(1, arguments.seeds + 1):
        runs.append({"engine": "marsyard EKF", "seed": seed} | marsyard(task, arguments.budget, seed, arguments.trainer, arguments.passes))
        print(f"seed {seed}  marsyard EKF  {runs[-1]['best']}", flush=True)
        for engine, (learn, batches) in ENGINES.items():
            for batch, rates in batches.items():
                name = f"{engine}, batch {batch}"
                found = [(rate, learn(task, arguments.budget, seed, batch, rate)) for rate in chosen.get(name, rates)]
                rate, run = min(found, key=lambda of: of[1]["best"]["error"])
                chosen[name] = [rate]
                tried = {str(rate): of["best"]["error"] for rate, of in found}
                runs.append({"engine": name, "seed": seed, "rate": rate, "tried": tried} | run)
                print(f"seed {seed}  {name}  rate {rate:g}  {run['best']}", flush=True)
    manifest = json.loads(pathlib.Path(arguments.corpus, "manifest.json").read_text())
    about = {
        "corpus": manifest["name"], "corpus_id": manifest["corpus_id"], "rows": len(task.labels), "validation_rows": len(task.vlabels),
        "seeds": arguments.seeds, "budget_s": arguments.budget, "python": platform.python_version(), "numpy": np.__version__,
        "torch": torch.__version__, "scikit-learn": sklearn.__version__,
    }  # fmt: skip
    text, summary = table(about, runs, len(task.labels))
    for run in runs:
        run["looks"] = [[rows, round(cpu_s, 4), round(error, 6)] for rows, cpu_s, error in run["looks"]]
    out = pathlib.Path(arguments.out)
    out.parent.mkdir(parents=True, exist_ok=True)
    write(out, about, summary, runs, text)
    print(text)


if __name__ == "__main__":
    main()
