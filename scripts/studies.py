"""What a choice is worth at equal CPU on four shipped configs, in one command: the studies that `plan --hours` is made from.

`marsyard tradeoff` on quickstart.yaml, paper.yaml, mixed.yaml and mars.yaml: presets, contact solvers, pose estimates and numbers of beams,
one at a time and combined, trained as `train` does it by default, judged on common unseen scenes. Writes the studies to configs/studies,
the charts to docs/worth-<name>.svg, and the tables to scripts/results/studies.md.

    cargo build --release && python scripts/studies.py            # some 40 minutes on 2 cores
    python scripts/studies.py --only paper                        # one of them; the tables of the others stay
"""

import argparse
import json
import platform
import shutil
import time

import study

#: Scenes of mars.yaml have thirty thousand cells, those of the others some thousand.
STUDIES = {
    "quickstart": ["--scenes", 96, "--test-scenes", 40],
    "paper": ["--scenes", 160, "--test-scenes", 60],
    "mixed": ["--scenes", 144, "--test-scenes", 20],
    "mars": ["--scenes", 24, "--test-scenes", 24],
}
COMMON = ["--only", "presets,contact,slam,resolution", "--seeds", 3]


def percent(of):
    return f"{100 * of['mean']:.2f} ± {100 * of['half_width']:.2f}"


def label(row):
    return f"{row['group']}: {row['name']}" if row["group"] else row["name"]


def front(rows):
    """Sizes of which no other is both cheaper and more accurate in the mean."""
    points = sorted((size["generate_cpu_s"] + size["train_cpu_s"], size["balanced_accuracy"]["mean"], label(row), size["scenes"])
                    for row in rows if row["may_be_recommended"] for size in row["worth"]["curve"])
    best, kept = 0.0, []
    for cpu_s, mean, name, scenes in points:
        if mean > best:
            best = mean
            kept.append(f"{cpu_s:.2f} s {100 * mean:.2f} % ({name}, {scenes} scenes)")
    return kept


def page(name, report, minutes):
    rows = [row for row in report["rows"] if row["side"] == "pipeline" and row["worth"]]
    groups = [group for group in report["test"] if group["judges"]]
    held_out = any(group["held_out"] for group in groups)
    lines = [f"## {name}.yaml", "",
             f"`marsyard tradeoff configs/{name}.yaml {' '.join(map(str, [*COMMON, *STUDIES[name]]))}`: {minutes:.0f} minutes; judged on "
             f"{sum(group['scenes'] for group in groups)} unseen scenes{' of ' + str(len(groups)) + ' held-out families' if held_out else ''}.", "",
             "| setting | CPU s of all scenes, generate + train | balanced accuracy, % | gain at equal CPU, points | told |", "|---|--:|--:|--:|---|"]
    for row in rows:
        size, gain = row["worth"]["curve"][-1], row["worth"]["gain"]
        told = {None: "", "not_apart": "not told apart", "one_seed": "one training"}
        lines.append(f"| {label(row)} | {size['generate_cpu_s']:.2f} + {size['train_cpu_s']:.2f} | {percent(size['balanced_accuracy'])} | "
                     + (f"{100 * gain['balanced_accuracy']['mean']:+.2f} ± {100 * gain['balanced_accuracy']['half_width']:.2f} | "
                        f"{told.get(gain['told'], gain['told'])} |" if gain else "| |"))
    chosen = report["recommended_pipeline"]
    lines += ["", f"Recommended: {chosen['name']}, {'told better than' if chosen['is_told_better'] else 'nothing is told better than'} the "
              f"reference. Other draws of the reference differ by {100 * (report['noise_floor'] or 0):.2f} points; common scenes and draws make the "
              f"variance of a gain {report['variance_ratio']:.1f} times smaller. Front: {'; '.join(front(rows))}.", ""]
    return "\n".join(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    study.add_arguments(parser, "studies")
    parser.add_argument("--only", choices=STUDIES, action="append", help="one config (repeatable)")
    options = parser.parse_args()
    marsyard = study.Marsyard(options.marsyard, options.work, options.threads)
    kept = options.out / "studies.json"
    pages = json.loads(kept.read_text()) if kept.exists() else {}
    for name in options.only or STUDIES:
        study.note(f"tradeoff of {name}.yaml")
        begun, folder = time.monotonic(), options.work / name
        shutil.rmtree(folder, ignore_errors=True)
        sizes = ["--scenes", 16, "--test-scenes", 6] if options.quick else STUDIES[name]
        marsyard.run("tradeoff", study.ROOT / "configs" / f"{name}.yaml", *COMMON, *sizes, "--threads", options.threads, "--out", folder)
        report = json.loads((folder / "tradeoff.json").read_text())
        # The command that is printed is one that a user gives, from the root of the tree.
        pages[name] = page(name, report, (time.monotonic() - begun) / 60)
        if not options.quick:
            shutil.copyfile(folder / "study.json", study.ROOT / "configs" / "studies" / f"{name}.json")
            shutil.copyfile(folder / "tradeoff.svg", study.ROOT / "docs" / f"worth-{name}.svg")
    head = ["# What a choice is worth at equal CPU", "",
            f"{marsyard.version()}, {platform.machine()}; `python scripts/studies.py`. CPU of one thread, making the scenes that train and that stop it, and "
            "training; gains at the largest CPU time that a setting and the reference both reach; intervals of 95 % over test scenes and trainings.", ""]
    kept.write_text(json.dumps(pages, indent=1) + "\n")
    (options.out / "studies.md").write_text("\n".join(head + [pages[name] for name in STUDIES if name in pages]))


if __name__ == "__main__":
    main()
