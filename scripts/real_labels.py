"""How far people's labels of real scans teach, beside simulated yards: trees that learnt the same columns of labelled places.

Usage:  cargo build --release
        python scripts/real_labels.py --data FOLDER [--seeds 1,2,3] [--quick]

FOLDER, the scans, their cells and how places are judged: as of real_scans.py, whose work folder it takes with what lies there.

What goes in: the default network of 2000 scenes of configs/mixed.yaml and trees (LightGBM, as held_out.py has them) of 400, which saw no label of a person; and trees of
people's labels: of the other sites; of 1, 2, 4 and all other places of the same site, drawn by chance for each place that is judged; and of
all of these with simulated cells, half of the weight each. Every place, and in it both classes, weigh the same, as the measure has it. No judged place is among those that
are learnt, nor is another recording of its spot, nor a stretch of the street beside it: others are 44 m away at least, and cells reach 15 m.

Trees of labelled places have no place left to end their training by. The number of their rounds is the one of ROUNDS that errs least on the very places that are judged,
on campus and streets together, which is in their favour; their other settings are those of the trees of simulated yards, and nothing else was tuned.

What comes out: balanced accuracy at 0.5 by site, with intervals of 95 % over spots and trainings and differences in pairs, and the mean area under the ROC curve. That places which are
judged teach one another is not in the intervals. Labels of the same site teach more than its ground: its sensor, and where these people let a hedge end.

Needs numpy, pyarrow, pyyaml, lightgbm, scikit-learn and scipy. Writes real_labels.json and real_labels.md into scripts/results.
"""

import argparse
import concurrent.futures
import multiprocessing
import pathlib

import lightgbm
import numpy as np
import sklearn

import held_out
import study
from doubt import Network
from real_scans import AREA, BALANCED, FALSE, MISSED, Learner, Places, default_of, run_name
from transfer import outputs

ROUNDS = [25, 50, 100, 200, 400]
SOME = [1, 2, 4]
#: Cells of a place that trees learn from, drawn by chance: a scan's neighbours tell nearly the same; and simulated cells beside them.
MOST_OF_PLACE, MOST_SIMULATED = 10_000, 100_000


class Labelled:
    """The cells of all places, and simulated ones, as trees take them."""

    def __init__(self, places, cells, simulated, columns):
        self.kinds, self.spots, self.place, self.label = np.array(places.kinds), np.array(places.spots), cells["place"], cells["label"]
        self.columns, self.simulated, self.of_simulated = held_out.table(cells, columns), held_out.table(simulated, columns), simulated["label"]

    def same_site(self, place):
        """Places of the site that share nothing with this one."""
        near = 2 if self.kinds[place] == "streets" else 1
        same = np.flatnonzero((self.kinds == self.kinds[place]) & (self.spots != self.spots[place]))
        return [other for other in same if abs(other - place) >= near]

    def other_sites(self, place):
        return list(np.flatnonzero(self.kinds != self.kinds[place]))

    def scores(self, learnt, judged, seed, with_simulated):
        """What trees of the places `learnt` say of the cells of those judged, by number of rounds."""
        rng = np.random.default_rng([seed, *learnt])
        chosen = [rng.permutation(np.flatnonzero(self.place == place))[:MOST_OF_PLACE] for place in learnt]
        weight = np.concatenate([balanced(self.label[of]) / len(learnt) for of in chosen])
        chosen = np.concatenate(chosen)
        columns, label = self.columns[chosen], self.label[chosen]
        if with_simulated:
            some = rng.permutation(len(self.of_simulated))[:MOST_SIMULATED]
            columns, label = np.concatenate([columns, self.simulated[some]]), np.concatenate([label, self.of_simulated[some]])
            weight = np.concatenate([weight, balanced(self.of_simulated[some])])
        settings = dict(objective="binary", **held_out.TREES, num_threads=1, seed=seed, verbose=-1)
        cells = lightgbm.Dataset(columns, label=label, weight=weight * len(label) / weight.sum(), params=settings)
        model = lightgbm.train(settings, cells, max(ROUNDS))
        at = np.isin(self.place, judged)
        return np.stack([model.predict(self.columns[at], num_iteration=rounds, num_threads=1).astype(np.float32) for rounds in ROUNDS])


#: Of the study, for the processes that learn.
labelled = None


def scores_of(task):
    return labelled.scores(*task)


def balanced(labels):
    """Weights whose sum is 1, half of it each class's."""
    untraversable = labels == 1
    return np.where(untraversable, 0.5 / max(untraversable.sum(), 1), 0.5 / max((~untraversable).sum(), 1))


class Judged:
    """A learner's figures at each site where it judges: those of all places, or of the sites with several."""

    def __init__(self, places, cells, scores, number, sites, rounds=None):
        self.rounds, self.learners = rounds, {}
        for site in sites:
            judged = [place for place, kind in enumerate(places.kinds) if kind == site]
            self.learners[site] = Learner(places, cells, scores, number, judged)

    def facts(self):
        return {"rounds": self.rounds, "sites": {site: {"balanced_accuracy": float(learner.mean()[0]), "missed_untraversable": float(learner.mean(MISSED)[0]),
                                                        "false_untraversable": float(learner.mean(FALSE)[0]), "area": float(learner.mean(AREA)[0]),
                                                        "places": [float(rate) for rate in learner.measures[:, learner.judged, BALANCED].mean(axis=0)]}
                                                 for site, learner in self.learners.items()}}


class Study:
    def __init__(self, places, cells, seeds, threads):
        self.places, self.cells, self.seeds, self.threads, self.judged = places, cells, seeds, threads, {}
        self.sites = list(dict.fromkeys(places.kinds))
        self.several = [site for site in self.sites if places.kinds.count(site) > 1]

    def add(self, name, scores, sites, rounds=None):
        self.judged[name] = Judged(self.places, self.cells, scores, len(self.judged), sites, rounds)

    def trees(self, name, learnt_for, sites, with_simulated=False):
        """Trees of the places that `learnt_for` gives for a place, learnt once for all places with the same."""
        study.note(f"trees: {name}")
        tasks = {}
        for number, seed in enumerate(self.seeds):
            rng = np.random.default_rng([2, seed])
            for place, kind in enumerate(self.places.kinds):
                if kind in sites:
                    tasks.setdefault((number, tuple(sorted(learnt_for(place, rng)))), []).append(place)
        scores = np.full((len(self.seeds), len(ROUNDS), len(self.cells["place"])), np.nan, dtype=np.float32)
        with concurrent.futures.ProcessPoolExecutor(self.threads, multiprocessing.get_context("fork")) as pool:
            found = pool.map(scores_of, [(learnt, judged, self.seeds[number], with_simulated) for (number, learnt), judged in tasks.items()])
            for ((number, _), judged), of in zip(tasks.items(), found):
                scores[number][:, np.isin(self.cells["place"], judged)] = of
        several = [place for place, kind in enumerate(self.places.kinds) if kind in self.several]
        accuracy = [Learner(self.places, self.cells, scores[:, rounds], 0, several).mean()[0] for rounds in range(len(ROUNDS))]
        best = int(np.argmax(accuracy))
        self.add(name, scores[:, best], sites, ROUNDS[best])


def main():
    global labelled
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", required=True, type=pathlib.Path, help="folder of the scans: scripts/real_scans.yaml says what lies there")
    parser.add_argument("--seeds", default="1,2,3")
    study.add_arguments(parser, "real_scans")
    options = parser.parse_args()
    seeds, (few, many) = [int(n) for n in options.seeds.split(",")], (400, 2000)
    if options.quick:
        seeds, few, many = seeds[:1], 70, 140
    marsyard = study.Marsyard(options.marsyard, options.work, options.threads)
    places = Places(marsyard, options.data, options.quick)
    corpora = {scenes: marsyard.corpus(f"mixed-{scenes}", held_out.CONFIG, [], scenes, held_out.PER_SHARD) for scenes in (few, many)}
    runs = [marsyard.train(run_name(default_of(many)), [corpora[many]], seed) for seed in seeds]
    networks = [Network(marsyard, run) for run in runs]
    columns = list(networks[0].about["features"])
    cells = places.cells(runs[0].name, runs[0])
    simulated, validation = (held_out.read(corpora[few], columns, [split], most=held_out.MOST_CELLS) for split in ("train", "validation"))
    labelled = Labelled(places, cells, simulated, columns)
    made = Study(places, cells, seeds, options.threads)

    network, simulated_trees = f"simulated yards alone, {many} scenes: network", f"simulated yards alone, {few} scenes: trees"
    made.add(network, [outputs(one.exported, cells) for one in networks], made.sites)
    made.add(simulated_trees, [held_out.trees(simulated, validation, columns, seed)(cells) for seed in seeds], made.sites)
    other_sites, same_site = lambda place, _: labelled.other_sites(place), lambda place, _: labelled.same_site(place)
    made.trees("labels of the other three sites", other_sites, made.sites)
    made.trees("labels of the other three sites, and simulated yards", other_sites, made.sites, with_simulated=True)
    for count in SOME:
        some = lambda place, rng: rng.choice(labelled.same_site(place), count, replace=False)
        made.trees(f"labels of {count} place{'s' if count > 1 else ''} of the same site", some, made.several)
    made.trees("labels of all other places of the same site", same_site, made.several)
    made.trees("labels of all other places of the same site, and simulated yards", same_site, made.several, with_simulated=True)

    first, rows = made.judged[network], []
    for name, of in made.judged.items():
        row = [name, of.rounds or ""]
        for site in made.several:
            learner, base = of.learners[site], first.learners[site]
            row += [held_out.told(learner.mean()), "" if of is first else held_out.told_difference(learner.mean(), base.mean()), f"{100 * learner.mean(AREA)[0]:.1f}"]
        rows.append(row + [f"{100 * of.learners[site].mean()[0]:.1f}" if site in of.learners else "" for site in made.sites if site not in made.several])
    head = ["learnt from", "rounds", *(title for site in made.several for title in (site, "less the first", "area")), *(site for site in made.sites if site not in made.several)]
    text = f"""# People's labels of real scans beside simulated yards

`python scripts/real_labels.py --data FOLDER`, {marsyard.version()}. {len(seeds)} trainings each; balanced accuracy at 0.5 and area under the ROC curve, percent, means over places; intervals of 95 %
over spots and trainings, differences in points. What is compared, and how, stands at the head of the script. Trees of labels have up to {MOST_OF_PLACE:,} cells of a place, and the rounds that err least on what
is judged.

{study.markdown(head, rows)}
"""
    results = {"versions": study.versions(marsyard, np, lightgbm, sklearn), "seeds": seeds, "scenes": [few, many], "learners": {name: of.facts() for name, of in made.judged.items()}}
    study.write_results(options.out, "real_labels", results, text)


if __name__ == "__main__":
    main()
