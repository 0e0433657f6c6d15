"""The summary, tables and figure of compare_classifiers.py; tables and figure also from finished results:

    python scripts/compare_report.py scripts/results/compare_classifiers.json docs/classifiers.png
"""

import json
import pathlib
import sys

import numpy as np

import study
from compare_measures import Bootstrap, interval
from train_rows import DEFAULT_NETWORK, NETWORK, SQUARED_NETWORK

SIZES = {False: "small", True: "full"}
MEANS = ["auc", "log_loss", "calibration_error", "cpu_s", "judge_us", "parameters", "bytes", "train_rows", "rounds"]


def summary(runs, families, network_bytes):
    """One line a classifier and size: means over the seeds, intervals over scenes and seeds, differences to the default network of the same size.

    `network_bytes`: of marsyard's files, by network and the form that it takes."""
    bootstrap, lines = Bootstrap(families, {run["seed"] for run in runs}), []
    for full, size in SIZES.items():
        of = {name: [run for run in runs if run["classifier"] == name and run["full"] == full] for name in dict.fromkeys(run["classifier"] for run in runs)}
        resampled = {name: bootstrap.by_seed(found) for name, found in of.items() if found}
        for name, rates in resampled.items():
            line = {"classifier": name, "size": size, "form": of[name][0]["form"], "seeds": len(of[name])}
            for key in MEANS:
                values = [run[key] for run in of[name] if run.get(key) is not None]
                line[key] = float(np.mean(values)) if values else None
            line["bytes"] = network_bytes.get((name, line["form"]), line["bytes"])
            for rate in ("balanced_accuracy", "missed", "false", "precision", "worst_family", "mean_of_families"):
                line[rate] = interval(rates[rate])
            line["families"] = {family: interval(of_family) for family, of_family in rates["families"].items()}
            line["less_network"] = {rate: interval(rates[rate] - resampled[DEFAULT_NETWORK][rate]) for rate in ("worst_family", "mean_of_families")}
            line["each_seed"] = [float(bootstrap.rates(run)["balanced_accuracy"][0]) for run in of[name]]
            lines.append(line)
    return lines


def ranged(entry, digits=2):
    """{value, low, high} -> `95.31 (94.80 to 95.77)`, in percent."""
    return f"{study.percent(entry['value'], digits)} ({study.percent(entry['low'], digits)} to {study.percent(entry['high'], digits)})"


def signed(entry):
    return "-" if entry is None else f"{100 * entry['value']:+.2f} ({100 * entry['low']:+.2f} to {100 * entry['high']:+.2f})"


def decimal(value, digits):
    return "-" if value is None else f"{value:,.{digits}f}"


def of_size(lines, size):
    return sorted((line for line in lines if line["size"] == size), key=lambda line: -line["worst_family"]["value"])


def side_by_side(lines, families):
    """Both sizes in a row, led by the full one."""
    by = {(line["classifier"], line["size"]): line for line in lines}
    names = dict.fromkeys(line["classifier"] for size in ("full", "small") for line in of_size(lines, size))
    rates = ["worst_family", "mean_of_families"] if families > 1 else ["worst_family"]
    word = {"worst_family": "worst family" if families > 1 else "balanced accuracy", "mean_of_families": "mean of families"}
    head = ["balanced accuracy %"]
    for size in SIZES.values():
        head += [told for rate in rates for told in (f"{size}: {word[rate]}", f"{size}: {word[rate]} less the default network's")]
    rows = []
    for name in names:
        row = [name]
        for size in SIZES.values():
            line = by.get((name, size))
            for rate in rates:
                row += [ranged(line[rate]) if line else "-", signed(line["less_network"][rate]) if line and name != DEFAULT_NETWORK else "-"]
        rows.append(row)
    return study.markdown(head, rows)


def details(lines, size):
    head = ["all test cells", "rows", "seeds", "missed %", "false %", "precision %", "AUC", "calibration error %", "log loss", "CPU s to train", "us a cell to judge",
            "parameters", "bytes", "rounds, passes or rows", "form of the columns"]  # fmt: skip
    rows = []
    for line in of_size(lines, size):
        rows.append([line["classifier"], decimal(line["train_rows"], 0), line["seeds"], ranged(line["missed"]), ranged(line["false"]), ranged(line["precision"]),
                     decimal(line["auc"], 4), study.percent(line["calibration_error"]), decimal(line["log_loss"], 4), decimal(line["cpu_s"], 1),
                     decimal(line["judge_us"], 2), decimal(line["parameters"], 0), decimal(line["bytes"], 0), decimal(line["rounds"], 0), line["form"]])  # fmt: skip
    return study.markdown(head, rows)


def by_family(lines, size):
    families = list(lines[0]["families"])
    rows = [[line["classifier"], *(study.percent(line["families"][family]["value"]) for family in families)] for line in of_size(lines, size)]
    return study.markdown(["balanced accuracy %", *families], rows)


def tried_forms(trials, names):
    """What each form gave on validation rows, and the two best of each on all rows."""
    rows = []
    for classifier in sorted({run["classifier"] for run in trials}):
        small, full = ({run["form"]: run["validation_balanced_accuracy"] for run in trials if run["classifier"] == classifier and run["full"] == size} for size in (False, True))
        rows.append([classifier, *(study.percent(small.get(name)) + (f"; {study.percent(full[name])}" if name in full else "") for name in names)])
    return study.markdown(["balanced accuracy % on validation rows", *names], rows)


def corpus_part(name, found):
    about, lines = found["about"], found["summary"]
    families = len(lines[0]["families"])
    count = lambda split: f"{about[split]['rows']:,} rows of {about[split]['scenes']} scenes"
    rows = next(iter(about["networks"].values()))["rows"]
    differ = lambda measure: max(network["differences"][measure] for network in about["networks"].values())
    parts = [
        f"## {name}: configs/{about['config']}, {about['scenes']} scenes",
        f"Training: {count('train')} ({about['train']['untraversable']:,} untraversable). Stopping, form and threshold: {count('validation')}. Test: {count('test')} "
        f"({about['test']['untraversable']:,} untraversable), corpus_id {about['test']['corpus_id'][:12]}. {len(about['columns'])} columns: {', '.join(about['columns'])}. "
        f"Networks through onnxruntime, judged by this script on {rows:,} test rows, differ from `marsyard evaluate` by "
        f"{differ('auc'):.1e} in AUC and {differ('balanced_accuracy'):.1e} in balanced accuracy at most.",
        side_by_side(lines, families),
    ]
    for size in ("small", "full"):
        parts += [f"### {name}, {size}", details(lines, size)]
        if families > 1:
            parts.append(by_family(lines, size))
    return parts + [f"### {name}: forms tried on the small rows of seed 1; the two best on all rows", tried_forms(found["trials"], about["forms"])]


def tables(results):
    versions = ", ".join(version if version.startswith(name) else f"{name} {version}" for name, version in results["versions"].items())
    later = "".join(f" Measured on {of['date']} (`--kept`): {', '.join(of['classifiers'])}; the others before." for of in results.get("added", []))
    head = [
        "# Classifiers on equal inputs",
        "`python scripts/compare_classifiers.py`, whose head says what is equal and how it is chosen. In brackets: 95 % of 2000 resamples of the test scenes and of the seeds, of the "
        "mean over seeds. Calibration error (15 bins of equal mass) and log loss are of a world of equal classes, as all were trained for. Times are CPU time of one "
        f"thread on a machine with other work.{later} {versions}. The measures differ from scikit-learn's by at most {max(results['check_on_scikit_learn'].values()):.0e}.",
    ]
    return "\n\n".join(head + [part for name, found in results["corpora"].items() for part in corpus_part(name, found)]) + "\n"


def figure(corpora, path):
    """The balanced error of each classifier, small and full, with its intervals."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    import matplotlib.ticker

    plt.rcParams.update({"font.family": "DejaVu Sans", "font.size": 9, "svg.hashsalt": "marsyard"})
    panels, axes = plt.subplots(1, len(corpora), figsize=(3.6 * len(corpora) + 1.6, 4.2), sharey=True, squeeze=False)
    # In the order of the first corpus; what it lacks comes last.
    names = list(dict.fromkeys(line["classifier"] for found in corpora.values() for size in ("full", "small") for line in of_size(found["summary"], size)))
    for axis, (name, found) in zip(axes[0], corpora.items()):
        for line in found["summary"]:
            full = line["size"] == "full"
            y = names.index(line["classifier"]) + (-0.15 if full else 0.15)
            colour = "#c2571a" if line["classifier"] in (DEFAULT_NETWORK, NETWORK, SQUARED_NETWORK) else "#4a5a6a"
            error = {key: 100 * (1 - value) for key, value in line["worst_family"].items()}
            axis.plot([error["high"], error["low"]], [y, y], color=colour, linewidth=1.2, zorder=1)
            axis.scatter([error["value"]], [y], s=24, color=colour, facecolor=colour if full else "white", linewidth=1.1, zorder=2)
        several = len(found["summary"][0]["families"]) > 1
        axis.set_title(f"{name}: worst held-out family" if several else name, fontsize=10)
        axis.set_xscale("log")
        axis.set_xlabel("balanced error, %")
        ticks = [tick for tick in (0.5, 1, 2, 3, 5, 7, 10, 15, 20, 25, 30, 40) if axis.get_xlim()[0] <= tick <= axis.get_xlim()[1]]
        axis.xaxis.set_major_locator(matplotlib.ticker.FixedLocator(ticks))
        axis.xaxis.set_major_formatter(matplotlib.ticker.FormatStrFormatter("%g"))
        axis.xaxis.set_minor_locator(matplotlib.ticker.NullLocator())
        axis.grid(axis="x", color="#dddddd", linewidth=0.7)
        axis.set_axisbelow(True)
        axis.spines[["top", "right", "left"]].set_visible(False)
        axis.tick_params(axis="y", length=0)
    axes[0][0].set_yticks(range(len(names)), names)
    axes[0][0].invert_yaxis()
    marks = [axes[0][0].scatter([], [], s=24, color="#4a5a6a", facecolor=face, linewidth=1.1) for face in ("#4a5a6a", "white")]
    panels.tight_layout(rect=(0, 0.06, 1, 1))
    panels.legend(marks, ["full size", "some 20,000 training rows"], loc="lower center", ncols=2, frameon=False)
    panels.savefig(path, dpi=150, metadata={"Software": None} if str(path).endswith("png") else {"Date": None})


if __name__ == "__main__":
    results = json.loads(pathlib.Path(sys.argv[1]).read_text())
    pathlib.Path(sys.argv[1]).with_suffix(".md").write_text(tables(results))
    figure(results["corpora"], sys.argv[2])
