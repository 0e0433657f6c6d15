"""Runs the checks of Ray, Slurm and Kubernetes and writes what they found into scripts/results/scale_out.json and .md.

Usage:  cargo build --release
        python scripts/scale_out/run.py [--binary MARSYARD] [--only ray,slurm,kubernetes] [--ray-place s3://BUCKET/PREFIX]

Needs ray, kubernetes-validate and PyYAML, root and Debian's packages for Slurm. Checks that are not run keep their last results.
"""

import argparse
import json
import pathlib
import subprocess
import sys
import tempfile

import yard

RESULTS = yard.ROOT / "scripts" / "results"
CHECKS = {"ray": "check_ray.py", "slurm": "check_slurm.py", "kubernetes": "check_kubernetes.py"}


def markdown(facts):
    first = next(iter(facts.values()))
    lines = [
        "# One corpus, many machines",
        "",
        "`python scripts/scale_out/run.py`: `configs/quickstart.yaml` as "
        f"{first['shards']} shards of {yard.SCENES_PER_SHARD} scenes, built by one process and by each engine, on this one machine;",
        "what went wrong was made to. The corpus_id is a hash over the values of all tables.",
        "",
        "| engine | what happened | wall s | corpus_id |",
        "|---|---|--:|---|",
        f"| one process | | | `{first['corpus_id'][:16]}` |",
    ]
    for fact in facts.values():
        for case in fact["cases"]:
            wall = f"{case['wall_s']:.0f}" if "wall_s" in case else ""
            lines.append(f"| {fact['engine']} | {case['what']} | {wall} | `{case['corpus_id'][:16]}` |")
    lines += [
        "",
        "Each check also asserts how a build fails: a bad config ends with exit 2 before anything is submitted; exit 1 is not tried again,",
        "the other shards are built, and the missing ones are named; no process of a lost Ray node goes on. The times are of a machine that",
        "other work shares, and hold waits that the engines prescribe.",
    ]
    return "\n".join(lines) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--binary", default=yard.ROOT / "target/release/marsyard")
    parser.add_argument("--only", default=",".join(CHECKS))
    parser.add_argument("--ray-place", help="where Ray's corpora go; default: a folder")
    args = parser.parse_args()
    kept = RESULTS / "scale_out.json"
    facts = json.loads(kept.read_text()) if kept.exists() else {}
    for name in args.only.split(","):
        print(f"== {name}", flush=True)
        with tempfile.NamedTemporaryFile(suffix=".json") as result:
            words = ["--place", args.ray_place] if name == "ray" and args.ray_place else []
            script = pathlib.Path(__file__).with_name(CHECKS[name])
            done = subprocess.run([sys.executable, script, args.binary, "--json", result.name, *words])
            if done.returncode:
                sys.exit(f"{name} failed; nothing was written")
            facts[f"{name} on {args.ray_place.split(':')[0]}" if words else name] = json.loads(pathlib.Path(result.name).read_text())
    if len({fact["corpus_id"] for fact in facts.values()}) > 1:
        sys.exit("the last results are of another corpus: run all checks again")
    kept.write_text(json.dumps(facts, indent=1) + "\n")
    (RESULTS / "scale_out.md").write_text(markdown(facts))
    print(markdown(facts))


if __name__ == "__main__":
    main()
