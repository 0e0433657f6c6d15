"""What `plan --hours` recommends, built: whether it costs and errs as forecast, and whether the second choice is worse and more scenes bring nothing.

For each config the first two choices of `marsyard plan CONFIG --hours H` (H: --cpu-minutes on the cores that there are) are generated with as
many scenes as it says, networks are trained by `train`'s defaults, and all are judged on common scenes of another seed: of the config at the
study's reference setting, or of mixed.yaml's held-out families. Where the plan stops early because the curve is flat, the first choice is
also built with --beyond times as many scenes; where neither choice is the study's reference, that is built, too. Besides, what is recommended of all four configs for 1 and for 8 CPU hours and 200 GB. Intervals of 95 % draw scenes (within their families) and trainings anew, in pairs.

    cargo build --release && python scripts/verify_plan.py --cpu-minutes 20

Needs numpy and pyarrow.
"""

import argparse
import json
import platform
import time

import numpy as np

import held_out
import study
import unseen

CONFIGS = ["quickstart", "paper", "mixed", "mars"]
#: What is told of all four configs: CPU hours, and a disk, which is not that of the machine at hand.
CPU_HOURS, DISK = (1, 8), "200GB"
BOUNDS = {"flat": "more scenes bring nothing", "hours": "the hours", "disk": "the disk"}
TITLES = {"first": "recommended", "second": "second choice", "more": "recommended, more scenes", "reference": "the reference"}
SEEDS = (1, 2, 3)
#: A scene of mars.yaml has as many cells as thirteen to twenty-eight of the others; of mixed.yaml eight families judge, some 70 scenes each.
JUDGED_SCENES = {"quickstart": 400, "paper": 400, "mixed": None, "mars": 100}


def build(marsyard, name, title, choice, shards, scenes):
    """A corpus of a choice and its networks, with the CPU seconds of both."""
    kept = marsyard.work / f"{title}.json"
    place = marsyard.work / "corpora" / title
    if not kept.exists():
        study.note(f"{title}: {scenes} scenes")
        sets = study.overrides([*choice["sets"], *shards, f"scenes={scenes}"])
        cpu = {"generate": marsyard.cpu_s("generate", study.ROOT / "configs" / f"{name}.yaml", "--out", place,
                                          "--threads", marsyard.threads, *sets), "train": []}
        for seed in SEEDS:
            cpu["train"].append(marsyard.cpu_s("train", place, "--out", marsyard.work / "runs" / f"{title}-{seed}", "--seed", seed,
                                               "--threads", marsyard.threads))
        cpu |= {"date": time.strftime("%Y-%m-%d"), "study_commit": study_commit(name)}
        kept.write_text(json.dumps(cpu))
    models = [held_out.network(marsyard, marsyard.work / "runs" / f"{title}-{seed}") for seed in SEEDS]
    cpu = json.loads(kept.read_text())
    return {"setting": choice["setting"], "scenes": scenes, "generate_cpu_s": cpu["generate"], "train_cpu_s": float(np.mean(cpu["train"])),
            "date": cpu["date"], "study_commit": cpu["study_commit"]}, models


def study_file(name):
    return study.ROOT / "configs" / "studies" / f"{name}.json"


def plan_of(marsyard, name, cpu_hours, *more):
    return json.loads(marsyard.run("plan", study.ROOT / "configs" / f"{name}.yaml", "--hours", cpu_hours / marsyard.threads,
                                   "--cores", marsyard.threads, "--study", study_file(name), "--json", *more))


def recommendations(marsyard):
    """Rows of the table of what is recommended for more hours."""
    share = lambda of: f"{100 * of['mean']:.1f} [{100 * of['low']:.1f}, {100 * of['high']:.1f}]"
    rows = []
    for name in CONFIGS:
        for hours in CPU_HOURS:
            study.note(f"plan of {name}: {hours} CPU h")
            first, *others = plan_of(marsyard, name, hours, "--disk", DISK)["choices"]
            second = others[0] if others else None
            minutes = (first["generate_s"] * marsyard.threads + first["train_s"]) / 60
            rows.append([name, str(hours), first["setting"], f"{first['scenes']:,}", f"{first['rows'] / 1e6:.1f}", f"{first['bytes'] / 1e9:.1f}",
                         f"{minutes:.0f}", BOUNDS[first["bound"]], share(first["balanced_accuracy"]),
                         f"{second['setting']}, {second['scenes']:,} scenes: {share(second['balanced_accuracy'])}" if second else ""])
    return rows


def study_commit(name):
    return json.loads(study_file(name).read_text())["commit"]


def verify(marsyard, name, options):
    plan = plan_of(marsyard, name, options.cpu_minutes / 60)
    reference = next(choice for choice in plan["choices"] if choice["setting"] == "reference")
    first, second = plan["choices"][:2]
    # Of few scenes shards are smaller than the config's.
    shards = [one for one in plan["sets"] if one.startswith("scenes_per_shard=")]
    builds = [("first", first, first["scenes"]), ("second", second, second["scenes"])]
    if first["bound"] == "flat":
        builds.append(("more", first, min(options.beyond * first["scenes"], first["most_scenes"])))
    if reference not in (first, second):
        builds.append(("reference", reference, reference["scenes"]))
    rows, yards, base = [], None, None
    for title, choice, scenes in builds:
        row, models = build(marsyard, name, f"{name}-{title}", choice, shards, scenes)
        if yards is None:
            yards = unseen.Yards(marsyard, name, reference["sets"], models[0]["about"]["features"], JUDGED_SCENES[name])
        accuracy = yards.accuracy(models)
        base = accuracy if base is None else base
        row |= {"choice": title, "accuracy": held_out.interval(accuracy), "judged_on": yards.scenes,
                "against_first": held_out.told_difference(accuracy, base) if title != "first" else None}
        if title != "more":
            row["forecast"] = {"accuracy": choice["balanced_accuracy"], "generate_cpu_s": choice["generate_s"] * options.threads,
                               "train_cpu_s": choice["train_s"]}
        rows.append(row)
    return rows


def table(results):
    rows = []
    for name, builds in results.items():
        for of in builds:
            mean, low, high = (100 * value for value in of["accuracy"])
            forecast = of.get("forecast")
            said = lambda key: f"{of[key]:.0f}" + (f" ({forecast[key]:.0f})" if forecast else "")
            expected = forecast and forecast["accuracy"]
            rows.append([name, TITLES[of["choice"]],
                         of["setting"], str(of["scenes"]), said("generate_cpu_s"), said("train_cpu_s"), f"{mean:.2f} [{low:.2f}, {high:.2f}]",
                         f"{100 * expected['mean']:.2f} [{100 * expected['low']:.2f}, {100 * expected['high']:.2f}]" if expected else "",
                         of["against_first"] or ""])
    head = ["config", "choice", "setting", "scenes", "generate, CPU s (forecast)", "train, CPU s (forecast)", "balanced accuracy, %", "forecast, %",
            "against the recommended, points"]
    return study.markdown(head, rows)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    study.add_arguments(parser, "verify_plan")
    parser.add_argument("--cpu-minutes", type=float, default=20, help="budget of a plan (default 20)")
    parser.add_argument("--beyond", type=int, default=2, help="times as many scenes, where the curve is told to be flat (default 2)")
    parser.add_argument("--only", choices=CONFIGS, action="append", help="one config (repeatable); the rows of the others stay")
    options = parser.parse_args()
    marsyard = study.Marsyard(options.marsyard, options.work, options.threads)
    made = {name: verify(marsyard, name, options) for name in options.only or CONFIGS}
    results = study.beside_former(made, options.out / "verify_plan.json", CONFIGS)
    head = ["config", "CPU hours", "recommended", "scenes", "rows, 10^6", "GB", "CPU minutes told", "what ends it", "balanced accuracy, %", "next best"]
    recommended = study.markdown(head, recommendations(marsyard))
    left_out = "".join(f"\n{name}.yaml was not built." for name in CONFIGS if name not in results)
    left_out += "".join(f"\nRows of {name}.yaml are of the study before the one that is stored now." for name, builds in results.items()
                        if builds[0].get("study_commit") != study_commit(name))
    built = ", ".join(f"{name} {builds[0].get('date', 'on an unknown day')} by the study of commit {builds[0].get('study_commit', 'unknown')[:9]}" for name, builds in results.items())
    text = f"""# What `plan --hours` recommends, built

{marsyard.version()}, {platform.machine()}; `python scripts/verify_plan.py --cpu-minutes {options.cpu_minutes:g} --beyond {options.beyond}`: CPU seconds of all threads,
{len(SEEDS)} trainings each, judged on common scenes that no build has (mixed.yaml: of its eight held-out families). Intervals: 95 %, over scenes and
trainings; differences in pairs. Forecasts are the plan's, in parentheses and beside.

{table(results)}

Built: {built}.{left_out}

## For 1 and for 8 CPU hours

What `plan CONFIG --hours H --cores {options.threads} --disk {DISK}` says of the shipped configs now, H: the CPU hours over the cores. It measures anew what scenes and rows take, so
that sizes differ by some percent from those above.

{recommended}
"""
    study.write_results(options.out, "verify_plan", results, text)


if __name__ == "__main__":
    main()
