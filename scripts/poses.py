#!/usr/bin/env python3
"""What FastSLAM gains on the sweeps of the shipped configs, where the rest goes, and whether the stated sigmas are honest.

    cargo build --release --locked --example poses
    python scripts/poses.py [--scenes 300] [--only "paper, 60 m"] [--check]

Each scene's drive is located by the config's own filter, by dead reckoning, and by the filter with exact features of known landmarks (the
ceiling) and then one handicap at a time (benches/programs/poses.rs). Judged at the last stop, in paired scenes. NEES is the error squared
over the stated variance, averaged over scenes: 1 a degree of freedom where the sigmas are honest; the band holds 95 % of such means. --check
names what of a config's own estimate lies outside it, and fails. Results go to scripts/results/poses.json and .md.
"""

import argparse
import json
import pathlib
import subprocess
import sys

import numpy as np
from scipy.stats import binomtest, chi2

import study

PROGRAM = study.ROOT / "target" / "release" / "examples" / "poses"
# The shipped configs, and longer drives on paper.yaml's ground with two stops a metre of way.
CONFIGS = ["paper", "mixed", "mars", "quickstart", "quickstart, 1500 scenes", "holes", "paper, 10 m", "paper, 60 m", "paper, 60 m, 300 particles", "paper, 60 m, 1000 particles"]
# Of one config more, for a narrower band than that of --scenes.
SCENES = {"quickstart, 1500 scenes": 1500}
# Whose handicaps are taken apart too.
APART = {"paper", "mixed", "mars"}
LONG = ["scene.extent_m=90", "scene.rocks.count={uniform: [400, 1200]}", "scene.ground.source.random.correlation_length_m={uniform: [10, 30]}",
        "drive.path={planned: {goal_m: 60}}", "drive.stops=120"]
# What is overridden: mixed.yaml and holes.yaml dead-reckon, and are asked here what FastSLAM would bring them.
SETS = {"mixed": ["slam={fastslam: {particles: 100}}"],
        "holes": ["slam={fastslam: {particles: 100}}"],
        "paper, 10 m": ["drive.path={planned: {goal_m: 10}}", "drive.stops=20"],
        "paper, 60 m": LONG,
        **{f"paper, 60 m, {count} particles": [*LONG, f"slam={{fastslam: {{particles: {count}}}}}"] for count in (300, 1000)}}
RECKONED, FILTERED = "dead_reckoning", "fastslam"
# Whose errors are split into those along the way and those across it.
WAYS = [RECKONED, "registration", FILTERED, "fastslam, features alone"]
# The estimate of the config as shipped.
OWN = {"mixed": RECKONED, "holes": RECKONED}
# Rows and columns of the covariance.
BLOCKS = {"position": [0, 1, 2], "heading": [5], "z": [2], "roll": [3], "pitch": [4]}


def scenes_of(name, arguments):
    """The lines of the program, kept in the work folder."""
    scenes = SCENES.get(name, arguments.scenes)
    kept = arguments.work / f"{name}-{scenes}.jsonl"
    if not kept.exists():
        study.note(f"{name}: {scenes} scenes")
        command = [PROGRAM, study.ROOT / "configs" / f"{name.split(',')[0]}.yaml", "--scenes", str(scenes),
                   *study.overrides(SETS.get(name, []))]
        done = subprocess.run([*command, *([] if name in APART else ["--without-handicaps"])], capture_output=True, text=True)
        if done.returncode:
            sys.exit(f"{name} failed:\n{done.stderr[-3000:]}")
        kept.write_text(done.stdout)
    scenes = [json.loads(line) for line in kept.read_text().splitlines()]
    # Where the rover could not move it is known exactly where it stands.
    return [scene for scene in scenes if scene["way_m"] > 0]


def matrix(triangle):
    full = np.zeros((6, 6))
    full[np.triu_indices(6)] = triangle
    return full + np.triu(full, 1).T


def nees(errors, covariances, block):
    """Mean over scenes, divided by the degrees of freedom."""
    inside = np.ix_(block, block)
    return float(np.mean([e[block] @ np.linalg.solve(c[inside], e[block]) for e, c in zip(errors, covariances)])) / len(block)


def on_the_way(scenes, errors):
    """Of errors at the end, in the plane: along the line from the start, as a share of it with its standard error, and across; root mean squares in metres.
    Scenes whose drive came back to where it began have no such line."""
    line = np.array([np.subtract(s["end_m"], s["start_m"])[:2] for s in scenes])
    long_m = np.linalg.norm(line, axis=1)
    goes = long_m > 0
    ahead = line[goes] / long_m[goes, None]
    plane, long_m = errors[goes, :2], long_m[goes]
    along = np.sum(plane * ahead, axis=1)
    across = ahead[:, 0] * plane[:, 1] - ahead[:, 1] * plane[:, 0]
    share = float(along @ long_m / (long_m @ long_m))
    return {"share": share, "share_error": float(np.sqrt(np.sum(((along - share * long_m) * long_m) ** 2)) / (long_m @ long_m)),
            "along_rms_m": float(np.sqrt(np.mean(along ** 2))), "across_rms_m": float(np.sqrt(np.mean(across ** 2)))}


def ratio_interval(off_m, reckoned_m):
    """Of 95 %, by drawing scenes anew 2000 times, both estimates of a scene together."""
    drawn = np.random.default_rng(5).integers(len(off_m), size=(2000, len(off_m)))
    return [float(bound) for bound in np.quantile(off_m[drawn].mean(axis=1) / reckoned_m[drawn].mean(axis=1), [0.025, 0.975])]


def judged(scenes):
    """Per variant: errors beside dead reckoning's of the same scenes, and NEES."""
    errors = {name: np.array([s["variants"][name]["error"] for s in scenes]) for name in scenes[0]["variants"]}
    off_m = {name: np.linalg.norm(e[:, :3], axis=1) for name, e in errors.items()}
    table = {}
    for name, error in errors.items():
        of = [s["variants"][name] for s in scenes]
        covariances = [matrix(v["covariance"]) for v in of]
        table[name] = {
            "position_mean_m": float(off_m[name].mean()),
            "position_median_m": float(np.median(off_m[name])),
            "ratio": float(off_m[name].mean() / off_m[RECKONED].mean()),
            "ratio_interval": ratio_interval(off_m[name], off_m[RECKONED]),
            "better_share": float(np.mean(off_m[name] < off_m[RECKONED])),
            "heading_rms_deg": float(np.degrees(np.sqrt(np.mean(error[:, 5] ** 2)))),
            "z_rms_m": float(np.sqrt(np.mean(error[:, 2] ** 2))),
            "on_the_way": on_the_way(scenes, error),
            "features": float(np.mean([v["features"] or 0 for v in of])),
            "matched": float(np.mean([v["matched"] or 0 for v in of])),
            "nees": {block: nees(error, covariances, axes) for block, axes in BLOCKS.items()},
        }
    return table


def better(share, scenes):
    """In percent, with Wilson's interval of 95 %."""
    low, high = (100 * bound for bound in binomtest(round(share * scenes), scenes).proportion_ci(method="wilson"))
    return f"{100 * share:.0f} ({low:.0f} to {high:.0f})"


def band(scenes, freedom):
    return [float(x) / (scenes * freedom) for x in chi2.ppf([0.025, 0.975], scenes * freedom)]


def of_config(scenes):
    return {"scenes": len(scenes), "way_m": float(np.median([s["way_m"] for s in scenes])), "bodies": float(np.mean([s["bodies"] for s in scenes])),
            "band_1": band(len(scenes), 1), "band_3": band(len(scenes), 3), "variants": judged(scenes)}


def written(results):
    parts = [f"""# Poses: what FastSLAM gains on real sweeps, and where the rest goes

`python scripts/poses.py --scenes {results['scenes']}`. Error at the last stop, paired scenes. *Ceiling*: every body that returns 8 beams is a
landmark with its number, seen without error, 100 particles, and no sweep is laid on another, as in *extracted, known association*. The other rows differ
from it, or from the config's own filter, in what they name.
*registration*: `slam: {{registration: {{}}}}`, a Kalman filter without particles; thinned
as by `every: 2`, all sweeps but the last (not on mars.yaml, whose cells read all of them: a build thins none). Ratio: mean position error over dead reckoning's; in brackets 95 %, where it has them over scenes in pairs. mixed.yaml and holes.yaml dead-reckon; here they have 100 particles, which gain
nothing on holes.yaml, for its drives have one stop. *10 m* and *60 m*: drives so long on paper.yaml's
ground (60 m: a yard of 90 m with as many rocks an area), two stops a metre of way. NEES per degree of freedom: 1 is honest, less means sigmas too large."""]
    for name, config in results["configs"].items():
        low, high = config["band_1"]
        rows = []
        for variant, v in config["variants"].items():
            rows.append([variant, f"{v['position_mean_m']:.4f}", f"{v['position_median_m']:.4f}", f"{v['ratio']:.2f}{' ({:.2f} to {:.2f})'.format(*v['ratio_interval']) if 'ratio_interval' in v and variant != RECKONED else ''}",
                         better(v["better_share"], config["scenes"]) if variant != RECKONED else "-",
                         f"{v['heading_rms_deg']:.2f}", f"{v['z_rms_m']:.4f}", f"{v['features']:.1f} / {v['matched']:.1f}",
                         *(f"{v['nees'][block]:.2f}" for block in BLOCKS)])
        head = ["variant", "mean m", "median m", "ratio", "better %", "heading deg", "z m", "features / matched", *(f"NEES {b}" for b in BLOCKS)]
        title = ".yaml, ".join(name.split(", ", 1)) if "," in name else f"{name}.yaml"
        parts.append(f"""## {title}

{config['scenes']} scenes, median way {config['way_m']:.2f} m, {config['bodies']:.1f} bodies in view of a
sweep. The band of 95 %: {low:.2f} to {high:.2f} for one number, {config['band_3'][0]:.2f} to {config['band_3'][1]:.2f} for position.

{study.markdown(head, rows)}""")
    rows = [[name, variant, f"{1000 * w['share']:+.1f} ± {1000 * w['share_error']:.1f}", f"{w['along_rms_m']:.3f}", f"{w['across_rms_m']:.3f}"]
            for name, config in results["configs"].items() for variant in WAYS for w in [config["variants"][variant]["on_the_way"]]]
    parts.append(f"""## Along the way and across it

Errors at the end, along the line from the start and across it: what is told too far (+) or too short, in thousandths of the line, with its standard error,
and root mean squares.

{study.markdown(["drives", "variant", "too far, thousandths", "along, rms m", "across, rms m"], rows)}""")
    return "\n\n".join(parts) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", type=int, default=300)
    parser.add_argument("--only", choices=CONFIGS, action="append", help="one of the tables (repeatable); the others stay")
    parser.add_argument("--work", type=pathlib.Path, default=study.ROOT / "target" / "studies" / "poses",
                        help="folder for what the program said; what lies there is not made again")
    parser.add_argument("--check", action="store_true", help="fail, naming them, where blocks lie outside the band")
    arguments = parser.parse_args()
    arguments.work.mkdir(parents=True, exist_ok=True)
    made = {name: of_config(scenes_of(name, arguments)) for name in arguments.only or CONFIGS}
    configs = study.beside_former(made, study.RESULTS / "poses.json", CONFIGS, "configs")
    results = {"scenes": arguments.scenes, "configs": configs}
    study.write_results(study.RESULTS, "poses", results, written(results))
    if arguments.check:
        outside = []
        for name, config in made.items():
            nees = config["variants"][OWN.get(name, FILTERED)]["nees"]
            for block, axes in BLOCKS.items():
                low, high = config[f"band_{len(axes)}"]
                if not low <= nees[block] <= high:
                    outside.append(f"{name}: {block} {nees[block]:.2f}")
        if outside:
            sys.exit("outside the band: " + ", ".join(outside))


if __name__ == "__main__":
    main()
