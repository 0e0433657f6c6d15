"""What a training takes: on one core and on two, with normal scores and without, and what its looks at the validation split cost.

Usage:  cargo build --release
        python scripts/train_costs.py [--rounds 3] [--quick]          # leave the machine idle

What goes in: quickstart.yaml as it stands, and mixed.yaml cut to 70, 140 and 500 scenes. The rounds are interleaved, and what is compared is compared within a
round; figures are medians of the rounds, with the least and the most. CPU is the user and system time of the whole process.

  Threads        A training of quickstart.yaml by default, opening, looks, calibration and the test split included: with `--threads 1` and its process
                 on one core, the same on two, with `--threads 2`, and two trainings at once, each on a core of its own.
  Normal scores  CPU of learning quickstart.yaml, with them and without: what a training of three passes takes beyond one of a single pass, neither
                 looked at but at its ends, so that all that is done once falls out.
  Looks          CPU of learning mixed.yaml: the same difference, with looks as usual and with none between; of what it takes with them they are the share.

Needs numpy and pyarrow (held_out.py does), `taskset` and two cores. Writes train_costs.json and train_costs.md into scripts/results.
"""

import argparse
import json
import os
import platform
import shutil
import subprocess
import time

import held_out
import study

#: A look every so many rows is none between the first and the last.
NEVER = 10**12
CORES = sorted(os.sched_getaffinity(0))[:2]


class Trainings:
    """Trainings that are timed and thrown away."""

    def __init__(self, marsyard):
        self.marsyard = marsyard

    def begin(self, name, corpus, threads, sets=(), cores=CORES):
        run = self.marsyard.work / f"run-{name}"
        shutil.rmtree(run, ignore_errors=True)
        pinned = ["taskset", "-c", ",".join(map(str, cores))]
        command = [*pinned, self.marsyard.binary, "train", corpus, "--out", run, "--threads", threads, *study.overrides(sets)]
        return subprocess.Popen([str(part) for part in command], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def timed(self, *arguments, **options):
        """Wall seconds, CPU seconds and megabytes at most of one."""
        child, begun = self.begin(*arguments, **options), time.monotonic()
        _, status, used = os.wait4(child.pid, 0)
        assert status == 0, f"{arguments} failed"
        return time.monotonic() - begun, used.ru_utime + used.ru_stime, used.ru_maxrss / 1000

    def at_once_s(self, corpus):
        """Wall seconds of two, each on a core of its own."""
        begun = time.monotonic()
        both = [self.begin(f"at-once-{core}", corpus, 1, cores=[core]) for core in CORES]
        assert all(child.wait() == 0 for child in both)
        return time.monotonic() - begun

    def two_passes_s(self, corpus, sets):
        """CPU seconds that three passes take beyond one."""
        passes = lambda count: [f"epochs={count}", "patience=100000"]
        one, three = (self.timed("passes", corpus, 1, [*passes(count), *sets], cores=CORES[:1])[1] for count in (1, 3))
        return three - one


def rows_to_learn(place):
    return json.loads((place / "manifest.json").read_text())["splits"]["train"]["rows"]["cells"]


def measured(trainings, quickstart, mixed, rounds):
    """What each of the rounds took, by name."""
    found = {}
    note = lambda name, value: found.setdefault(name, []).append(value)
    unseen = f"validate_every={NEVER}"
    for number in range(rounds):
        study.note(f"round {number + 1} of {rounds}")
        note("one core", trainings.timed("one", quickstart, 1, cores=CORES[:1])[0])
        note("one thread, two cores", trainings.timed("ahead", quickstart, 1)[0])
        for name, value in zip(("two threads", "two threads, CPU", "two threads, MB"), trainings.timed("two", quickstart, 2)):
            note(name, value)
        note("two at once", trainings.at_once_s(quickstart))
        for scores in ("true", "false"):
            note(f"scores {scores}", trainings.two_passes_s(quickstart, [unseen, f"network.normal_scores={scores}"]))
        for size, place in mixed.items():
            note(f"looks {size}", trainings.two_passes_s(place, []))
            note(f"no looks {size}", trainings.two_passes_s(place, [unseen]))
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", default=3, type=int)
    study.add_arguments(parser, "train_costs")
    options = parser.parse_args()
    assert len(CORES) == 2, "two cores are compared with one: this machine has one"
    rounds, sizes, cut = options.rounds, [70, 140, 500], []
    if options.quick:
        rounds, sizes, cut, options.work = 1, [70], ["scenes=100", "scenes_per_shard=10"], options.work / "quick"
    marsyard = study.Marsyard(options.marsyard, options.work, options.threads)
    quickstart = marsyard.shipped("quickstart", cut)
    mixed = {size: marsyard.corpus(f"mixed-{size}", held_out.CONFIG, [], size, held_out.PER_SHARD) for size in sizes}
    found = measured(Trainings(marsyard), quickstart, mixed, rounds)

    times = lambda name, of=1: study.median_and_range([of * one / other for one, other in zip(found["one core"], found[name])], 2)
    threads = [["one core", study.median_and_range(found["one core"], 1), "1"],
               ["two cores, `--threads 1`: reading ahead has a thread of its own", study.median_and_range(found["one thread, two cores"], 1), times("one thread, two cores")],
               ["two cores, `--threads 2`", study.median_and_range(found["two threads"], 1), times("two threads")],
               ["two trainings at once, each on a core", study.median_and_range(found["two at once"], 1), times("two at once", 2)]]
    rows = 2 * rows_to_learn(quickstart)
    rates = {scores: [rows / took / 1e3 for took in found[f"scores {scores}"]] for scores in ("true", "false")}
    looks = [[size, f"{rows_to_learn(place):,}", study.median_and_range(found[f"looks {size}"], 2), study.median_and_range(found[f"no looks {size}"], 2),
              study.median_and_range([100 * (1 - none / some) for some, none in zip(found[f"looks {size}"], found[f"no looks {size}"])], 1)] for size, place in mixed.items()]
    text = f"""# What a training takes

`python scripts/train_costs.py`, {marsyard.version()}, {platform.machine()}. Medians of {rounds} interleaved rounds, in brackets the least and the most; what is measured is said at the head of
the script.

## Threads

quickstart.yaml by default; with `--threads 2` it takes {study.median_and_range(found['two threads, CPU'], 1)} s of CPU and {study.median_and_range(found['two threads, MB'], 0)} MB at most.

{study.markdown(["", "wall s", "times as fast"], threads)}

## Normal scores

Of two passes over quickstart.yaml, {rows:,} rows: {study.median_and_range(rates['true'], 0)} thousand rows a CPU second with normal scores, {study.median_and_range(rates['false'], 0)} without.

## Looks at the validation split

Two passes over mixed.yaml, CPU seconds.

{study.markdown(["scenes", "rows to learn", "looks as usual", "no looks", "share of looks, %"], looks)}
"""
    results = {"version": marsyard.version(), "rounds": rounds, "found": found, "thousand_rows_a_cpu_s": rates}
    study.write_results(options.out, "train_costs", results, text)


if __name__ == "__main__":
    main()
