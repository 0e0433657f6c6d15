"""What the default trainer's rate and its members bring on the held-out families of configs/mixed.yaml, by size of the corpus.

Usage:  cargo build --release
        python scripts/rates.py [--sizes 140,400,1200] [--seeds 1,2,3] [--quick]

Cuts configs/mixed.yaml to each size and trains on it with one member at each rate, and with two and three members at the least. All are judged on
one corpus of the held-out families alone, of another seed; see held_out.py for the intervals. Differences are to one member at the first
rate, by the same draws of scenes and trainings. CPU seconds of this machine, beside other work.

Needs numpy and pyarrow. Writes rates.json and rates.md into scripts/results.
"""

import argparse

import numpy as np

import held_out
import study
from learning_curve import Learners

RATES = [0.02, 0.01, 0.005]
WAYS = [(rate, 1) for rate in RATES] + [(RATES[-1], members) for members in (2, 3)]


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
        for rate, members in WAYS:
            sets = [f"filter.kronecker.rate={rate}", f"network.members={members}"]
            of = [learners.network(f"{size}-{rate}-{members}", corpus, seed, sets) for seed in seeds]
            judged = held_out.Judgement(learners.test, [counted for _, counted in of])
            first = first or judged
            seconds = np.mean([fact["train_cpu_s"] for fact, _ in of])
            gains = [held_out.told_difference(of_judged(judged), of_judged(first)) for of_judged in (held_out.Judgement.mean, held_out.Judgement.worst)]
            rows.append([size, rate, members, f"{seconds:.1f}", held_out.told(judged.mean()), held_out.told(judged.worst()), *gains])
            facts[f"{size} scenes, rate {rate}, {members} members"] = {"train_cpu_s": seconds, "trainings": len(seeds), **judged.facts()}
            study.note(f"{size} scenes, rate {rate}, {members} members: judged")
    head = ["scenes", "rate", "members", "CPU s, train", "mean of families", "worst family", "gain, mean", "gain, worst"]
    text = f"""# Rates and members

`python scripts/rates.py`; {len(seeds)} trainings each. Balanced accuracy by cells on the held-out families of mixed.yaml, percent, with 95 % intervals over scenes
and trainings; gains in points over one member at the rate of {RATES[0]}. CPU seconds of this machine, beside other work.

{study.markdown(head, rows)}
"""
    study.write_results(study.RESULTS, "rates", facts, text)


if __name__ == "__main__":
    main()
