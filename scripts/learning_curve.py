"""What more scenes teach: the error on each held-out family of configs/mixed.yaml against scenes and CPU seconds, for four learners.

Usage:  cargo build --release
        python scripts/learning_curve.py [--sizes 70,140,500,2000,8000,32000] [--seeds 1,2,3,4,5] [--test-seed 51] [--squared] [--quick]

Cuts configs/mixed.yaml to each size and trains on it: the default network; the Kalman filter's (configs/train/ekf.yaml, 16-16 neurons); a network
of three times the default's weights at the largest size but one (`--wide`); and trees (LightGBM) on the same columns, so that it is the yards
that are judged and not the trainer. Of these two the first seed alone, of the Kalman filter and of more than 8000 scenes the first two. Trees learn no more scenes
than hold the rows that they take. Beside them stand trees that learnt from the held-out families' own yards, of a third seed: what is left of their error is in the columns and labels, and no variety of other yards takes it away. All are judged
on one corpus of the held-out families alone, of another seed; see held_out.py for the intervals.

Needs numpy, pyarrow and lightgbm. Writes learning_curve.json and learning_curve.md into scripts/results; with --squared, by which the networks learn by the
squared error, learning_curve_squared.json and learning_curve_squared.md.
"""

import argparse
import json
import resource

import numpy as np

import held_out
import study
from transfer import outputs

OWN_SEED = 52
#: The Kalman filter's curve ends here, and beyond it a network is trained twice: ten minutes a training.
MOST_SCENES_OF_ALL_SEEDS = 8000
#: These hold the rows that trees take (held_out.MOST_CELLS): of more they learn the same.
MOST_SCENES_OF_TREES = 2000


def timed(folder, name, make, who=resource.RUSAGE_CHILDREN):
    """What `make` gives, and the CPU seconds it took, kept beside what it made."""
    before = study.cpu_s(who)
    made = make()
    kept = folder / f"{name}.cpu"
    if not kept.exists():
        kept.write_text(str(study.cpu_s(who) - before))
    return made, float(kept.read_text())


class Learners:
    """Trainings on corpora of one kind, judged on one test corpus."""

    def __init__(self, marsyard, test):
        self.marsyard, self.place, self.test = marsyard, test, None

    def network(self, name, corpus, seed, sets=()):
        run, seconds = timed(self.marsyard.work, f"train-{name}-{seed}", lambda: self.marsyard.train(name, [corpus], seed, sets))
        training = json.loads((run / "training.json").read_text())
        model = held_out.network(self.marsyard, run)
        if self.test is None:
            self.columns = model["about"]["features"]
            self.test = held_out.read(self.place, self.columns)
        facts = {"train_cpu_s": seconds, "rows_to_learn": training["train_rows"], "rows_learnt": training["rows_learnt"], "best_rows": training["best"]["rows"]}
        return facts, held_out.counts(self.test, outputs(model, self.test))

    def trees(self, corpus, seed):
        cells, validation = (held_out.read(corpus, self.columns, [split], most=held_out.MOST_CELLS) for split in ("train", "validation"))
        before = study.cpu_s(resource.RUSAGE_SELF)
        answer = held_out.trees(cells, validation, self.columns, seed)
        facts = {"train_cpu_s": study.cpu_s(resource.RUSAGE_SELF) - before, "rows_learnt": len(cells["label"])}
        return facts, held_out.counts(self.test, answer(self.test))


def row(first, of, judged):
    mean = lambda key: np.mean([facts[key] for facts in of["facts"]])
    rates = [held_out.told(judged.balanced(family)) for family in held_out.FAMILIES]
    return [*first, f"{mean('train_cpu_s'):.0f}", f"{mean('rows_learnt') * 1e-3:.0f}", held_out.told(judged.worst()),
            held_out.told(judged.mean()), *rates]


def kinds_of_error(judged):
    rows = [[family, f"{100 * of['missed_untraversable']:.1f}", f"{100 * of['false_untraversable']:.1f}"] for family, of in judged.facts().items()]
    return study.markdown(["family", "missed %", "false %"], rows)


def scaling(networks, generate_s):
    """What a row takes by the size of the corpus, and what 10^9 rows would by the largest: CPU = passes x rows x microseconds."""
    mean = lambda of, key: np.mean([facts[key] for facts in of["facts"]])
    rows = []
    for of in networks:
        to_learn, learnt, seconds = mean(of, "rows_to_learn"), mean(of, "rows_learnt"), mean(of, "train_cpu_s")
        rows.append([of["size"], f"{to_learn / 1e6:.2f}", f"{learnt / to_learn:.2f}", f"{1e6 * seconds / learnt:.2f}"])
    passes, a_row_s = learnt / to_learn, seconds / learnt
    scenes = 1e9 * of["size"] / to_learn
    return "\n\n".join([
        "## How it scales",
        study.markdown(["scenes", "rows to learn, millions", "passes", "CPU us a row learnt, all of a training"], rows),
        f"By the last row 10^9 rows, of {scenes:,.0f} scenes that take {scenes * generate_s[of['size']] / of['size'] / 3600:.1f} CPU hours to generate, are learnt in {1e9 * a_row_s / 3600:.2f} CPU hours a pass, "
        f"{passes:.2f} of which is {1e9 * passes * a_row_s / 3600:.2f}: extrapolated, to {1e9 / to_learn:.0f} times what was run."])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", default="70,140,500,2000,8000,32000")
    parser.add_argument("--seeds", default="1,2,3,4,5")
    parser.add_argument("--wide", default="128,128", help="hidden neurons of the larger network (default 128,128)")
    parser.add_argument("--test-scenes", default=560, type=int, help="of the test corpus (default 560)")
    parser.add_argument("--test-seed", default=51, type=int, help="seed of the test corpus (default 51); give another work folder with it")
    parser.add_argument("--squared", action="store_true", help="learn the networks by the squared error")
    study.add_arguments(parser, "learning_curve")
    options = parser.parse_args()
    sizes, seeds = [int(n) for n in options.sizes.split(",")], [int(n) for n in options.seeds.split(",")]
    test_scenes = options.test_scenes
    if options.quick:
        sizes, seeds, test_scenes = [70, 140], [1], 70
    marsyard = study.Marsyard(options.marsyard, options.work, options.threads)
    test = held_out.corpus(marsyard, "test", options.test_seed, test_scenes)
    corpora, generate_s = {}, {}
    for size in sizes:
        make = lambda: marsyard.corpus(f"mixed-{size}", held_out.CONFIG, [], size, held_out.PER_SHARD)
        corpora[size], generate_s[size] = timed(marsyard.work, f"generate-{size}", make)
    own = held_out.corpus(marsyard, "own", OWN_SEED, test_scenes)

    learners, found = Learners(marsyard, test), []

    def learn(learner, size, seeds, train):
        of = [train(seed) for seed in seeds]
        study.note(f"{learner}, {size} scenes: judged")
        found.append({"learner": learner, "size": size, "facts": [facts for facts, _ in of], "counts": [counted for _, counted in of]})

    loss, mark = (study.SQUARED, "squared-") if options.squared else ([], "")
    for size in sizes:
        learn("network", size, seeds if size <= MOST_SCENES_OF_ALL_SEEDS else seeds[:2], lambda seed: learners.network(f"{mark}{size}", corpora[size], seed, loss))
    for size in (size for size in sizes if size <= MOST_SCENES_OF_ALL_SEEDS):
        learn("Kalman filter", size, seeds[:2], lambda seed: learners.network(f"ekf-{size}", corpora[size], seed, study.KALMAN_FILTER))
    wide = [*loss, f"network.hidden=[{options.wide}]"]
    learn("larger network", sizes[-2], seeds[:1], lambda seed: learners.network(f"{mark}wide-{sizes[-2]}", corpora[sizes[-2]], seed, wide))
    for size in (size for size in sizes if size <= MOST_SCENES_OF_TREES):
        learn("trees", size, seeds[:1], lambda seed: learners.trees(corpora[size], seed))
    learn("trees, own yards", test_scenes, seeds[:1], lambda seed: learners.trees(own, seed))

    for of in found:
        of["judged"] = held_out.Judgement(learners.test, of["counts"])
    generated = lambda of: "-" if "own" in of["learner"] else f"{generate_s[of['size']]:.0f}"
    first = lambda of: [of["learner"], of["size"], generated(of)]
    head = ["learner", "scenes", "CPU s, generate", "CPU s, train", "rows learnt, thousands", "worst family", "mean of families", *held_out.FAMILIES]
    networks = [of for of in found if of["learner"] == "network"]
    steps = [[f"{one['size']} to {other['size']} scenes", held_out.told_difference(other["judged"].worst(), one["judged"].worst()),
              held_out.told_difference(other["judged"].mean(), one["judged"].mean())] for one, other in zip(networks, networks[1:])]
    text = "\n\n".join([
        "# What more scenes teach about yards of other families",
        f"`{study.command('learning_curve', parser, options, ('sizes', 'seeds', 'wide', 'test-scenes', 'test-seed', 'squared'))}`, {study.versions(marsyard)['marsyard']}; networks by {'the squared error' if options.squared else 'default'}, {len(seeds)} trainings each, {len(seeds[:2])} of more than {MOST_SCENES_OF_ALL_SEEDS} scenes and of the Kalman filter (up to as many scenes), one of the others; trees of {MOST_SCENES_OF_TREES} scenes at most, which hold all rows that they take. Balanced accuracy by cells, percent, "
        f"with 95 % intervals over scenes and trainings. Test: {test_scenes} scenes of the held-out families alone, seed {options.test_seed}. CPU seconds "
        "of this machine, beside other work.",
        study.markdown(head, [row(first(of), of, of["judged"]) for of in found]),
        "## What each step brings the network, points",
        study.markdown(["", "worst family", "mean of families"], steps),
        f"## Kinds of error, network, {sizes[-1]} scenes",
        kinds_of_error(networks[-1]["judged"]),
        scaling(networks, generate_s)]) + "\n"
    runs = [{"learner": of["learner"], "size": of["size"], "facts": of["facts"], "families": of["judged"].facts()} for of in found]
    results = {"versions": study.versions(marsyard), "generate_cpu_s": generate_s, "test_seed": options.test_seed, "runs": runs}
    study.write_results(options.out, f"learning_curve{'_squared' if options.squared else ''}", results, text)


if __name__ == "__main__":
    main()
