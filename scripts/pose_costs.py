"""What an estimate of the pose costs a scene of the shipped configs, and which share of FastSLAM's cost each of the others has.

    cargo build --release && python scripts/pose_costs.py

Each config is generated on one thread with each estimate, all of them in turns, round after round: CPU milliseconds of the whole build over its
scenes, medians of the rounds with the least and the most. The share is of what FastSLAM costs beside dead reckoning, in the same rounds. Writes
pose_costs.json and .md into scripts/results.
"""

import argparse
import platform
import shutil

import study

#: Of a config: scenes. mars.yaml has as many beams a scene as twenty to seventy of the others.
SCENES = {"paper": 200, "mixed": 200, "quickstart": 200, "mars": 40}
ESTIMATES = {
    "FastSLAM, 100 particles": "{fastslam: {particles: 100}}",
    "registration alone": "{registration: {}}",
    "registration alone, `every: 2`": "{registration: {every: 2}}",
    "FastSLAM's features alone": "{fastslam: {particles: 100, registration: false}}",
    "dead reckoning": "dead_reckoning",
}
DEAREST, CHEAPEST = "FastSLAM, 100 particles", "dead reckoning"


def build_ms(marsyard, config, scenes, slam):
    """CPU milliseconds a scene."""
    place = marsyard.work / "build"
    shutil.rmtree(place, ignore_errors=True)
    sets = study.overrides([f"slam={slam}", f"scenes={scenes}", "scenes_per_shard=20"])
    return 1000 * marsyard.cpu_s("generate", study.ROOT / "configs" / f"{config}.yaml", "--out", place, "--threads", 1, *sets) / scenes


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=5)
    study.add_arguments(parser, "pose_costs")
    options = parser.parse_args()
    marsyard = study.Marsyard(options.marsyard, options.work, 1)
    results = {}
    for config, scenes in SCENES.items():
        rounds = [{name: build_ms(marsyard, config, 10 if options.quick else scenes, slam) for name, slam in ESTIMATES.items()}
                  for _ in range(1 if options.quick else options.rounds)]
        results[config] = {name: [of[name] for of in rounds] for name in ESTIMATES}
        study.note(f"{config}: measured")
    rows = []
    for name in ESTIMATES:
        row = [name]
        for of in results.values():
            is_dearer = all(most > 1.1 * least for least, most in zip(of[CHEAPEST], of[DEAREST]))
            shares = [(own - least) / (most - least) for own, least, most in zip(of[name], of[CHEAPEST], of[DEAREST])] if is_dearer else []
            row += [study.median_and_range(of[name], 1), "-" if name in (DEAREST, CHEAPEST) or not is_dearer else study.median_and_range(shares, 2)]
        rows.append(row)
    head = ["estimate", *(title for config in results for title in (f"{config}, CPU ms a scene", "share of FastSLAM's"))]
    text = f"""# What estimates of the pose cost

`{study.command('pose_costs', parser, options, ('rounds',))}`, {marsyard.version()}, {platform.machine()}. CPU ms of a scene, all of its build, on one thread; medians of {options.rounds} rounds in turns, in
brackets the least and the most. Shares: of what FastSLAM costs beside dead reckoning in the same round; none where that is not a tenth in every round, as on mars.yaml, whose cells read all sweeps.

{study.markdown(head, rows)}
"""
    study.write_results(options.out, "pose_costs", results, text)


if __name__ == "__main__":
    main()
