"""Where the errors lie on families held out: the cells that a network gets wrong, by what truly is there.

Usage:  cargo build --release
        python scripts/anatomy.py [--scenes 2000] [--seeds 1,2] [--test-seed 51] [--quick]

Trains the default network on configs/mixed.yaml cut to so many scenes and judges the held-out families, on the corpora and by the runs of
learning_curve.py where its work folder is given. Untraversable cells are sorted by what made them so, traversable ones by what they hold and
what stands beside them. Each family weighs alike: shares are means over the families, and the last column adds up to the mean of what is missed,
and of what is called an obstacle falsely. Beside the network stand trees (LightGBM) on the same columns: what both get wrong is in the
columns and labels, what the trees alone get right is the network's.

Needs numpy, pyarrow and lightgbm. Writes anatomy.json and anatomy.md into scripts/results.
"""

import argparse

import numpy as np

import held_out
import study
from transfer import outputs

TRUTH = ["scene_id", "row", "col", "points", "truth_class", "truth_slope_rad", "truth_obstacle_points"]
ROCK, BOX, TRUNK, GRASS, BUSH = 1, 2, 3, 4, 5


def beside_an_obstacle(cells):
    """Whether one of the eight cells around is untraversable."""
    key = lambda rows, cols: (cells["scene_id"].astype(np.int64) << 40) + ((cells["row"].astype(np.int64) + rows + (1 << 19)) << 20) + cells["col"] + cols + (1 << 19)
    barred = np.sort(key(0, 0)[cells["label"] == 1])
    found = np.zeros(len(cells["label"]), bool)
    for rows in (-1, 0, 1):
        for cols in (-1, 0, 1):
            if (rows, cols) != (0, 0) and len(barred):
                there = key(rows, cols)
                found |= barred[np.minimum(np.searchsorted(barred, there), len(barred) - 1)] == there
    return found


def kinds(cells):
    """By name, which untraversable and which traversable cells are of it; the first that fits."""
    kind, slope, beside = cells["truth_class"], np.degrees(cells["truth_slope_rad"]), beside_an_obstacle(cells)
    obstacle, one = cells["truth_obstacle_points"] > 0, cells["points"] == 1
    untraversable = {
        "ground steeper than 45 degrees alone": ~obstacle,
        "a cell of one point on a rock, box or trunk": one & (kind <= TRUNK),
        "a cell of one point in a bush or crown": one,
        "rock": kind == ROCK, "box or wall": kind == BOX, "trunk": kind == TRUNK, "bush or crown": kind >= BUSH,
    }
    traversable = {
        "rock or box lower than a wheel, or in part": np.isin(kind, [ROCK, BOX, TRUNK]),
        "grass beside an obstacle": (kind == GRASS) & beside, "grass": kind == GRASS,
        "ground beside an obstacle": beside, "ground of 25 to 45 degrees": slope > 25, "a cell of one point of other ground": one, "other ground": np.ones(len(kind), bool),
    }
    first = {}
    for label, named in ((1, untraversable), (0, traversable)):
        rest = cells["label"] == label
        first[label] = {}
        for name, of in named.items():
            first[label][name], rest = rest & of, rest & ~of
        assert not rest.any()
    return first


def by_kind(cells, named, wrong):
    """By kind, its share of the cells of the label, and what its wrong ones add to the error, for each of `wrong`; means over families."""
    family = cells["family_of_scene"][cells["scene"]]
    of_label = np.logical_or.reduce(list(named.values()))
    weight = np.zeros(len(family))
    for k in np.unique(family):
        mine = (family == k) & of_label
        weight[mine] = 1 / max(mine.sum(), 1)
    weight /= len(np.unique(family))
    found = {}
    for name, of in named.items():
        adds = [weight[of & (called != cells["label"])].sum() for called in wrong]
        found[name] = {"share": weight[of].sum(), "adds": adds}
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", default=2000, type=int)
    parser.add_argument("--seeds", default="1,2")
    parser.add_argument("--test-scenes", default=560, type=int, help="of the test corpus (default 560)")
    parser.add_argument("--test-seed", default=51, type=int, help="seed of the test corpus (default 51)")
    study.add_arguments(parser, "learning_curve")
    options = parser.parse_args()
    scenes, seeds, test_scenes = options.scenes, [int(seed) for seed in options.seeds.split(",")], options.test_scenes
    if options.quick:
        scenes, seeds, test_scenes = 70, [1], 70
    marsyard = study.Marsyard(options.marsyard, options.work, options.threads)
    learnt = marsyard.corpus(f"mixed-{scenes}", held_out.CONFIG, [], scenes, held_out.PER_SHARD)
    test = held_out.corpus(marsyard, "test", options.test_seed, test_scenes)
    networks = [held_out.network(marsyard, marsyard.train(str(scenes), [learnt], seed)) for seed in seeds]
    columns = networks[0]["about"]["features"]
    cells = held_out.read(test, [*columns, *TRUTH])
    called = [(outputs(network, cells) >= 0.5).astype(int) for network in networks]
    study.note("trees")
    train, validation = (held_out.read(learnt, columns, [split], most=held_out.MOST_CELLS) for split in ("train", "validation"))
    trees = held_out.trees(train, validation, columns, seeds[0])
    of_trees = [(trees(cells) >= 0.5).astype(int)]
    parts, results = [], {}
    for label, named in kinds(cells).items():
        network, others = (by_kind(cells, named, wrong) for wrong in (called, of_trees))
        percent = lambda value: f"{100 * value:.2f}"
        rows = [[name, f"{100 * of['share']:.1f}", f"{100 * np.mean(of['adds']) / max(of['share'], 1e-12):.1f}", percent(np.mean(of["adds"])),
                 percent(np.mean(others[name]["adds"]))] for name, of in network.items()]
        sums = [sum(np.mean(of["adds"]) for of in found.values()) for found in (network, others)]
        rows.append(["all", "100.0", f"{100 * sums[0]:.1f}", *map(percent, sums)])
        title = "Untraversable cells that are missed" if label else "Traversable cells that are called untraversable"
        head = ["what is there", "% of them", "% wrong", "adds to the error, points", "of trees, points"]
        parts += [f"## {title}", study.markdown(head, rows)]
        results[title] = {"network": network, "trees": others}
    text = "\n\n".join([
        "# Where the errors lie on families held out",
        f"`python scripts/anatomy.py`, {study.versions(marsyard)['marsyard']}; {scenes} scenes of mixed.yaml, {len(seeds)} trainings; {test_scenes} scenes of the held-out "
        f"families, seed {options.test_seed}; means over the eight families. The first kind that fits counts.", *parts]) + "\n"
    study.write_results(options.out, "anatomy", {"versions": study.versions(marsyard), "kinds": results}, text)


if __name__ == "__main__":
    main()
