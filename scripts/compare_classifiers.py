#!/usr/bin/env python3
"""marsyard's networks (the trainer's default, and the Kalman filter's) beside other classifiers on equal inputs: few rows and all, on three kinds of yard.

    cargo build --release && cargo build --release --example train_rows
    pip install numpy scipy scikit-learn pyarrow matplotlib lightgbm xgboost catboost torch onnxruntime
    python scripts/compare_classifiers.py [--only paper|mixed|mars] [--kept RESULTS] [--quick]

Everybody is given the same: the columns that `marsyard train` takes by default, read off a model of it; the same training rows (small: whole
scenes of about 20,000 rows, other scenes for each seed; full: all, of mixed and mars some 300,000 drawn from all scenes), class weights, standardised and cut at 8; the same validation rows,
drawn from all validation scenes, to stop training by, to choose the form of the columns by (compare_rows.py: each form is tried for each
classifier on the small rows of seed 1, the form of the best balanced accuracy is kept; at full size the better of the two best, both learnt on all rows
with seed 1) and to choose the threshold by (best balanced accuracy). Nothing is ever chosen on test rows, which are drawn from all test scenes. How each classifier is set: compare_models.py.

Corpora are configs/paper.yaml; configs/mixed.yaml, judged on another seed's corpus, family by held-out family, led by the worst; configs/mars.yaml.
Intervals are 95 % of 2000 resamples of the test scenes and of the seeds, which stand for other rows to learn (small) and other trainings; the same resamples for all, so that
differences to the default network are paired. Five seeds each; so few make intervals somewhat too narrow. CPU seconds and microseconds are of one thread.

Before anything is compared, the measures are held against scikit-learn's, and the scores of a network in onnxruntime, judged by the measures,
against `marsyard evaluate`. What was made lies in the work folder, task by task, and is not made again: give another one after a change.

--kept takes over what an earlier run measured of classifiers: those that it lacks are run, and the default network again, whose counts by seed and by scene must be the earlier
ones (else trainer or corpora are others). CPU seconds are then of two days, and libraries of the earlier.

Writes compare_classifiers.json and compare_classifiers.md into scripts/results; --figure draws the balanced accuracies.
"""

import argparse
import dataclasses
import hashlib
import json
import multiprocessing
import os
import pathlib
import sys
import time

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "RAYON_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import catboost
import lightgbm
import numpy as np
import onnxruntime
import sklearn
import torch
import xgboost

import compare_measures as measures
import compare_report
import study
from compare_models import CLASSIFIERS, OWN_SCORES, SMALL_ALONE
from compare_rows import Corpus, forms
from train_rows import DEFAULT_NETWORK, NETWORK, SQUARED_NETWORK, Cells

CONFIGS = study.ROOT / "configs"


@dataclasses.dataclass
class Yard:
    """A corpus of the study; `test_seed` where another seed's corpus gives the test scenes. Rows are at most so many, 0 all."""

    config: str
    scenes: int
    per_shard: int
    full_rows: int = 0
    test_seed: int | None = None
    test_scenes: int = 0
    validation_rows: int = 40_000
    test_rows: int = 100_000


#: Rows are drawn from all scenes alike: mars has some 49,000 a scene, so that without it there would be too few scenes.
YARDS = {
    "paper": Yard("paper.yaml", 1000, 50),
    "mixed": Yard("mixed.yaml", 400, 10, full_rows=300_000, test_seed=99, test_scenes=1000, test_rows=150_000),
    "mars": Yard("mars.yaml", 200, 10, full_rows=300_000),
}


#: marsyard's networks, and what sets them. All take normal scores: those by batches by themselves, the Kalman filter because its best form has them.
NETWORKS = {DEFAULT_NETWORK: [], SQUARED_NETWORK: study.SQUARED, NETWORK: [*study.KALMAN_FILTER, "network.normal_scores=true"]}


def folders(marsyard, name, yard):
    """The corpus, and the one that is judged on."""
    corpus = marsyard.corpus(name, CONFIGS / yard.config, [], yard.scenes, yard.per_shard)
    if yard.test_seed is None:
        return corpus, corpus
    return corpus, marsyard.corpus(f"{name}-test", CONFIGS / yard.config, [f"seed={yard.test_seed}"], yard.test_scenes, yard.per_shard)


def check_networks(marsyard, name, place, test_place):
    """The columns that the trainer takes by default, and what models of them weigh; their scores by onnxruntime are `evaluate`'s."""
    checks = {of: check_network(marsyard, f"check-{name}-{''.join(filter(str.isalpha, of))}", sets, place, test_place) for of, sets in NETWORKS.items()}
    names = checks[DEFAULT_NETWORK][0]
    if any(other != names for other, _ in checks.values()):
        sys.exit(f"{name}: the networks take different columns: {[other for other, _ in checks.values()]}")
    return names, {of: check for of, (_, check) in checks.items()}


def check_network(marsyard, run_name, sets, place, test_place):
    run = marsyard.train(run_name, [place], 1, [*sets, "epochs=1", "patience=1"])
    told = marsyard.evaluate(run, test_place, "test")
    onnx = run / "model.onnx"
    if not onnx.exists():
        marsyard.run("export", run, "--onnx", onnx)
    names = told["model"]["features"]
    cells = Cells(test_place, "test", names)
    session = onnxruntime.InferenceSession(str(onnx), providers=["CPUExecutionProvider"])
    outputs = np.concatenate([session.run(["untraversable"], {"features": part})[0][:, 0] for part in np.array_split(cells.values, 1 + len(cells.values) // 50_000)])
    found = measures.rates({kind: sum(of) for kind, of in measures.scene_counts(cells.labels, outputs >= 0.5, np.zeros(len(outputs), int), 1).items()})
    group = told["groups"][0]["network"]
    theirs = {"auc": group["auc"], "balanced_accuracy": group["at"][0]["cells"]["balanced_accuracy"]}
    ours = {"auc": measures.area_under_roc(cells.labels, outputs), "balanced_accuracy": found["balanced_accuracy"]}
    for measure, value in ours.items():
        # A row whose output lies within f32 of the threshold may fall on either side.
        if abs(value - theirs[measure]) > 1e-5:
            sys.exit(f"{run}: {measure} is {value} by onnxruntime and {theirs[measure]} by `marsyard evaluate`")
    return names, {"rows": len(outputs), "differences": {k: abs(ours[k] - theirs[k]) for k in ours}, "bytes": (run / "model.safetensors").stat().st_size}


def one(task):
    """A classifier on one choice of rows. Only validation rows are judged where forms are tried."""
    name, classifier, form, seed, many, trial = task
    kept = OPTIONS.work / "tasks" / f"{hashlib.sha256(json.dumps([task, TASK_KEY]).encode()).hexdigest()[:16]}.json"
    if kept.exists():
        return json.loads(kept.read_text())
    rows = CORPUS.rows(form, seed, 0 if many else OPTIONS.rows)
    if trial:
        rows.judge_x, rows.stored[2] = rows.judge_x[:0], rows.stored[2][:0]
    fitted = CLASSIFIERS[classifier](rows, seed, many)
    threshold, balanced = measures.best_threshold(rows.choose_y, fitted.choose)
    run = {"corpus": name, "classifier": classifier, "form": form, "seed": seed, "full": many, "train_rows": len(rows.y), "cpu_s": fitted.cpu_s,
           "rounds": fitted.rounds, "threshold": threshold, "validation_balanced_accuracy": balanced}  # fmt: skip
    if not trial:
        labels = CORPUS.test.labels
        run |= {"judge_us": fitted.judge_us, "parameters": fitted.parameters, "bytes": fitted.bytes, "auc": measures.area_under_roc(labels, fitted.judge)}
        run["scenes"] = measures.scene_counts(labels, fitted.judge >= threshold, CORPUS.scene, len(CORPUS.scenes))
        if fitted.probabilities:
            weights = measures.balanced_weights(labels)
            run["log_loss"] = float(np.average(measures.losses(labels, fitted.judge), weights=weights))
            run["calibration_error"] = measures.calibration_error(labels, fitted.judge, weights)
    kept.parent.mkdir(parents=True, exist_ok=True)
    kept.write_text(json.dumps(run))
    return run


def all_of(tasks):
    """Done by all jobs, the dearest first; forked, so that the rows are held once."""
    with multiprocessing.get_context("fork").Pool(OPTIONS.jobs, maxtasksperchild=1) as pool:
        runs = []
        for run in pool.imap_unordered(one, tasks):
            runs.append(run)
            size = "full" if run["full"] else "small"
            study.note(f"{run['corpus']}, {len(runs)} of {len(tasks)}: {run['classifier']}, {size}, {run['form']}, seed {run['seed']}, {run['cpu_s']:.1f} s")
    return runs


def compared(name, classifiers):
    """All runs on a corpus, and what trials of forms gave: all on few rows, the two best of each classifier on all."""
    tried = lambda classifier: [form for form, parts in forms(CORPUS.names).items() if classifier not in OWN_SCORES or "scores" not in parts]
    score = lambda run: run["validation_balanced_accuracy"]
    order = list(forms(CORPUS.names))
    best_first = lambda runs, classifier: [run["form"] for run in sorted((run for run in runs if run["classifier"] == classifier), key=lambda run: (-score(run), order.index(run["form"])))]
    trials = all_of([(name, classifier, form, 1, False, True) for classifier in classifiers for form in tried(classifier)])
    of_all = [classifier for classifier in classifiers if classifier not in SMALL_ALONE]
    # Judged like any other run, for one of the two is of those that are told; the choice looks at validation rows alone.
    finals = all_of([(name, classifier, form, 1, True, False) for classifier in of_all for form in best_first(trials, classifier)[:2]])
    small, full = ([(name, classifier, best_first(found, classifier)[0], seed, many, False) for classifier in among for seed in range(1, OPTIONS.seeds + 1)]
                   for many, found, among in ((False, trials, classifiers), (True, finals, of_all)))
    return trials + [{key: value for key, value in run.items() if key != "scenes"} for run in finals], all_of(full + small)


def told(run):
    """A run as results keep it: counts of the test scenes as a line each, from which all rates and intervals follow."""
    return run | {"scenes": {kind: " ".join(map(str, of)) for kind, of in run["scenes"].items()}}


def counted(run):
    """The same with counts as numbers."""
    return run | {"scenes": {kind: [int(count) for count in of.split()] for kind, of in run["scenes"].items()}}


def is_of_earlier_state(found):
    """Whether results of a corpus are of other networks, or without counts by scene."""
    return set(found["about"].get("networks", ())) != set(NETWORKS) or any("scenes" not in run for run in found["runs"])


def kept_beside(kept, trials, runs):
    """What an earlier run measured of the classifiers that this one did not run, before what this one measured."""
    earlier = [counted(run) for run in kept["runs"]]
    of_default = lambda of: {(run["full"], run["seed"]): run["scenes"] for run in of if run["classifier"] == DEFAULT_NETWORK}
    if of_default(earlier) != of_default(runs):
        sys.exit(f"{OPTIONS.kept}: the default network called other cells untraversable then: trainer or corpus is another")
    measured = {run["classifier"] for run in runs}
    lacking = lambda of: [one for one in of if one["classifier"] not in measured]
    return lacking(kept["trials"]) + trials, lacking(earlier) + runs


def main():
    global OPTIONS, CORPUS, TASK_KEY
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", choices=YARDS, help="one of the corpora; the others keep what the work folder holds of them")
    parser.add_argument("--kept", type=pathlib.Path, help="compare_classifiers.json of an earlier run: what classifiers it has are not run again, but for the default network")
    parser.add_argument("--rows", type=int, default=20_000, help="small: training rows, at least, in whole scenes (default 20,000)")
    parser.add_argument("--seeds", type=int, default=5, help="so many (default 5)")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--figure", type=pathlib.Path, help="also draw the balanced accuracies here (PNG or SVG)")
    study.add_arguments(parser, "compare_classifiers")
    OPTIONS = parser.parse_args()
    if OPTIONS.quick:
        OPTIONS.seeds, OPTIONS.rows, OPTIONS.work = 1, 5000, OPTIONS.work / "quick"
        for yard in YARDS.values():
            yard.scenes, yard.test_scenes, yard.validation_rows, yard.test_rows, yard.full_rows = 40, 140 if yard.test_seed else 0, 5000, 10_000, 20_000
            yard.per_shard = 5
    checked = measures.check_on_scikit_learn()
    earlier = json.loads(OPTIONS.kept.read_text()) if OPTIONS.kept else {}
    kept = earlier.get("corpora", {})
    if any(map(is_of_earlier_state, kept.values())):
        sys.exit(f"{OPTIONS.kept} is of an earlier state of this script, of other networks or without counts by scene: run all anew")
    marsyard = study.Marsyard(OPTIONS.marsyard, OPTIONS.work, OPTIONS.threads)
    for name, yard in YARDS.items():
        if OPTIONS.only in (None, name):
            place, test_place = folders(marsyard, name, yard)
            names, networks = check_networks(marsyard, name, place, test_place)
            CORPUS = Corpus(name, place, test_place, names, yard)
            about = {"config": yard.config, "scenes": yard.scenes} | CORPUS.about() | {"networks": networks}
            TASK_KEY = [about, OPTIONS.rows]
            measured = {line["classifier"] for line in kept[name]["summary"]} if name in kept else set()
            trials, runs = compared(name, [of for of in CLASSIFIERS if of == DEFAULT_NETWORK or of not in measured])
            # A file of marsyard's is weighed only where it takes the form that the table tells of.
            weighed = {(of, form): network["bytes"] for of, network in networks.items() for form, parts in forms(names).items() if of in OWN_SCORES or "scores" in parts}
            if name in kept:
                trials, runs = kept_beside(kept[name], trials, runs)
                weighed = {(line["classifier"], line["form"]): line["bytes"] for line in kept[name]["summary"] if line["classifier"] in networks} | weighed
            found = compare_report.summary(runs, CORPUS.families, weighed)
            (OPTIONS.work / f"{name}.json").write_text(json.dumps({"about": about, "summary": found, "trials": trials, "runs": [told(run) for run in runs]}))
    finished = kept | {name: json.loads((OPTIONS.work / f"{name}.json").read_text()) for name in YARDS if (OPTIONS.work / f"{name}.json").exists()}
    if former := [name for name, found in finished.items() if is_of_earlier_state(found)]:
        sys.exit(f"{OPTIONS.work} holds results of an earlier state of this script ({', '.join(former)}): give another --work")
    versions = study.versions(marsyard, np, sklearn, lightgbm, xgboost, catboost, torch, onnxruntime)
    results = {"versions": versions, "check_on_scikit_learn": checked, "corpora": finished}
    if kept:
        measured = {line["classifier"] for found in kept.values() for line in found["summary"]}
        again = [DEFAULT_NETWORK, *(of for of in CLASSIFIERS if of not in measured)]
        results["versions"] = earlier["versions"]
        results["added"] = [*earlier.get("added", []), {"classifiers": again, "date": time.strftime("%Y-%m-%d")}]
    study.write_results(OPTIONS.out, "compare_classifiers", results, compare_report.tables(results))
    if OPTIONS.figure:
        compare_report.figure(finished, OPTIONS.figure)


if __name__ == "__main__":
    main()
