"""Whether a network gains by what is known of the pose: pitch, roll, and the standard deviations of the estimate (A22 of the paper).

configs/paper.yaml has no columns of the ground around a cell, so that pitch and roll are the only ones that tell its slope. Its corpora of
--sizes scenes are learnt by all defaults (`features: full`: pitch and roll, no standard deviation), with the standard deviations of z, roll and
pitch besides, and without anything of the pose. Each of --seeds trainings has a corpus of its own seed, smaller ones the beginnings of the larger; all are judged on 400
scenes of another seed. Intervals: 95 %, over judged scenes and trainings, with their corpora; differences in pairs.

    cargo build --release && python scripts/pose_columns.py            # some ten minutes on 2 cores

Needs numpy and pyarrow.
"""

import argparse

import held_out
import study
import unseen
from train_rows import LISTED

POSE = ["pitch_rad", "roll_rad"]
SIGMAS = ["sigma_z_m", "sigma_roll_rad", "sigma_pitch_rad"]
WAYS = {
    "pitch and roll (`features: full`)": None,
    "and the standard deviations": LISTED + SIGMAS,
    "nothing of the pose": [name for name in LISTED if name not in POSE],
}
SHARDS = 20
JUDGED_SCENES = 400


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", default="40,160,1000")
    parser.add_argument("--seeds", default=5, type=int)
    study.add_arguments(parser, "pose_columns")
    options = parser.parse_args()
    marsyard, rows, results = study.Marsyard(options.marsyard, options.work, options.threads), [], {}
    config = study.ROOT / "configs" / "paper.yaml"
    yards = unseen.Yards(marsyard, "paper", [], LISTED + SIGMAS, JUDGED_SCENES)
    for scenes in map(int, options.sizes.split(",")):
        base, seeds = None, range(1, options.seeds + 1)
        places = [marsyard.corpus(f"paper-{scenes}-{seed}", config, [f"seed={seed}"], scenes, scenes // SHARDS) for seed in seeds]
        for k, (way, columns) in enumerate(WAYS.items()):
            sets = [f"features={{columns: [{', '.join(columns)}]}}"] if columns else []
            runs = [marsyard.train(f"paper-{scenes}-{k}", [place], seed, sets) for seed, place in zip(seeds, places)]
            accuracy = yards.accuracy([held_out.network(marsyard, run) for run in runs])
            base = base or accuracy
            difference = held_out.told_difference(accuracy, base) if accuracy is not base else ""
            rows.append([f"{scenes:,}", way, held_out.told(accuracy), difference])
            results[f"{scenes} scenes, {way}"] = {"accuracy": held_out.interval(accuracy), "difference": difference}
    text = "\n\n".join([
        "# What a network gains by the pose",
        f"`python scripts/pose_columns.py`, {study.versions(marsyard)['marsyard']}; paper.yaml, {options.seeds} trainings each, of as many corpora, judged on {yards.scenes} scenes of another seed. What is\n"
        "compared is said at the head of the script.",
        study.markdown(["scenes", "columns of the pose", "balanced accuracy, %", "difference, points"], rows)]) + "\n"
    study.write_results(options.out, "pose_columns", {"versions": study.versions(marsyard), "runs": results}, text)


if __name__ == "__main__":
    main()
