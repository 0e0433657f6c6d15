"""What a choice is worth at equal CPU on four shipped configs, in one command: the studies that `plan --hours` is made from.

`marsyard tradeoff` on quickstart.yaml, paper.yaml, mixed.yaml and mars.yaml: presets, pose estimates and numbers of beams,
one at a time and combined, what is told better and the reference on 8 to 32 times the scenes, trained as `train` does it by default, judged on common unseen scenes. Writes the studies to configs/studies,
the charts to docs/worth-<name>.svg, and the tables to scripts/results/studies.md.

    cargo build --release && python scripts/studies.py            # 43 minutes on 2 slow cores
    python scripts/studies.py --only paper                        # one of them; the tables of the others stay
"""

import argparse
import json
import platform
import shutil
import time

import study

#: Scenes of mars.yaml have thirty thousand cells, those of the others some thousand. Curves of paper.yaml and mixed.yaml end late.
STUDIES = {
    "quickstart": ["--scenes", 96, "--test-scenes", 40],
    "paper": ["--scenes", 160, "--test-scenes", 60, "--farther", 16],
    "mixed": ["--scenes", 144, "--test-scenes", 20, "--farther", 32],
    "mars": ["--scenes", 24, "--test-scenes", 24],
}
#: No contact solver: none was ever told apart from the reference, and their costs are those of parts, which trade.md tells.
COMMON = ["--only", "presets,slam,resolution", "--seeds", 3]


def page(name, folder, minutes, threads):
    """What `tradeoff` says of worth, of the longer curve, of the front and at its end."""
    said = (folder / "tradeoff.md").read_text()
    section = lambda title: "### " + next(part for part in said.split("\n## ") if part.startswith(title)).strip()
    closing = said.rstrip().rsplit("\n\n", 1)[1].replace("\n", "\n\n")
    asked = " ".join(map(str, [*COMMON, *STUDIES[name]]))
    return "\n\n".join([f"## {name}.yaml", f"`marsyard tradeoff configs/{name}.yaml {asked}`: {minutes:.1f} minutes on {threads} threads.",
                        section("What each setting is worth"), section("Farther"), section("The front"), closing, ""])


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
        # The command that is printed is one that a user gives, from the root of the tree.
        pages[name] = page(name, folder, (time.monotonic() - begun) / 60, options.threads)
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
