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
test scenes (of mixed.yaml: those of its held-out families): the weighted mean of (target - output)^2 with targets 0.1 and 0.9, which is what marsyard's
trainer lowers by the squared error, and PyTorch's networks too. Networks have two hidden layers of 16, but for those that say otherwise; what learns by log loss, as marsyard's default, scikit-learn and LightGBM do, has its probability p judged as
0.1 + 0.8 p.

- marsyard: the default filter (Kronecker-factored, batches) with the default's two networks of 64-64 neurons (columns and their normal scores), and with one of the two rectified (`network.activation: both`); by the squared error (*squared*) the same two,
  both rectified (`relu`: as Adam of that size has them on all three corpora, so that the trainer alone differs), two of 16-16, and one network of less than 600 weights, logistic or rectified as the search finds; and the Kalman filter with rows by their error, and exact (`rows: every`); all go on after their patience ends. Each is trained twice, looked
  at by the validation and by the test rows, which changes nothing that is learnt; the time is the first's.
- sklearn: MLPClassifier, Adam, batches of 200 and 1000.
- torch, fused Adam: constant rate; and one cycle (OneCycleLR), which knows its budget and is trained anew for each.
- torch, second-order: Muon on the matrices with Adam on the rest; SOAP (written here from Vyas et al. 2024, no library has it); L-BFGS (strong Wolfe) and SSBroyden (dense, in f64,
  strong Wolfe; written here from Urbán, Stefanou & Pons 2025, which no library has) on 20,000 or 100,000 rows.
- sklearn (batches of 200 and 1000) and torch (Adam with one cycle, SOAP), less than 600 weights: a network of the same sizes on the same inputs.
- torch, two of 64-64: of the default's size and form, by the squared error, neurons as the search finds: two networks that learn the same batches, each as if it were alone, on
  columns and normal scores; their mean is the output, of an average of the weights that forgets all but the last ninth of the steps. Adam (fused; constant rate or one cycle,
  which the search finds better), and SOAP.
- LightGBM, as many trees as the budget holds, of several trainings the best look for each budget: with its defaults (31 leaves), of three rates; and regularised as in
  held_out.py (100 cells a leaf at least, L2 of 5, seven tenths of rows and columns for each tree), of 31 and 127 leaves and three rates, and of 31 leaves on 300,000 rows
  (and, of twice as many or more, on a million), of which a second grows more trees. After ten seconds a regularised
  one ends when its error on validation has not fallen for two thirds of its time, or is twice the best of those before it.

What learns is in timed_engines.py, how in timed_learners.py, the page in timed_report.py. Rate, batch, activation and inputs of each network are the best by validation error of a search at 3 CPU seconds with seed 1; the search is not charged, nor made again
for longer budgets (--settings takes those of an earlier run, a quarter of the time saved).
--kept takes over the settings of an earlier run, and what it measured on the same rows; of corpora that are not among --corpora all of it. Where rows of a corpus were taken over, two of 64-64
by the squared error learn once more for five seconds, which tells how fast the machine is beside then.
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
from compare_rows import Rows, judged
from timed_engines import ENGINES, STANDARDISED, WITH_SCORES
from timed_learners import ONE_CYCLE, TARGETS, best, marsyard_looks
from timed_report import CALIBRATION_ROWS, CALIBRATION_S, chart, markdown
from train_rows import LISTED, NEIGHBOURS, SQUARED, Cells

SEARCH_S = 3.0
#: quickstart.yaml has squares of 0.2 and 0.4 m around, mixed.yaml one of 0.8 m besides, and beams in place of the curvature.
COLUMNS = {"quickstart": OWN + PLANE + CURVATURE + SQUARES[:8], "paper": LISTED, "mixed": OWN + PLANE + SQUARES + BEAMS}
#: Rows that are looked at, in whole scenes; of mixed.yaml more, for eight families have their say.
VALIDATION_ROWS, TEST_ROWS = 100_000, {"quickstart": 200_000, "paper": 200_000, "mixed": 400_000}


def drawn(corpus, name):
    """Rows and labels to learn, to choose by and to judge by."""

    def of(split, count):
        cells = Cells(corpus, split, COLUMNS[name])
        if split == "test":
            cells.keep(judged(corpus, corpus, cells.scenes))
        chosen = cells.whole_scenes(count, np.random.default_rng([5, count]))
        return cells.values[chosen].astype(np.float32), cells.labels[chosen]

    learn, validation, test = of("train", 0), of("validation", VALIDATION_ROWS), of("test", TEST_ROWS[name])
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


def measured(tasks, name, engine, seed, budgets, kept):
    """By budget: CPU seconds, error on validation and on test; `tasks` by inputs, `kept` holds what was found before."""
    learn, tried = ENGINES[engine].learn, ENGINES[engine].choices()
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


def begun_with(earlier, settings):
    """What is measured goes beside it; what no engine has any more is left out."""
    if earlier:
        by_engine = {key: {of: found for of, found in earlier.get(key, {}).items() if of.split("/")[1] in ENGINES} for key in ("runs", "settings", "dates")}
        return by_engine | {"again": earlier.get("again", {}), "judged_by": earlier["judged_by"]}
    return {"runs": {}, "settings": json.loads(settings.read_text())["settings"] if settings else {}}


def forget(kept, name):
    """What was measured of a corpus; not the settings that were found."""
    for key in ("runs", "dates"):
        kept[key] = {of: found for of, found in kept.get(key, {}).items() if of.split("/")[0] != name}
    kept.get("again", {}).pop(name, None)
    kept["judged_by"].pop(name)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--corpora", default="quickstart,paper,mixed")
    parser.add_argument("--scenes", default=0, type=int, help="of each corpus (default: all of the config's)")
    parser.add_argument("--budgets", default="1,2,5,10,30,100")
    parser.add_argument("--seeds", default="1,2")
    parser.add_argument("--settings", type=pathlib.Path, help="time_to_error.json of an earlier run, whose settings are taken instead of a search")
    parser.add_argument("--kept", type=pathlib.Path, help="time_to_error.json of an earlier run: what it measured on the same rows is not measured again, its settings are taken")
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
    command = study.command("time_to_error", parser, options, ("corpora", "budgets", "seeds", "jobs", "settings", "kept"))
    about = {"command": command, "marsyard": runner.version(), "torch": torch.__version__.split("+")[0], "lightgbm": lightgbm.__version__,
             "settings": options.settings and str(options.settings), "seeds": seeds, "corpora": {}}
    for name in corpora:
        sizes = [f"scenes={options.scenes}", f"scenes_per_shard={max(1, options.scenes // 20)}"] if options.scenes else []
        place = runner.shipped(name, sizes)
        manifest = json.loads((place / "manifest.json").read_text())
        splits = drawn(place, name)
        judged_by = [manifest["corpus_id"], len(splits[2][1])]
        of_earlier = earlier and earlier["judged_by"].get(name)
        if of_earlier and of_earlier != judged_by and kept["judged_by"].get(name) == of_earlier:
            forget(kept, name)
        if kept.setdefault("judged_by", {}).setdefault(name, judged_by) != judged_by:
            raise SystemExit(f"{options.kept or store} holds errors of {name}.yaml on other rows than these: give another --work, and no --kept")
        tasks = {form: Task(splits, COLUMNS[name], form == WITH_SCORES) for form in (STANDARDISED, WITH_SCORES)}
        task = tasks[STANDARDISED]
        about["corpora"][name] = {"rows": len(task.labels), "columns": task.x.shape[1], "corpus_id": manifest["corpus_id"], "scenes": int(len(np.unique(Cells(place, "train", COLUMNS[name][:1]).scenes))), "test_rows": len(splits[2][1])}
        measure_all(tasks, name, seeds, budgets, kept, store, options.jobs)
        if of_earlier == judged_by:
            again, today = kept.setdefault("again", {}).setdefault(name, []), time.strftime("%Y-%m-%d")
            if not any(of["date"] == today for of in again):
                looked = marsyard_looks(task, CALIBRATION_S, seeds[0], CALIBRATION_ROWS, SQUARED)
                again.append({"seed": seeds[0], "date": today, "looks": looked})
                store.write_text(json.dumps(kept))
    if earlier:
        # What was kept of others stands after what was measured.
        about["corpora"] |= {name: {"command": earlier["about"]["command"]} | of for name, of in earlier["about"]["corpora"].items() if name not in corpora}
        corpora = list(about["corpora"])
    text = markdown(about, kept, corpora, seeds)
    out = options.out
    (out / "time_to_error.json").write_text(json.dumps({"about": about, **kept}, indent=1) + "\n")
    (out / "time_to_error.md").write_text(text)
    chart(kept, corpora, seeds, out / "time_to_error.svg")
    print(text)


if __name__ == "__main__":
    main()
