#!/usr/bin/env python3
"""What a split by cell flatters: classifiers that learnt random cells of few scenes, judged on other cells of these scenes and on test scenes.

    python scripts/compare_splits.py [--seeds 3]

Corpus, columns, settings and, of each classifier, the form of its small rows are those of scripts/results/compare_classifiers.json. For each seed, whole scenes of configs/paper.yaml are drawn until they hold enough; 70 % of their cells are learnt, 15 % stop training and choose
the threshold, 15 % are judged. The same models and thresholds are judged on the test scenes of compare_classifiers.py. The paper does not say by
what it split. Writes compare_splits.json and compare_splits.md into scripts/results.
"""

import argparse
import json
import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "RAYON_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import numpy as np

import compare_measures as measures
import study
from compare_classifiers import YARDS, folders
from compare_models import CLASSIFIERS
from compare_rows import Corpus, Rows, forms
from train_rows import NETWORK

JUDGED = [NETWORK, "fine Gaussian SVM", "fine KNN", "complex tree", "LightGBM"]


def by_cell(corpus, form, seed, learnt):
    """Rows of one seed; held-out cells first among those that are judged, and their labels."""
    cells = corpus.train
    drawn = cells.whole_scenes(learnt * 100 // 70, np.random.default_rng([1, seed]))
    drawn = np.random.default_rng([3, seed]).permutation(drawn)[: learnt * 100 // 70]
    learn, choose, held = np.split(drawn, [learnt, learnt + learnt * 15 // 70])
    pair = lambda rows: (cells.values[rows], cells.labels[rows])
    judge = (np.concatenate([cells.values[held], corpus.test.values]), None)
    return Rows(pair(learn), pair(choose), judge, corpus.names, forms(corpus.names)[form]), cells.labels[held]


def judged(corpus, classifier, form, seed, learnt):
    rows, held = by_cell(corpus, form, seed, learnt)
    fitted = CLASSIFIERS[classifier](rows, seed, False)
    threshold, _ = measures.best_threshold(rows.choose_y, fitted.choose)
    called = fitted.judge >= threshold
    told = {"classifier": classifier, "form": form, "seed": seed}
    for place, labels, part in (("held_out_cells", held, called[: len(held)]), ("test_scenes", corpus.test.labels, called[len(held):])):
        counts = measures.scene_counts(labels, part, np.zeros(len(labels), int), 1)
        told[place] = measures.rates({kind: sum(of) for kind, of in counts.items()})["balanced_accuracy"]
    study.note(f"{classifier}, seed {seed}: {told}")
    return told


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rows", type=int, default=20_000, help="cells to learn (default 20,000)")
    parser.add_argument("--seeds", type=int, default=3)
    study.add_arguments(parser, "compare_classifiers")
    options = parser.parse_args()
    if options.quick:
        options.seeds, options.rows = 1, 3000
    found = json.loads((study.RESULTS / "compare_classifiers.json").read_text())["corpora"]["paper"]
    form = {line["classifier"]: line["form"] for line in found["summary"] if line["size"] == "small"}
    marsyard = study.Marsyard(options.marsyard, options.work, options.threads)
    corpus = Corpus("paper", *folders(marsyard, "paper", YARDS["paper"]), found["about"]["columns"], YARDS["paper"])
    if corpus.about() != {part: found["about"][part] for part in corpus.about()}:
        raise SystemExit("compare_classifiers.json is of another corpus of paper.yaml: python scripts/compare_classifiers.py --only paper")
    runs = [judged(corpus, name, form[name], seed, options.rows) for name in JUDGED for seed in range(1, options.seeds + 1)]
    rows = []
    for name in JUDGED:
        of = [run for run in runs if run["classifier"] == name]
        spread = lambda value: study.percent_spread(study.mean_spread([value(run) for run in of]))
        rows.append([name, spread(lambda run: run["held_out_cells"]), spread(lambda run: run["test_scenes"]),
                     spread(lambda run: run["held_out_cells"] - run["test_scenes"])])
    text = "\n\n".join([
        "# What a split by cell flatters",
        f"`python scripts/compare_splits.py`, {study.versions(marsyard)['marsyard']}; {options.rows:,} random cells of few scenes learnt, mean ± standard deviation over "
        f"{options.seeds} seeds. Corpus {found['about']['test']['corpus_id'][:12]}.",
        study.markdown(["balanced accuracy %", "held-out cells of the same scenes", "test scenes", "flattered by"], rows)]) + "\n"
    study.write_results(options.out, "compare_splits", {"versions": study.versions(marsyard), "runs": runs}, text)


if __name__ == "__main__":
    main()
