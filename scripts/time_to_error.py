#!/usr/bin/env python3
"""What error on test scenes a CPU second buys: marsyard's filters beside scikit-learn, PyTorch and LightGBM, on whole corpora.

    cargo build --release && cargo build --release --example train_rows
    pip install numpy scikit-learn pyarrow torch lightgbm
    python scripts/time_to_error.py [--corpora quickstart,paper,mixed] [--budgets 1,2,5,10,30,100] [--seeds 1,2] [--jobs 1] [--settings RESULTS | --kept RESULTS] [--quick]

Everybody gets the same rows of whole training scenes and the same columns (those that `train` takes by default; of paper.yaml the listed ones,
neighbours as heights above the cell), standardised by these rows and clipped at 8, the other networks with their normal scores beside them where their search has it so
(marsyard's default forms its own), both classes weighing alike, one thread, and the CPU
seconds of the budget to learn in: user and system time of the learning alone; looks, reading and standardising are not counted. At each
budget an engine is judged by the look so far that is best on the validation scenes, and what is told is the error of *that* state on the
test scenes (of mixed.yaml: its held-out families): the weighted mean of (target - output)^2 with targets 0.1 and 0.9, which is what marsyard's
trainer lowers by default. Networks have two hidden layers of 16, but for those that say otherwise; what learns by log loss has its probability p judged as
0.1 + 0.8 p.

- marsyard: the default filter (Kronecker-factored, batches) with the default's two networks of 64-64 neurons (columns and their normal scores), with two of 16-16, with two of 64-64 of which one has
  rectified neurons (`network.activation: both`), by the logarithmic loss with and without these, and with one network of less than 600 weights, logistic or rectified as the search finds; and the Kalman filter with rows by their error, and exact (`rows: every`); all go on after their patience ends. Each is trained twice, looked
  at by the validation and by the test rows, which changes nothing that is learnt; the time is the first's.
- sklearn: MLPClassifier, Adam, batches of 200 and 1000.
- torch, fused Adam: constant rate; and one cycle (OneCycleLR), which knows its budget and is trained anew for each.
- torch, second-order: Muon on the matrices with Adam on the rest; SOAP (written here from Vyas et al. 2024, no library has it); L-BFGS (strong Wolfe) and SSBroyden (dense, in f64,
  strong Wolfe; written here from Urbán, Stefanou & Pons 2025, which no library has) on 20,000 or 100,000 rows.
- sklearn (batch 1000) and torch (Adam with one cycle, SOAP), less than 600 weights: a network of the same sizes on the same inputs.
- torch, two of 64-64: of the default's size and form, so that the trainer alone differs: two networks that learn the same batches, each as if it were alone, on
  columns and normal scores; their mean is the output, of an average of the weights that forgets all but the last ninth of the steps. Adam (fused; constant rate or one cycle,
  which the search finds better), and SOAP.
- LightGBM, as many trees as the budget holds, of several trainings the best look for each budget: with its defaults (31 leaves), of three rates; and regularised as in
  held_out.py (100 cells a leaf at least, L2 of 5, seven tenths of rows and columns for each tree), of 31 and 127 leaves and three rates, and of 31 leaves on 300,000 rows
  (and, of twice as many or more, on a million), of which a second grows more trees. After ten seconds a regularised
  one ends when its error on validation has not fallen for two thirds of its time, or is twice the best of those before it.

Rate, batch, activation and inputs of each network are the best by validation error of a search at 3 CPU seconds with seed 1; the search is not charged, nor made again
for longer budgets (--settings takes those of an earlier run, a quarter of the time saved).
--kept takes over what an earlier run measured on the same corpora; then the default learns each corpus once more for five seconds, which tells how fast the machine is beside then,
and is looked at five times as often.
The spread is the range over the seeds; a seed more may be of fewer budgets (--budgets), which the page says. Writes time_to_error.json, .md and .svg into scripts/results; what was measured before is kept by corpus,
engine and seed, so that an interrupted run goes on.
"""

import argparse
import concurrent.futures
import copy
import json
import multiprocessing
import os
import pathlib
import time

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "RAYON_NUM_THREADS"):
    os.environ[variable] = "1"

import lightgbm
import numpy as np
import torch

import study
from ablation import BEAMS, CURVATURE, OWN, PLANE, SQUARES
from compare_rows import Rows
from held_out import TREES
from timed_learners import HIDDEN, ONE_CYCLE, TARGETS, best, lbfgs, marsyard, marsyard_looks, minibatches, mlp_classifier, ssbroyden, thinned, trees
from train_rows import LISTED, NEIGHBOURS, Cells

SEARCH_S = 3.0
#: What --kept has learn once more, for how long, and rows from look to look: a fifth of those of its own row, whose looks lie half a second apart.
CALIBRATED, CALIBRATION_S, CALIBRATION_ROWS = "marsyard, default, two of 64-64", 5, 50_000
#: quickstart.yaml has squares of 0.2 and 0.4 m around, mixed.yaml one of 0.8 m besides, and beams in place of the curvature.
COLUMNS = {"quickstart": OWN + PLANE + CURVATURE + SQUARES[:8], "paper": LISTED, "mixed": OWN + PLANE + SQUARES + BEAMS}
#: Rows that are looked at, in whole scenes.
VALIDATION_ROWS, TEST_ROWS = 100_000, 200_000


def drawn(corpus, names):
    """Rows and labels to learn, to choose by and to judge by."""

    def of(split, count):
        cells = Cells(corpus, split, names)
        chosen = cells.whole_scenes(count, np.random.default_rng([5, count]))
        return cells.values[chosen].astype(np.float32), cells.labels[chosen]

    learn, validation, test = of("train", 0), of("validation", VALIDATION_ROWS), of("test", TEST_ROWS)
    # Rows lie scene after scene.
    order = np.random.default_rng(9).permutation(len(learn[1]))
    return tuple(part[order] for part in learn), validation, test


class Task:
    """Rows to learn, to choose by and to judge by, standardised by the first; with their normal scores beside them or without."""

    def __init__(self, splits, names, with_scores):
        parts = ["neighbours"] * (NEIGHBOURS[0] in names) + ["scores"] * with_scores
        self.names, self.rows = names, Rows(*splits, names, parts)
        self.x, self.labels, self.class_weights, self.weights = self.rows.x, self.rows.y, self.rows.class_weights, self.rows.weights
        self.looked = {"validation": (self.rows.choose_x, self.rows.choose_y), "test": (self.rows.judge_x, splits[2][1])}

    def error(self, split, outputs):
        labels = self.looked[split][1]
        weights = self.class_weights[labels]
        return float((weights * (TARGETS[labels] - outputs) ** 2).sum() / weights.sum())

    def look(self, cpu_s, outputs_of):
        """CPU seconds of learning, error on validation and on test."""
        return [round(cpu_s, 4), *(self.error(split, outputs_of(x)) for split, (x, _) in self.looked.items())]

    def without_test(self):
        """For searches, which never look at test scenes."""
        other = copy.copy(self)
        other.looked = {"validation": self.looked["validation"]}
        return other


#: Neurons of a network of less than 600 weights on columns and their normal scores, by the number of columns.
LESS_THAN_600 = {19: (12, 8), 14: (14, 10), 33: (8, 6)}


def less_than_600(task):
    return LESS_THAN_600[len(task.names)]


RELU, TANH = torch.nn.ReLU, torch.nn.Tanh
RATES = [(rate, batch, activation) for rate in (3e-3, 1e-2, 3e-2) for batch in (256, 1024) for activation in (RELU, TANH)]
#: Of networks of 64-64; Adam's of 16-16 were ReLU on all corpora. Of 0.03 with the other settings that were found the error on validation is higher after three seconds, but
#: for Adam on paper.yaml (by 2 % lower) and SOAP on mixed.yaml (by 1 %).
LARGE_RATES = [(rate, batch, activation) for rate in (1e-3, 3e-3, 1e-2) for batch in (256, 1024) for activation in (RELU, TANH)]
LARGE_ADAM = [(*setting, schedule) for schedule in ("constant", ONE_CYCLE) for setting in LARGE_RATES if setting[2] is RELU]
#: Rows (none: all) and settings of LightGBM.
BARE = [(None, {"learning_rate": rate}) for rate in (0.05, 0.1, 0.2)]
REGULARISED = [(rows, TREES | {"learning_rate": rate, "num_leaves": leaves})
               for rows, rate, leaves in [(300_000, 0.2, 31), (1_000_000, 0.2, 31), *((None, rate, leaves) for leaves in (31, 127) for rate in (0.2, 0.1, 0.05))]]
LOGARITHMIC = "{kronecker: {loss: logarithmic}}"
#: What learns, and the settings that the search tries.
ENGINES = {
    "marsyard, default, two of 64-64": (marsyard(250_000, filter="{kronecker: {}}"), [None]),
    "marsyard, default, two of 16-16": (marsyard(500_000, filter="{kronecker: {}}", **{"network.hidden": "[16,16]"}), [None]),
    "marsyard, one rectified, two of 64-64": (marsyard(250_000, filter="{kronecker: {}}", **{"network.activation": "both"}), [None]),
    "marsyard, logarithmic, two of 64-64": (marsyard(250_000, filter=LOGARITHMIC), [None]),
    "marsyard, logarithmic, one rectified, two of 64-64": (marsyard(250_000, filter=LOGARITHMIC, **{"network.activation": "both"}), [None]),
    "marsyard, less than 600 weights": (marsyard(250_000, less_than_600, filter="{kronecker: {}}", **{"network.members": 1}), ["logistic", "relu"]),
    "marsyard, Kalman filter": (marsyard(100_000, filter="{ekf: {}}"), [None]),
    "marsyard, Kalman, every row": (marsyard(50_000, **{"filter.ekf.rows": "every"}), [None]),
    "sklearn, batch 200": (mlp_classifier(200), [(rate, a) for rate in (1e-3, 3e-3, 1e-2) for a in ("relu", "tanh")]),
    "sklearn, batch 1000": (mlp_classifier(1000), [(rate, a) for rate in (3e-3, 1e-2, 3e-2) for a in ("relu", "tanh")]),
    "torch, Adam": (minibatches("Adam"), RATES),
    "torch, Adam, one cycle": (minibatches("Adam"), [(*setting, ONE_CYCLE) for setting in RATES]),
    "torch, SOAP": (minibatches("SOAP"), RATES),
    "torch, Muon": (minibatches("Muon"), RATES),
    "sklearn, batch 1000, less than 600 weights": (mlp_classifier(1000, less_than_600), [(rate, a) for rate in (3e-3, 1e-2, 3e-2) for a in ("relu", "tanh")]),
    "torch, Adam, one cycle, less than 600 weights": (minibatches("Adam", hidden=less_than_600), [(*setting, ONE_CYCLE) for setting in RATES]),
    "torch, SOAP, less than 600 weights": (minibatches("SOAP", hidden=less_than_600), RATES),
    "torch, L-BFGS": (lbfgs, [(rows, activation) for rows in (20_000, 100_000) for activation in (RELU, TANH)]),
    "torch, SSBroyden": (ssbroyden, [(rows, activation) for rows in (20_000, 100_000) for activation in (RELU, TANH)]),
    "torch, Adam, two of 64-64": (minibatches("Adam", members=True), LARGE_ADAM),
    "torch, SOAP, two of 64-64": (minibatches("SOAP", members=True), LARGE_RATES),
    "LightGBM, defaults": (trees(BARE, ends_early=False), [None]),
    "LightGBM, regularised": (trees(REGULARISED, ends_early=True), [None]),
}
#: They take the default's inputs.
MEMBERS = ("torch, Adam, two of 64-64", "torch, SOAP, two of 64-64")
#: Of one small network each, as marsyard's.
SMALL = tuple(engine for engine in ENGINES if engine.endswith("less than 600 weights"))
#: Networks, neurons of their layers and inputs a column, where an engine does not take what the search finds.
LAYOUTS = {
    "marsyard, default, two of 64-64": (2, (64, 64), 2),
    "marsyard, default, two of 16-16": (2, HIDDEN, 2),
    "marsyard, one rectified, two of 64-64": (2, (64, 64), 2),
    "marsyard, logarithmic, two of 64-64": (2, (64, 64), 2),
    "marsyard, logarithmic, one rectified, two of 64-64": (2, (64, 64), 2),
    "marsyard, Kalman filter": (1, HIDDEN, 1),
    "marsyard, Kalman, every row": (1, HIDDEN, 1),
    **{engine: (2, (64, 64), 2) for engine in MEMBERS},
}
#: Inputs of the networks that are searched.
INPUTS = ("standardised", "with normal scores")
#: For each the page says who errs less.
CLAIMED = ("marsyard, default, two of 64-64", "marsyard, default, two of 16-16", "marsyard, one rectified, two of 64-64", "marsyard, less than 600 weights")


def choices(engine):
    """What the search tries: inputs and settings."""
    settings = ENGINES[engine][1]
    # marsyard forms its own scores.
    forms = INPUTS[:1] if engine.startswith("marsyard") or len(settings) == 1 else INPUTS[1:] if engine in (*MEMBERS, *SMALL) else INPUTS
    return [(form, setting) for form in forms for setting in settings]


def measured(tasks, name, engine, seed, budgets, kept):
    """By budget: CPU seconds, error on validation and on test; `tasks` by inputs, `kept` holds what was found before."""
    learn, tried = ENGINES[engine][0], choices(engine)
    chosen = kept.setdefault("settings", {}).get(f"{name}/{engine}")
    if chosen is None:
        errors = [min((look[1] for look in learn(tasks[form].without_test(), SEARCH_S, 1, setting)), default=np.inf) if len(tried) > 1 else 0.0 for form, setting in tried]
        chosen = kept["settings"][f"{name}/{engine}"] = int(np.argmin(errors))
    form, setting = tried[chosen]
    task = tasks[form]
    if ONE_CYCLE in (setting or ()):
        return {str(budget): best(learn(task, budget, seed, setting), budget) for budget in budgets}
    looks = learn(task, max(budgets), seed, setting)
    return {str(budget): best(looks, budget) for budget in budgets}


#: Of the corpus in hand: read by the processes that are forked while it is.
TASKS = {}


def one(name, engine, seed, budgets, settings):
    """In a forked process: what was measured, and the settings that were found."""
    kept = {"settings": settings}
    return measured(TASKS, name, engine, seed, budgets, kept), kept["settings"]


def measure_all(tasks, name, seeds, budgets, kept, store, jobs):
    """Every engine with every seed that is not kept; of one engine one seed after the other, for the first one's search serves all. What fails is told
    when all else is stored."""
    TASKS.clear()
    TASKS.update(tasks)
    is_kept = lambda key: key in kept["runs"] and all(str(budget) in kept["runs"][key] for budget in budgets)
    # Trees take longest: they begin first.
    left = {engine: [seed for seed in seeds if not is_kept(f"{name}/{engine}/{seed}")] for engine in reversed(ENGINES)}
    with concurrent.futures.ProcessPoolExecutor(jobs, multiprocessing.get_context("fork")) as pool:
        running, failed = {}, []

        def begin_next(engine):
            if left[engine]:
                seed = left[engine].pop(0)
                running[pool.submit(one, name, engine, seed, budgets, dict(kept["settings"]))] = (engine, seed)

        for engine in left:
            begin_next(engine)
        while running:
            for done in concurrent.futures.wait(running, return_when=concurrent.futures.FIRST_COMPLETED).done:
                engine, seed = running.pop(done)
                if done.exception():
                    failed.append(f"{name}/{engine}/{seed}: {done.exception()}")
                    continue
                run, settings = done.result()
                kept["settings"].update(settings)
                kept["runs"][f"{name}/{engine}/{seed}"] = run
                kept.setdefault("dates", {})[f"{name}/{engine}/{seed}"] = time.strftime("%Y-%m-%d")
                store.write_text(json.dumps(kept))
                study.note(f"{name}/{engine}/{seed} " + str({budget: look and round(1000 * look[2], 2) for budget, look in run.items()}))
                begin_next(engine)
    if failed:
        raise SystemExit("\n".join(failed))


def weights(engine, columns, chosen):
    """Of the network that an engine learns; none of trees."""
    if engine.startswith("LightGBM"):
        return "-"
    searched = 1 + INPUTS.index(choices(engine)[chosen or 0][0])
    networks, hidden, inputs = (1, LESS_THAN_600[columns], 2) if engine in SMALL else LAYOUTS.get(engine, (1, HIDDEN, searched))
    sizes = [inputs * columns, *hidden, 1]
    return f"{networks * sum((a + 1) * b for a, b in zip(sizes[:-1], sizes[1:])):,}"


def median_and_range(runs, budget):
    """The median of those that had a look by then, and their range; how many they are, where others had none."""
    learnt = [run[str(budget)] for run in runs.values() if str(budget) in run]
    found = [1000 * look[2] for look in learnt if look]
    if not found:
        return "-"
    spread = f" ({min(found):.2f} to {max(found):.2f})" if len(found) > 1 else ""
    return f"{np.median(found):.2f}{spread}{f' ({len(found)} of {len(learnt)})' if len(found) < len(learnt) else ''}"


def markdown(about, kept, corpora, seeds):
    text = (f"# What error a CPU second buys\n\n`{about['command']}`, {about['marsyard']}, torch {torch.__version__.split('+')[0]}, LightGBM {lightgbm.__version__}; one thread each. "
            f"Weighted mean squared error on test scenes, thousandths; {'seed ' + str(seeds[0]) if len(seeds) == 1 else 'medians of seeds ' + ', '.join(map(str, seeds)) + ', ranges in brackets'}. What is compared, and how it is "
            f"counted, is said at the head of the script. CPU seconds of this machine, beside other work.\n")
    for name in corpora:
        of = about["corpora"][name]
        text += f"\n## {name}.yaml\n\n{of['rows']:,} rows of {of['scenes']} scenes to learn, {of['columns']} columns (corpus_id {of['corpus_id'][:12]}).{measured_when(kept, name, seeds)}{fewer_seeds(kept, name, seeds)}\n\n"
        text += table(kept, name, seeds, of["columns"]) + "\n\n" + calibration(kept, name)
        for engine in CLAIMED:
            text += f"Less than {engine}, {weights(engine, of['columns'], None)} weights, err at equal CPU (percent by which its error is above theirs):\n\n{ahead_of(kept, name, seeds, engine)}\n\n"
        settings = {engine: kept["settings"].get(f"{name}/{engine}") for engine, (_, all_of) in ENGINES.items() if len(all_of) > 1}
        text += ("Settings of an earlier search: " if about["settings"] else "Settings, of rows taken over those that they had: " if "again" in kept else "Settings found: ") + "; ".join(f"{engine}: {', '.join([readable(choices(engine)[k][1]), choices(engine)[k][0]])}" for engine, k in settings.items() if k is not None) + ".\n"
    return text


def measured_when(kept, name, seeds):
    """By seed the day on which most was measured, and what is of another."""
    told = []
    for seed in seeds:
        of = {}
        for engine in ENGINES:
            if date := kept.get("dates", {}).get(f"{name}/{engine}/{seed}"):
                of.setdefault(date, []).append(engine)
        if of:
            most = max(of, key=lambda date: len(of[date]))
            others = "".join(f"; but on {date}: {', '.join(repr(engine) for engine in of[date])}" for date in sorted(of) if date != most)
            told.append(f"Seed {seed} was measured on {most}{others}.")
    return "".join(f" {of}" for of in told)


def of_corpus(kept, name, seeds):
    """By engine: what was measured, by seed."""
    return {engine: {seed: run for seed in seeds if (run := kept["runs"].get(f"{name}/{engine}/{seed}"))} for engine in ENGINES}


def budgets_of(runs):
    """Those that anybody had."""
    return sorted({int(budget) for of in runs.values() for run in of.values() for budget in run})


def fewer_seeds(kept, name, seeds):
    """At which budgets not all engines learnt with all seeds."""
    runs, told = of_corpus(kept, name, seeds), []
    for budget in budgets_of(runs):
        of = {}
        for engine, by_seed in runs.items():
            of.setdefault(tuple(seed for seed, run in by_seed.items() if str(budget) in run), []).append(engine)
        most = max(of, key=lambda having: len(of[having]))
        if set(of) != {tuple(seeds)}:
            seeds_of = lambda having: f"seed{'s' * (len(having) > 1)} {', '.join(map(str, having))}" if having else "no seed"
            others = "".join(f"; of {seeds_of(having)}: {', '.join(map(repr, engines))}" for having, engines in of.items() if having != most)
            told.append(f" At {budget} CPU s rows are of {seeds_of(most)}{' alone' * (most != tuple(seeds))}{others}.")
    return "".join(told)


def calibration(kept, name):
    """What the default found when it learnt once more, by day."""
    return "".join(calibrated(kept, name, again) for again in kept.get("again", {}).get(name, []))


def calibrated(kept, name, again):
    """Looks after the same rows have all but the same errors (a look ends a batch), so that their CPU seconds can be compared."""
    former = {budget: look for budget, look in kept["runs"][f"{name}/{CALIBRATED}/{again['seed']}"].items() if int(budget) <= CALIBRATION_S}
    apart = lambda look, other: max(abs(look[k] / other[k] - 1) for k in (1, 2))
    after_same_rows = again["looks"][::250_000 // CALIBRATION_ROWS]
    nearest = [(look, min(after_same_rows, key=lambda other: apart(look, other))) for look in former.values() if look]
    ratios = [other[0] / look[0] for look, other in nearest if apart(look, other) < 3e-3]
    errors = [best(thinned(again["looks"], int(budget)), int(budget)) for budget in former]
    return (f"{CALIBRATED}, once more on {again['date']}, beside other work as the rows of that day, and looked at every {CALIBRATION_ROWS:,} rows in place of 250,000: "
            f"{', '.join(f'{1000 * look[2]:.2f}' for look in errors)} at {', '.join(former)} CPU s{f'; the same rows took {np.median(ratios):.2f} times the CPU seconds' if ratios else ''}.\n\n")


def ahead_of(kept, name, seeds, engine):
    """By budget: which peers err less than this engine, the least first; medians over the seeds with which both had a look."""
    runs, found = of_corpus(kept, name, seeds), []
    errors = lambda other, budget: {seed: run[str(budget)][2] for seed, run in runs[other].items() if run.get(str(budget))}
    for budget in budgets_of({engine: runs[engine]}):
        own, peers = errors(engine, budget), []
        for other in ENGINES:
            common = own.keys() & errors(other, budget).keys()
            if not other.startswith("marsyard") and common:
                of_own, of_other = (np.median([errors(which, budget)[seed] for seed in common]) for which in (engine, other))
                peers.append((of_own / of_other, other))
        told = "; ".join(f"{other} {100 * (ratio - 1):.1f}" for ratio, other in sorted(peers, reverse=True) if ratio > 1) or "no peer"
        asked = sum(str(budget) in run for run in runs[engine].values())
        lacking = f" (in {asked - len(own)} of {asked} trainings it had no look by then, which are left out)" if own and len(own) < asked else ""
        found.append(f"- {budget} CPU s{lacking}: {told if own else 'it had no look by then'}.")
    return "\n".join(found)


def table(kept, name, seeds, columns):
    """A row an engine, a column a budget that anybody had."""
    of = of_corpus(kept, name, seeds)
    budgets = budgets_of(of)
    rows = [[engine, weights(engine, columns, kept["settings"].get(f"{name}/{engine}")), *(median_and_range(runs, budget) for budget in budgets)] for engine, runs in of.items()]
    return study.markdown(["learnt by", "weights", *(f"{budget} CPU s" for budget in budgets)], rows)


def readable(setting):
    parts = setting if isinstance(setting, tuple) else (setting,)
    return ", ".join(part.__name__ if isinstance(part, type) else f"{part:g}" if not isinstance(part, str) else part for part in parts)


def chart(kept, corpora, seeds, path):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.ticker import MaxNLocator, ScalarFormatter

    figure, axes = plt.subplots(1, len(corpora), figsize=(5.2 * len(corpora) + 2.4, 4.4), squeeze=False, layout="constrained")
    colours = [*plt.get_cmap("tab20").colors, *plt.get_cmap("tab20b").colors[::4]]
    # Of the default's size: told from all others at a glance.
    dark = dict(zip(MEMBERS, ("black", "crimson")))
    for axis, name in zip(axes[0], corpora):
        of = of_corpus(kept, name, seeds)
        budgets = budgets_of(of)
        for k, (engine, runs) in enumerate(of.items()):
            looks = {budget: [1000 * run[str(budget)][2] for run in runs.values() if run.get(str(budget))] for budget in budgets}
            points = [(budget, np.median(errors)) for budget, errors in looks.items() if errors]
            if points:
                is_own = engine.startswith("marsyard")
                width, dash = 2.2 if is_own else 1.1, "--" if engine.startswith("LightGBM") else ":" if engine in dark else "-"
                axis.plot(*zip(*points), marker="o", ms=3, lw=1.8 if engine in dark else width, ls=dash, color=dark.get(engine, colours[k]), label=engine)
        lowest = min(line.get_ydata().min() for line in axis.lines)
        highest = max(line.get_ydata().max() for line in axis.lines)
        axis.set(xscale="log", yscale="log", title=f"{name}.yaml", xlabel="CPU seconds of learning", ylabel="weighted error on test scenes, thousandths")
        # What errs twice as much is cut off: a peer that has hardly begun would squeeze all others together.
        axis.set_ylim(0.97 * lowest, min(2 * lowest, 1.03 * highest))
        axis.set_xticks(budgets, map(str, budgets))
        axis.minorticks_off()
        axis.yaxis.set_major_locator(MaxNLocator(8))
        axis.yaxis.set_major_formatter(ScalarFormatter())
        axis.grid(True, which="both", lw=0.3)
    # All corpora have the first one's engines, or fewer.
    figure.legend(*axes[0][0].get_legend_handles_labels(), loc="outside right upper", fontsize=8)
    figure.savefig(path, metadata={"Date": None})


def begun_with(earlier, settings):
    """What is measured goes beside it; what no engine has any more is left out."""
    if earlier:
        by_engine = {key: {of: found for of, found in earlier.get(key, {}).items() if of.split("/")[1] in ENGINES} for key in ("runs", "settings", "dates")}
        return by_engine | {"again": earlier.get("again", {})}
    return {"runs": {}, "settings": json.loads(settings.read_text())["settings"] if settings else {}}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--corpora", default="quickstart,paper,mixed")
    parser.add_argument("--scenes", default=0, type=int, help="of each corpus (default: all of the config's)")
    parser.add_argument("--budgets", default="1,2,5,10,30,100")
    parser.add_argument("--seeds", default="1,2")
    parser.add_argument("--settings", type=pathlib.Path, help="time_to_error.json of an earlier run, whose settings are taken instead of a search")
    parser.add_argument("--kept", type=pathlib.Path, help="time_to_error.json of an earlier run on the same corpora: what it measured is not measured again, its settings are taken")
    parser.add_argument("--jobs", default=1, type=int, help="engines that learn at the same time, each on one thread (default 1); what memory bounds then learns less in a CPU second")
    study.add_arguments(parser, "time_to_error")
    options = parser.parse_args()
    corpora, budgets = options.corpora.split(","), [int(part) for part in options.budgets.split(",")]
    seeds = [int(seed) for seed in options.seeds.split(",")]
    if options.quick:
        options.scenes, budgets, seeds = options.scenes or 60, [1, 2], [1]
        options.work, options.out = options.work / "quick", options.work / "quick"
    runner = study.Marsyard(options.marsyard, options.work, options.threads)
    store = pathlib.Path(options.work) / "kept.json"
    earlier = json.loads(options.kept.read_text()) if options.kept else None
    kept = json.loads(store.read_text()) if store.exists() else begun_with(earlier, options.settings)
    named = {key: getattr(options, key) for key in ("corpora", "budgets", "seeds", "jobs")}
    asked = [f"--{key} {value}" for key, value in named.items() if value != parser.get_default(key)]
    asked += [f"--{key} {value}" for key in ("settings", "kept") if (value := getattr(options, key))]
    about = {"command": " ".join(["python scripts/time_to_error.py", *asked]), "marsyard": runner.version(), "settings": options.settings and str(options.settings), "corpora": {}}
    for name in corpora:
        config = study.ROOT / "configs" / f"{name}.yaml"
        sizes = [f"scenes={options.scenes}", f"scenes_per_shard={max(1, options.scenes // 20)}"] if options.scenes else []
        place = runner.work / "corpora" / name
        if not (place / "manifest.json").exists():
            study.note(f"generate {name}")
            runner.run("generate", config, "--out", place, "--threads", options.threads, *(word for key in sizes for word in ("--set", key)))
        manifest = json.loads((place / "manifest.json").read_text())
        if earlier and earlier["about"]["corpora"][name]["corpus_id"] != manifest["corpus_id"]:
            raise SystemExit(f"{options.kept} was measured on another corpus of {name}.yaml")
        splits = drawn(place, COLUMNS[name])
        tasks = {form: Task(splits, COLUMNS[name], form != INPUTS[0]) for form in INPUTS}
        task = tasks[INPUTS[0]]
        about["corpora"][name] = {"rows": len(task.labels), "columns": task.x.shape[1], "corpus_id": manifest["corpus_id"], "scenes": int(len(np.unique(Cells(place, "train", COLUMNS[name][:1]).scenes)))}
        measure_all(tasks, name, seeds, budgets, kept, store, options.jobs)
        if earlier:
            again, today = kept.setdefault("again", {}).setdefault(name, []), time.strftime("%Y-%m-%d")
            if not any(of["date"] == today for of in again):
                looked = marsyard_looks(task, CALIBRATION_S, seeds[0], CALIBRATION_ROWS, {"filter": "{kronecker: {}}"})
                again.append({"seed": seeds[0], "date": today, "looks": looked})
                store.write_text(json.dumps(kept))
    text = markdown(about, kept, corpora, seeds)
    out = options.out
    (out / "time_to_error.json").write_text(json.dumps({"about": about, **kept}, indent=1) + "\n")
    (out / "time_to_error.md").write_text(text)
    chart(kept, corpora, seeds, out / "time_to_error.svg")
    print(text)


if __name__ == "__main__":
    main()
