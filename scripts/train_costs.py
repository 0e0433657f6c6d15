"""What a training takes: on one core and on two, with normal scores and without, and what its looks at the validation split cost.

Usage:  cargo build --release
        python scripts/train_costs.py [--rounds 3] [--quick]          # leave the machine idle

What goes in: quickstart.yaml as it stands, and mixed.yaml cut to 70, 500 and 2000 scenes. All in interleaved rounds; figures are medians of the rounds, CPU
is user and system time of the process, all of it: opening, learning, looks, calibration and the test split.

  Threads        quickstart.yaml by default: wall seconds with `--threads 1` and its process on one core, on two cores, and with `--threads 2`; and two
                 trainings at once, each on a core, against one after the other.
  Normal scores  CPU of learning a row, with and without: of trainings of one epoch and of three, which differ by two passes without a look between.
  Looks          mixed.yaml: CPU of three epochs with looks at their usual distance, and of the same rows with none but the first and the last.

Needs nothing but Python, and `taskset`. Writes train_costs.json and train_costs.md into scripts/results.
"""

import argparse
import json
import os
import platform
import shutil
import subprocess
import time
from statistics import median

import held_out
import study

QUICKSTART = study.ROOT / "configs" / "quickstart.yaml"
NEVER = 10**12
CORES = sorted(os.sched_getaffinity(0))[:2]


class Trainings:
    """Trainings that are timed and thrown away."""

    def __init__(self, marsyard):
        self.marsyard = marsyard

    def begin(self, name, corpus, threads, sets=(), core=None):
        run = self.marsyard.work / f"run-{name}"
        shutil.rmtree(run, ignore_errors=True)
        command = [] if core is None else ["taskset", "-c", str(core)]
        command += [self.marsyard.binary, "train", corpus, "--out", run, "--threads", threads, *study.overrides(sets)]
        return subprocess.Popen([str(part) for part in command], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def timed(self, *arguments, **options):
        """Wall and CPU seconds of one."""
        child, begun = self.begin(*arguments, **options), time.monotonic()
        _, status, used = os.wait4(child.pid, 0)
        assert status == 0, f"{arguments} failed"
        return time.monotonic() - begun, used.ru_utime + used.ru_stime

    def at_once(self, corpus):
        """Wall seconds of two, each on a core of its own."""
        begun = time.monotonic()
        both = [self.begin(f"at-once-{core}", corpus, 1, core=core) for core in CORES]
        assert all(child.wait() == 0 for child in both)
        return time.monotonic() - begun


def rows_to_learn(place):
    return json.loads((place / "manifest.json").read_text())["splits"]["train"]["rows"]["cells"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", default=3, type=int)
    parser.add_argument("--sizes", default="70,500,2000", help="scenes of mixed.yaml (default 70,500,2000)")
    study.add_arguments(parser, "train_costs")
    options = parser.parse_args()
    rounds, sizes = options.rounds, [int(size) for size in options.sizes.split(",")]
    scenes = 1000
    if options.quick:
        rounds, sizes, scenes = 1, sizes[:1], 100
    marsyard = study.Marsyard(options.marsyard, options.work, options.threads)
    trainings = Trainings(marsyard)
    quickstart = marsyard.corpus("quickstart", QUICKSTART, [], scenes, 10)
    mixed = {size: marsyard.corpus(f"mixed-{size}", held_out.CONFIG, [], size, held_out.PER_SHARD) for size in sizes}
    found = {}

    def note(name, value):
        found.setdefault(name, []).append(value)

    passes = lambda epochs: [f"epochs={epochs}", "patience=100000"]
    unseen = [f"validate_every={NEVER}"]
    for round_number in range(rounds):
        study.note(f"round {round_number + 1} of {rounds}")
        note("one core", trainings.timed("one", quickstart, 1, core=CORES[0])[0])
        wall_s, cpu_s = trainings.timed("two", quickstart, 2)
        note("two threads", wall_s), note("two threads, CPU", cpu_s)
        note("one thread, two cores", trainings.timed("ahead", quickstart, 1)[0])
        note("two at once", trainings.at_once(quickstart))
        for scores in ("true", "false"):
            took = [trainings.timed("scores", quickstart, 1, [*passes(n), *unseen, f"network.normal_scores={scores}"])[1] for n in (1, 3)]
            note(f"two passes, scores {scores}", took[1] - took[0])
        for size, place in mixed.items():
            note(f"looks {size}", trainings.timed("looks", place, 1, passes(3))[1])
            note(f"no looks {size}", trainings.timed("looks", place, 1, [*passes(3), *unseen])[1])
    took = {name: median(values) for name, values in found.items()}
    learnt = 2 * rows_to_learn(quickstart)
    rate = {scores: learnt / took[f"two passes, scores {scores}"] for scores in ("true", "false")}
    pairs = lambda one, other: median(a / b for a, b in zip(found[one], found[other]))
    threads = [["one core", f"{took['one core']:.1f}", "1"],
               ["two cores, `--threads 1`, which reads ahead on a thread of its own", f"{took['one thread, two cores']:.1f}", f"{pairs('one core', 'one thread, two cores'):.2f}"],
               ["two cores, `--threads 2`", f"{took['two threads']:.1f}", f"{pairs('one core', 'two threads'):.2f}"],
               ["two trainings at once, each on a core", f"{took['two at once']:.1f}", f"{2 * pairs('one core', 'two at once'):.2f}"]]
    looks = [[size, f"{took[f'looks {size}']:.1f}", f"{took[f'no looks {size}']:.1f}", f"{took[f'looks {size}'] - took[f'no looks {size}']:.2f}",
              f"{100 * (1 - pairs(f'no looks {size}', f'looks {size}')):.0f} %"] for size in mixed]
    text = f"""# What a training takes

{marsyard.version()}, {platform.machine()}; `python scripts/train_costs.py`. Medians of {rounds} interleaved rounds; what is measured is said at the head of the script.

## quickstart.yaml by default

{took['two threads, CPU']:.1f} s of CPU with `--threads 2`.

{study.markdown(["", "wall s", "times as fast as one core"], threads)}

## Normal scores

Of a pass over quickstart.yaml, thousand rows a CPU second: {rate['true'] / 1e3:.0f} with normal scores, {rate['false'] / 1e3:.0f} without.

## Looks at the validation split

Three passes over mixed.yaml, CPU seconds.

{study.markdown(["scenes", "looks as usual", "first and last look alone", "looks", "share"], looks)}
"""
    results = {"version": marsyard.version(), "rounds": rounds, "seconds": found, "thousand_rows_a_cpu_s": {name: value / 1e3 for name, value in rate.items()}}
    study.write_results(options.out, "train_costs", results, text)


if __name__ == "__main__":
    main()
