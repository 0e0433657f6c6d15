"""What each ingredient of configs/mixed.yaml brings on families that training never had: left out one by one.

Usage:  cargo build --release
        cargo build --release --example train_rows
        python scripts/ablation.py [--scenes 140] [--seeds 1,2,3] [--only columns|forms|yards|families|frames] [--quick]

- columns: left out of what the network learns, from one corpus;
- forms: heights above other percentiles of the ground around in place of the plane fitted to it; and the count's logarithm or the standard deviation of the heights in place
  of what is stored, of rows in memory, beside the same rows as they are stored;
- yards: parts of the yards and of the measuring, left out of a corpus each;
- families: each family of training is left out of a corpus, whose networks are judged on the held-out families and on the one left out;
- frames: networks of cells in the estimated pose's frame and in that of a fitted plane, each judged on the same scenes in both.

All networks have the default settings. Differences to "all of it" are paired; for the intervals see held_out.py. A corpus without a part
holds, beside that part, for one draw of the training scenes.

Needs numpy and pyarrow. Writes ablation.json and ablation.md into scripts/results; of `--only` the other parts' tables are left as they are.
"""

import argparse
import json

import numpy as np

import held_out
import study
from compare_rows import written
from train_rows import DEFAULT, Cells, train
from transfer import outputs

CURVATURE = [f"curvature_{which}_{cm}cm_m" for cm in (20, 40, 80) for which in ("least", "most")]
BEAMS_OF_CELL = ["beams_through", "beams_through_high"] + [f"beams_{what}_m" for what in ("lowest", "behind", "behind_height", "before", "before_height")]
BEAMS_OF_SQUARES = [f"beams_{what}_{cm}cm" for cm in (10, 20, 40) for what in ("through", "through_low", "through_high")]
BEAMS = BEAMS_OF_CELL + BEAMS_OF_SQUARES
SQUARES = [f"surroundings_{what}_{cm}cm{unit}" for cm in (20, 40, 80)
           for what, unit in (("height", "_m"), ("roughness", "_m"), ("spread", "_m"), ("cover", ""))]
OWN = ["height_variance_m2", "height_difference_m", "point_count"]
LOCAL, PLANE = ["local_height_m"], ["plane_height_m", "plane_slope"]
NEIGHBOURS = ["mean_height_m"] + [f"neighbour_{way}_m" for way in ("sw", "s", "se", "w", "e", "nw", "n", "ne")]
POSE = ["pitch_rad", "roll_rad", "sigma_z_m", "sigma_roll_rad", "sigma_pitch_rad"]

# What the network learns, where that is not the default.
COLUMNS = {
    "the paper's columns (features: listed)": None,
    "no beams": OWN + PLANE + SQUARES,
    "no beams of the cell itself": OWN + PLANE + SQUARES + BEAMS_OF_SQUARES,
    "no beams of the squares around": OWN + PLANE + SQUARES + BEAMS_OF_CELL,
    "no squares around, nor of beams": OWN + PLANE + BEAMS_OF_CELL,
    "no squares of heights 0.8 m around": OWN + PLANE + SQUARES[:8] + BEAMS,
    "no plane": OWN + SQUARES + BEAMS,
    "no spread, difference and count of the cell": PLANE + SQUARES + BEAMS,
    "and the height above a percentile of the ground": OWN + LOCAL + PLANE + SQUARES + BEAMS,
    "and heights above the rover and the neighbours": OWN + NEIGHBOURS + PLANE + SQUARES + BEAMS,
    "and the curvature": OWN + PLANE + SQUARES + BEAMS + CURVATURE,
    "and pitch, roll and the standard deviations": OWN + PLANE + SQUARES + BEAMS + POSE,
}
# The corpora of this part hold what is no longer in the config, too.
WITH_CURVATURE = ["cells.curvature={radii_m: [0.2, 0.4, 0.8]}"]
# What the height of a cell is told above, in place of the plane fitted to the ground around.
GROUND = {f"above the {percentile}th percentile within {radius_m} m": [f"cells.local_height={{radius_m: {radius_m}, percentile: {percentile}, plane: true}}"]
          for percentile, radius_m in ((10, 1), (50, 1), (10, 0.5), (10, 2))}
# How columns are written before they are standardised.
STORED = "as stored"
FORMS = {STORED: (), "log of the count": ("count",), "standard deviation": ("spread",), "both": ("count", "spread")}
# Overrides of the config for the training scenes.
YARDS = {
    "no roughness": ["scene.ground.roughness=null"],
    "no landforms": ["scene.ground.features=[]", "families.5.scene.ground.features=[]", "families.6.scene.ground.features=[]"],
    "no grass": ["scene.vegetation.grass=null", "families.2.scene.vegetation.grass=null"],
    "no dropout": ["sweep.effects.dropout=null"],
    "no excavations": ["families.6.weight=1e-9"],
    # What brought nothing, and is no longer in the config.
    "and brush and range bias and quantisation": ["families.3.scene.vegetation.brush={count: {uniform: [0, 4]}, radius_m: {uniform: [0.3, 1]}, sigma_m: {uniform: [0.1, 0.4]}}",
                                                 "sweep.effects.range_bias_m={uniform: [0, 0.02]}", "sweep.effects.quantisation={}"],
    "and FastSLAM in place of dead reckoning": ["slam={fastslam: {particles: 100}}"],
}
LEFT_OUT = list(enumerate(held_out.TRAINING))
FRAMES = {"estimated pose": [], "fitted plane": ["cells.frame=fitted_plane"]}
TEST_SEED = 51
PARTS = ["columns", "forms", "yards", "families", "frames"]


class Study:
    """Networks and what they say of test corpora, which are read once."""

    def __init__(self, marsyard, scenes, seeds, test_scenes):
        self.marsyard, self.scenes, self.seeds, self.test_scenes = marsyard, scenes, seeds, test_scenes
        self.whole = marsyard.corpus("whole", held_out.CONFIG, [], scenes, held_out.PER_SHARD)
        self.read = {}

    def test(self, name):
        if name not in self.read:
            make = {"held out": lambda: held_out.corpus(self.marsyard, "test", TEST_SEED, self.test_scenes, WITH_CURVATURE),
                    "fitted plane": lambda: held_out.corpus(self.marsyard, "test-plane", TEST_SEED, self.test_scenes, FRAMES["fitted plane"]),
                    "training": lambda: held_out.corpus_of_training(self.marsyard, "test-training", TEST_SEED, self.test_scenes)}
            of_ground = lambda: held_out.corpus(self.marsyard, folder("test " + name), TEST_SEED, self.test_scenes, GROUND[name])
            self.read[name] = held_out.read(make.get(name, of_ground)(), OWN + LOCAL + NEIGHBOURS + POSE + PLANE + SQUARES + BEAMS + CURVATURE * (name == "held out"))
        return self.read[name]

    def judged(self, name, corpus, sets=(), test="held out", families=held_out.FAMILIES):
        cells, counts = self.test(test), []
        for seed in self.seeds:
            model = held_out.network(self.marsyard, self.marsyard.train(name, [corpus], seed, sets))
            counts.append(held_out.counts(cells, outputs(model, cells)))
        return held_out.Judgement(cells, counts, families)

    def in_memory(self, parts):
        """Networks of the default's columns, written in a form."""
        names, cells, counts = OWN + PLANE + SQUARES + BEAMS, self.test("held out"), []
        of = lambda split: (lambda rows: (written(rows.values, names, parts), rows.labels))(Cells(self.whole, split, names))
        learnt, stopped_by, judged = of("train"), of("validation"), written(np.stack([cells[name] for name in names], axis=1), names, parts)
        for seed in self.seeds:
            study.note(f"train in memory, {', '.join(parts) or STORED}, seed {seed}")
            [scores], _ = train(learnt, stopped_by, [judged], {"seed": seed, **DEFAULT}, names=names)
            counts.append(held_out.counts(cells, scores))
        return held_out.Judgement(cells, counts)

    def all_of_it(self):
        return self.judged("all of it", self.whole)

    def without(self, name, sets):
        return self.marsyard.corpus(folder(name), held_out.CONFIG, sets, self.scenes, held_out.PER_SHARD)


def folder(name):
    return name.replace(" ", "-")


def table(whole, judged, of_whole="all of it"):
    """By name: worst family and mean, their differences to the whole, and all families."""
    head = ["", "worst family", "difference", "mean of families", "difference", *held_out.FAMILIES]
    difference = lambda of, part: "" if of is whole else held_out.told_difference(part(of), part(whole))
    row = lambda name, of: [name, held_out.told(of.worst()), difference(of, held_out.Judgement.worst), held_out.told(of.mean()),
                            difference(of, held_out.Judgement.mean), *(f"{100 * of.balanced(family)[0]:.1f}" for family in held_out.FAMILIES)]
    return study.markdown(head, [row(name, of) for name, of in {of_whole: whole, **judged}.items()])


def columns(of):
    sets = lambda taken: "features=listed" if taken is None else f"features={{columns: [{', '.join(taken)}]}}"
    whole = of.without("with curvature", WITH_CURVATURE)
    judged = {name: of.judged(name, whole, [sets(taken)]) for name, taken in COLUMNS.items()}
    return "## Columns\n\n" + table(of.all_of_it(), judged), judged


def forms(of):
    learnt = f"features={{columns: [{', '.join(OWN + LOCAL + SQUARES + BEAMS)}]}}"
    grounds = {name: of.judged(name, of.without(name, sets), [learnt], test=name) for name, sets in GROUND.items()}
    in_memory = {name: of.in_memory(parts) for name, parts in FORMS.items()}
    stored = in_memory.pop(STORED)
    text = "## Forms\n\n" + table(of.all_of_it(), grounds) + "\n\nOf the same rows in memory:\n\n" + table(stored, in_memory, STORED)
    return text, {**grounds, STORED: stored, **in_memory}


def yards(of):
    judged = {name: of.judged(name, of.without(name, sets)) for name, sets in YARDS.items()}
    return "## Yards and measuring\n\n" + table(of.all_of_it(), judged), judged


def families(of):
    judged, rows = {}, []
    for k, family in LEFT_OUT:
        name = f"no {family} in training"
        corpus = of.without(name, [f"families.{k}.weight={held_out.NONE}"])
        judged[name] = of.judged(name, corpus)
        left_out, learnt = (of.judged(run, place, test="training", families=[family]) for run, place in ((name, corpus), ("all of it", of.whole)))
        rows.append([family, held_out.told(learnt.mean()), held_out.told(left_out.mean()), held_out.told_difference(left_out.mean(), learnt.mean())])
    text = ("## Families of training, on the held-out families\n\n" + table(of.all_of_it(), judged)
            + "\n\n## Families of training, each judged on yards of its own kind of another seed\n\n"
            + study.markdown(["family", "in training", "left out of training", "difference"], rows))
    return text, judged


def frames(of):
    judged, rows = {}, []
    for learnt, sets in FRAMES.items():
        name = "all of it" if not sets else "fitted plane"
        corpus = of.whole if not sets else of.without(name, sets)
        both = [of.judged(name, corpus, test=test) for test in ("held out", "fitted plane")]
        judged.update({f"learnt in {learnt}, judged in {test}": one for test, one in zip(FRAMES, both)})
        rows.append([learnt, *(held_out.told(part(one)) for one in both for part in (held_out.Judgement.worst, held_out.Judgement.mean))])
    head = ["learnt in the frame of", *(f"{part}, judged in {frame}" for frame in FRAMES for part in ("worst family", "mean"))]
    return "## Frames\n\n" + study.markdown(head, rows) + "\n\nThe family unseen_frame is levelled by a fitted plane in both.", judged


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", default=140, type=int)
    parser.add_argument("--seeds", default="1,2,3")
    parser.add_argument("--test-scenes", default=560, type=int, help="of each test corpus (default 560)")
    parser.add_argument("--only", choices=PARTS, help="one of the parts")
    study.add_arguments(parser, "ablation")
    options = parser.parse_args()
    seeds, scenes, test_scenes = [int(n) for n in options.seeds.split(",")], options.scenes, options.test_scenes
    if options.quick:
        seeds, scenes, test_scenes = [1], 70, 70
        for ingredients in (COLUMNS, YARDS, GROUND):
            for name in list(ingredients)[1:]:
                del ingredients[name]
        del LEFT_OUT[1:]
    marsyard = study.Marsyard(options.marsyard, options.work, options.threads)
    of = Study(marsyard, scenes, seeds, test_scenes)
    kept = options.out / "ablation.json"
    parts = json.loads(kept.read_text())["parts"] if options.only and kept.exists() else {}
    for part in [options.only] if options.only else PARTS:
        told = f"{study.versions(marsyard)['marsyard']}; {scenes} scenes, {len(seeds)} trainings each by default."
        text, judged = {"columns": columns, "forms": forms, "yards": yards, "families": families, "frames": frames}[part](of)
        head, rest = text.split("\n\n", 1)
        parts[part] = {"text": f"{head}\n\n{told}\n\n{rest}", "rates": {name: one.facts() for name, one in judged.items()}}
    title = "\n\n".join([
        "# What each ingredient of mixed.yaml brings on families held out",
        "`python scripts/ablation.py`. Balanced accuracy by cells, percent, with 95 % intervals over scenes and trainings; differences in points. "
        f"Test: {test_scenes} scenes, seed {TEST_SEED}."])
    text = "\n\n".join([title, *(parts[part]["text"] for part in PARTS if part in parts)]) + "\n"
    study.write_results(options.out, "ablation", {"versions": study.versions(marsyard), "parts": parts}, text)


if __name__ == "__main__":
    main()
