"""The page and the chart of time_to_error.py; also from finished results:

    python scripts/timed_report.py scripts/results/time_to_error.json

In: what was measured, by corpus, engine and seed: at each budget CPU seconds, error on validation and error on test of the look that is best by then. Out: a table a corpus, who errs less than
marsyard at equal CPU, with which seeds and on which days it was measured; and error against CPU seconds as a chart.
"""

import json
import pathlib
import sys

import numpy as np

import study
from timed_engines import CLAIMED, ENGINES, MEMBERS, readable
from timed_learners import FINE_ROWS, best, thinned

#: What --kept has learn once more, for how long, and rows from look to look: those of its own rows in the first seconds.
CALIBRATED, CALIBRATION_S, CALIBRATION_ROWS = "marsyard, squared, two of 64-64", 5, FINE_ROWS


def markdown(about, kept, corpora, seeds):
    text = (f"# What error a CPU second buys\n\n`{about['command']}`, {about['marsyard']}, torch {about['torch']}, LightGBM {about['lightgbm']}; one thread each. "
            f"Weighted mean squared error on test scenes, thousandths; {'seed ' + str(seeds[0]) if len(seeds) == 1 else 'medians of seeds ' + ', '.join(map(str, seeds)) + ', ranges in brackets'}. What is compared, and how it is "
            f"counted, is said at the head of the script. CPU seconds of this machine, beside other work.\n")
    for name in corpora:
        of = about["corpora"][name]
        text += f"\n## {name}.yaml\n\n{of['rows']:,} rows of {of['scenes']} scenes to learn, {of['test_rows']:,} rows to judge, {of['columns']} columns (corpus_id {of['corpus_id'][:12]}{', kept of `' + of['command'] + '`' if 'command' in of else ''}).{measured_when(kept, name, seeds)}{fewer_seeds(kept, name, seeds)}\n\n"
        text += table(kept, name, seeds, of["columns"]) + "\n\n" + calibration(kept, name)
        for engine in CLAIMED:
            text += f"Less than {engine}, {ENGINES[engine].weights(of['columns'], None)} weights, err at equal CPU (percent by which its error is above theirs):\n\n{ahead_of(kept, name, seeds, engine)}\n\n"
        settings = {engine: kept["settings"].get(f"{name}/{engine}") for engine, of_engine in ENGINES.items() if len(of_engine.settings) > 1}
        text += ("Settings of an earlier search: " if about["settings"] else "Settings, of rows taken over those that they had: " if "again" in kept else "Settings found: ") + "; ".join(f"{engine}: {chosen_of(engine, k)}" for engine, k in settings.items() if k is not None) + ".\n"
    return text


def table(kept, name, seeds, columns):
    """A row an engine, a column a budget that anybody had."""
    of = of_corpus(kept, name, seeds)
    budgets = budgets_of(of)
    rows = [[engine, ENGINES[engine].weights(columns, kept["settings"].get(f"{name}/{engine}")), *(median_and_range(runs, budget) for budget in budgets)] for engine, runs in of.items()]
    return study.markdown(["learnt by", "weights", *(f"{budget} CPU s" for budget in budgets)], rows)


def median_and_range(runs, budget):
    """The median of those that had a look by then, and their range; how many they are, where others had none."""
    learnt = [run[str(budget)] for run in runs.values() if str(budget) in run]
    found = [1000 * look[2] for look in learnt if look]
    if not found:
        return "-"
    spread = f" ({min(found):.2f} to {max(found):.2f})" if len(found) > 1 else ""
    return f"{np.median(found):.2f}{spread}{f' ({len(found)} of {len(learnt)})' if len(found) < len(learnt) else ''}"


def of_corpus(kept, name, seeds):
    """By engine: what was measured, by seed."""
    return {engine: {seed: run for seed in seeds if (run := kept["runs"].get(f"{name}/{engine}/{seed}"))} for engine in ENGINES}


def budgets_of(runs):
    """Those that anybody had."""
    return sorted({int(budget) for of in runs.values() for run in of.values() for budget in run})


def measured_when(kept, name, seeds):
    """By seed the day on which most was measured, and what is of another."""
    told = []
    for seed in seeds:
        of = {}
        for engine in ENGINES:
            if date := kept.get("dates", {}).get(f"{name}/{engine}/{seed}"):
                of.setdefault(date, []).append(engine)
        if of:
            most = max(of, key=lambda date: len(of[date]))
            others = "".join(f"; but on {date}: {', '.join(repr(engine) for engine in of[date])}" for date in sorted(of) if date != most)
            told.append(f"Seed {seed} was measured on {most}{others}.")
    return "".join(f" {of}" for of in told)


def fewer_seeds(kept, name, seeds):
    """At which budgets not all engines learnt with all seeds."""
    runs, told = of_corpus(kept, name, seeds), []
    for budget in budgets_of(runs):
        of = {}
        for engine, by_seed in runs.items():
            of.setdefault(tuple(seed for seed, run in by_seed.items() if str(budget) in run), []).append(engine)
        most = max(of, key=lambda having: len(of[having]))
        if set(of) != {tuple(seeds)}:
            seeds_of = lambda having: f"seed{'s' * (len(having) > 1)} {', '.join(map(str, having))}" if having else "no seed"
            others = "".join(f"; of {seeds_of(having)}: {', '.join(map(repr, engines))}" for having, engines in of.items() if having != most)
            told.append(f" At {budget} CPU s rows are of {seeds_of(most)}{' alone' * (most != tuple(seeds))}{others}.")
    return "".join(told)


def calibration(kept, name):
    """What one engine found when it learnt once more, by day."""
    return "".join(calibrated(kept, name, again) for again in kept.get("again", {}).get(name, []))


def calibrated(kept, name, again):
    """Looks after the same rows have all but the same errors (a look ends a batch), so that their CPU seconds can be compared."""
    former = {budget: look for budget, look in kept["runs"][f"{name}/{CALIBRATED}/{again['seed']}"].items() if int(budget) <= CALIBRATION_S}
    apart = lambda look, other: max(abs(look[k] / other[k] - 1) for k in (1, 2))
    nearest = [(look, min(again["looks"], key=lambda other: apart(look, other))) for look in former.values() if look]
    ratios = [other[0] / look[0] for look, other in nearest if apart(look, other) < 3e-3]
    errors = [best(thinned(again["looks"], int(budget)), int(budget)) for budget in former]
    return (f"{CALIBRATED}, once more on {again['date']}, beside other work as the rows of that day, and looked at every {CALIBRATION_ROWS:,} rows: "
            f"{', '.join(f'{1000 * look[2]:.2f}' for look in errors)} at {', '.join(former)} CPU s{f'; the same rows took {np.median(ratios):.2f} times the CPU seconds' if ratios else ''}.\n\n")


def ahead_of(kept, name, seeds, engine):
    """By budget: which peers err less than this engine, the least first; medians over the seeds with which both had a look."""
    runs, found = of_corpus(kept, name, seeds), []
    errors = lambda other, budget: {seed: run[str(budget)][2] for seed, run in runs[other].items() if run.get(str(budget))}
    for budget in budgets_of({engine: runs[engine]}):
        own, peers = errors(engine, budget), []
        for other in ENGINES:
            common = own.keys() & errors(other, budget).keys()
            if not other.startswith("marsyard") and common:
                of_own, of_other = (np.median([errors(which, budget)[seed] for seed in common]) for which in (engine, other))
                peers.append((of_own / of_other, other))
        told = "; ".join(f"{other} {100 * (ratio - 1):.1f}" for ratio, other in sorted(peers, reverse=True) if ratio > 1) or "no peer"
        asked = sum(str(budget) in run for run in runs[engine].values())
        lacking = f" (in {asked - len(own)} of {asked} trainings it had no look by then, which are left out)" if own and len(own) < asked else ""
        found.append(f"- {budget} CPU s{lacking}: {told if own else 'it had no look by then'}.")
    return "\n".join(found)


def chosen_of(engine, k):
    inputs, setting = ENGINES[engine].choices()[k]
    return f"{readable(setting)}, {inputs}"


def chart(kept, corpora, seeds, path):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.ticker import MaxNLocator, ScalarFormatter

    plt.rcParams["svg.hashsalt"] = "marsyard"
    figure, axes = plt.subplots(1, len(corpora), figsize=(5.2 * len(corpora) + 2.4, 4.4), squeeze=False, layout="constrained")
    colours = [*plt.get_cmap("tab20").colors, *plt.get_cmap("tab20b").colors[::4]]
    # Of the default's size: told from all others at a glance.
    dark = dict(zip(MEMBERS, ("black", "crimson")))
    for axis, name in zip(axes[0], corpora):
        of = of_corpus(kept, name, seeds)
        budgets = budgets_of(of)
        for k, (engine, runs) in enumerate(of.items()):
            looks = {budget: [1000 * run[str(budget)][2] for run in runs.values() if run.get(str(budget))] for budget in budgets}
            points = [(budget, np.median(errors)) for budget, errors in looks.items() if errors]
            if points:
                is_own = engine.startswith("marsyard")
                width, dash = 2.2 if is_own else 1.1, "--" if engine.startswith("LightGBM") else ":" if engine in dark else "-"
                axis.plot(*zip(*points), marker="o", ms=3, lw=1.8 if engine in dark else width, ls=dash, color=dark.get(engine, colours[k]), label=engine)
        lowest = min(line.get_ydata().min() for line in axis.lines)
        highest = max(line.get_ydata().max() for line in axis.lines)
        axis.set(xscale="log", yscale="log", title=f"{name}.yaml", xlabel="CPU seconds of learning", ylabel="weighted error on test scenes, thousandths")
        # What errs twice as much is cut off: a peer that has hardly begun would squeeze all others together.
        axis.set_ylim(0.97 * lowest, min(2 * lowest, 1.03 * highest))
        axis.set_xticks(budgets, map(str, budgets))
        axis.minorticks_off()
        axis.yaxis.set_major_locator(MaxNLocator(8))
        axis.yaxis.set_major_formatter(ScalarFormatter())
        axis.grid(True, which="both", lw=0.3)
    # All corpora have the first one's engines, or fewer.
    figure.legend(*axes[0][0].get_legend_handles_labels(), loc="outside right upper", fontsize=8)
    figure.savefig(path, metadata={"Date": None})


def main():
    path = pathlib.Path(sys.argv[1])
    kept = json.loads(path.read_text())
    about = kept["about"]
    path.with_suffix(".md").write_text(markdown(about, kept, list(about["corpora"]), about["seeds"]))
    chart(kept, list(about["corpora"]), about["seeds"], path.with_suffix(".svg"))


if __name__ == "__main__":
    main()
