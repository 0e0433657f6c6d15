"""What the trainer's normal scores, members, rate and patience bring on the held-out families of configs/mixed.yaml, by size of the corpus.

Usage:  cargo build --release
        python scripts/rates.py [--sizes 140,400,1200] [--seeds 1,2,3] [--quick]

Cuts configs/mixed.yaml to each size and trains on it by default, and with one thing changed at a time. All are judged on
one corpus of the held-out families alone, of another seed; see held_out.py for the intervals. Differences are to the first way,
by the same draws of scenes and trainings. CPU seconds of this machine, beside other work.

Needs numpy and pyarrow. Writes rates.json and rates.md into scripts/results.
"""

import argparse

import numpy as np

import held_out
import study
from learning_curve import Learners

WAYS = {
    "all of it": [],
    "standardised columns alone": ["network.normal_scores=false"],
    "one member": ["network.members=1"],
    "three members": ["network.members=3"],
    "at the rate 0.02": ["filter.kronecker.rate=0.02"],
    "patience of 3 looks": ["patience=3"],
    "of 30": ["patience=30"],
}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", default="140,400,1200")
    parser.add_argument("--seeds", default="1,2,3")
    study.add_arguments(parser, "rates")
    options = parser.parse_args()
    sizes, seeds = [int(n) for n in options.sizes.split(",")], [int(n) for n in options.seeds.split(",")]
    if options.quick:
        sizes, seeds = sizes[:1], seeds[:1]
    marsyard = study.Marsyard(options.marsyard, options.work, options.threads)
    learners = Learners(marsyard, held_out.corpus(marsyard, "test", 51, 70 if options.quick else 560))
    rows, facts = [], {}
    for size in sizes:
        corpus, first = marsyard.corpus(f"mixed-{size}", held_out.CONFIG, [], size, held_out.PER_SHARD), None
        for number, (way, sets) in enumerate(WAYS.items()):
            of = [learners.network(f"{size}-{number}", corpus, seed, sets) for seed in seeds]
            judged = held_out.Judgement(learners.test, [counted for _, counted in of])
            first = first or judged
            seconds = np.mean([fact["train_cpu_s"] for fact, _ in of])
            differences = [held_out.told_difference(of_judged(judged), of_judged(first)) for of_judged in (held_out.Judgement.mean, held_out.Judgement.worst)]
            rows.append([size, way, f"{seconds:.1f}", held_out.told(judged.mean()), held_out.told(judged.worst()), *(differences if sets else ["-", "-"])])
            facts[f"{size} scenes, {way}"] = {"train_cpu_s": seconds, "trainings": len(seeds), **judged.facts()}
            study.note(f"{size} scenes, {way}: judged")
    head = ["scenes", "trained", "CPU s, train", "mean of families", "worst family", "less all of it, mean", "less all of it, worst"]
    text = f"""# Normal scores, members, rates and patience

`python scripts/rates.py`; {len(seeds)} trainings each. Balanced accuracy by cells on the held-out families of mixed.yaml, percent, with 95 % intervals over scenes
and trainings; differences in points. CPU seconds of this machine, beside other work.

{study.markdown(head, rows)}
"""
    study.write_results(options.out, "rates", facts, text)


if __name__ == "__main__":
    main()
