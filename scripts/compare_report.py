"""The tables and the figure of compare_classifiers.py; also from finished results:

    python scripts/compare_report.py scripts/results/compare_classifiers.json docs/classifiers.png
"""

import json
import pathlib
import sys

import numpy as np

MEASURES = [
    "balanced_accuracy", "auc", "mcc", "accuracy", "missed_untraversable", "false_untraversable", "balanced_accuracy_own_threshold",
]  # fmt: skip
COUNTS = ["tn", "fp", "fn", "tp"]
KEYS = ["split", "features", "weighted", "classifier", "judged_on"]
PRESETS = ["fine Gaussian SVM", "fine KNN", "complex tree"]
ORDER = ["network, all rows", "network", "network, stopped by few", *PRESETS, "medium Gaussian SVM", "gradient boosting"]


def key(run):
    return tuple("+".join(v) if isinstance(v, (list, tuple)) else v for v in (run[k] for k in KEYS))


def summary(runs):
    """Mean and sample standard deviation over the seeds; counts added up."""
    groups = {}
    for run in runs:
        groups.setdefault(key(run), []).append(run)
    found = []
    for group in groups.values():
        line = {k: group[0][k] for k in KEYS} | {"seeds": len(group), "train_rows": float(np.mean([r["train_rows"] for r in group]))}
        line["seconds"] = float(np.median([run["seconds"] for run in group]))
        for measure in MEASURES:
            values = [run[measure] for run in group if measure in run]
            if values:
                sd = float(np.std(values, ddof=1)) if len(values) > 1 else 0.0
                line[measure] = {"mean": float(np.mean(values)), "sd": sd, "each": values}
        line |= {count: sum(run[count] for run in group) for count in COUNTS}
        found.append(line)
    return found


def percent(value, digits=2):
    return f"{100 * value['mean']:.{digits}f} ± {100 * value['sd']:.{digits}f}" if value else "-"


def decimal(value):
    return f"{value['mean']:.4f} ± {value['sd']:.4f}" if value else "-"


def pick(lines, **wanted):
    found = [line for line in lines if all(line[k] == v for k, v in wanted.items())]
    place = lambda line: ORDER.index(line["classifier"]) if line["classifier"] in ORDER else len(ORDER)
    return sorted(found, key=place)


def main_table(lines):
    text = "| classifier | training rows | balanced accuracy % | AUC | MCC | accuracy % | missed untraversable % | false untraversable % | BA % at own threshold | CPU s to fit |\n"
    text += "|---|---|---|---|---|---|---|---|---|---|\n"
    for line in lines:
        cells = [
            line["classifier"], f"{line['train_rows']:,.0f}", percent(line["balanced_accuracy"]), decimal(line["auc"]), decimal(line["mcc"]),
            percent(line["accuracy"]), percent(line["missed_untraversable"]), percent(line["false_untraversable"]),
            percent(line.get("balanced_accuracy_own_threshold")), f"{line['seconds']:.2f}",
        ]  # fmt: skip
        text += "| " + " | ".join(cells) + " |\n"
    return text + "\n"


def verdict(lines):
    """The network against each preset, seed by seed."""
    of = {line["classifier"]: line for line in lines}
    text = ""
    for name in PRESETS:
        parts = []
        for measure, word in (("balanced_accuracy", "balanced accuracy"), ("auc", "AUC")):
            gap = np.array(of["network"][measure]["each"]) - np.array(of[name][measure]["each"])
            sd = gap.std(ddof=1) if len(gap) > 1 else 0.0
            parts.append(f"{word} {100 * gap.mean():+.2f} ± {100 * sd:.2f} points, ahead in {(gap >= 0).sum()} of {len(gap)} seeds")
        text += f"- network less {name}: {'; '.join(parts)}\n"
    return text + "\n"


def inflation(lines):
    text = "| classifier | weights | accuracy %, held-out cells | BA %, held-out cells | BA %, test scenes | BA inflated by | AUC, held-out cells | AUC, test scenes |\n"
    text += "|---|---|---|---|---|---|---|---|\n"
    for weighted in (True, False):
        for cells in pick(lines, split="cell", judged_on="held-out cells", weighted=weighted):
            (scenes,) = pick(lines, split="cell", judged_on="test scenes", weighted=weighted, classifier=cells["classifier"])
            gap = np.array(cells["balanced_accuracy"]["each"]) - np.array(scenes["balanced_accuracy"]["each"])
            gap = {"mean": gap.mean(), "sd": gap.std(ddof=1) if len(gap) > 1 else 0.0}
            row = [
                cells["classifier"], "yes" if weighted else "no", percent(cells["accuracy"]), percent(cells["balanced_accuracy"]),
                percent(scenes["balanced_accuracy"]), percent(gap), decimal(cells["auc"]), decimal(scenes["auc"]),
            ]  # fmt: skip
            text += "| " + " | ".join(row) + " |\n"
    return text + "\n"


def confusion(lines):
    text = "| classifier | weights | traversable called so | traversable called untraversable | untraversable called traversable | untraversable called so |\n"
    text += "|---|---|---|---|---|---|\n"
    for line in lines:
        negatives, positives = line["tn"] + line["fp"], line["fn"] + line["tp"]
        count = lambda n, of: f"{n:,} ({100 * n / of:.2f} %)"
        cells = [count(line["tn"], negatives), count(line["fp"], negatives), count(line["fn"], positives), count(line["tp"], positives)]
        text += f"| {line['classifier']} | {'yes' if line['weighted'] else 'no'} | " + " | ".join(cells) + " |\n"
    return text + "\n"


def ablation(lines):
    text = "| inputs of the network | balanced accuracy % | AUC | missed untraversable % | false untraversable % |\n|---|---|---|---|---|\n"
    kinds = ("network", "neighbours", "only", "without")
    lines = [line for line in lines if line["features"] != "full"]
    shown = [line for line in lines if line["classifier"].split()[0].rstrip(",") in kinds and not line["classifier"].startswith("network,")]
    rank = lambda line: (kinds.index(line["classifier"].split()[0]), -line["balanced_accuracy"]["mean"])
    for line in sorted(shown, key=rank):
        name = {
            "network": "all 14",
            "neighbours above the rover": "all 14, neighbours' heights above the rover as stored (`neighbours: above_rover`, the paper's)",
        }.get(line["classifier"], line["classifier"])
        cells = [name, percent(line["balanced_accuracy"]), decimal(line["auc"])]
        text += "| " + " | ".join(cells + [percent(line["missed_untraversable"]), percent(line["false_untraversable"])]) + " |\n"
    return text + "\n"


def tables(about, lines):
    scene = dict(split="scene", judged_on="test scenes")
    one = pick(lines, **scene, weighted=True, features="listed", classifier="network")[0]
    share = (one["fn"] + one["tp"]) / sum(one[count] for count in COUNTS)
    text = "# Classifiers on the same rows (figure 9 of the paper)\n\n"
    text += f"Corpus `{about['corpus']}`, {about['scenes']} scenes, corpus_id {about['corpus_id'][:12]}. About {about['rows']:,} training rows; judged on "
    text += f"{about['test_rows']:,} rows of the test split, {100 * share:.2f} % of them untraversable: who calls all of them traversable has an accuracy of "
    text += f"{100 - 100 * share:.2f} % and a balanced accuracy of 50 %. Mean ± standard deviation over {about['seeds']} seeds (other scenes, other initial "
    text += f"weights). Python {about['python']}, scikit-learn {about['scikit-learn']}, NumPy {about['numpy']}. Written by `scripts/compare_classifiers.py`, "
    text += "whose head says what each name means.\n\n"
    for features in ("listed", "full"):
        for weighted in (True, False):
            found = pick(lines, **scene, weighted=weighted, features=features)
            found = [line for line in found if line["classifier"] in ORDER]
            if found:
                text += f"## By scene, {features} features, {'with' if weighted else 'without'} class weights\n\n" + main_table(found) + verdict(found)
    text += "## Split by cell: what it inflates\n\nTrained on random cells of few scenes; the same models judged on the held-out cells of those scenes, and on the test split.\n\n"
    text += inflation(lines)
    text += "## Confusion matrices\n\nBy scene, listed features, counts of all seeds added up; per cent of the true class.\n\n"
    shown = [line for weighted in (True, False) for line in pick(lines, **scene, weighted=weighted, features="listed") if line["classifier"] in ORDER]
    text += confusion(shown)
    text += "## Features\n\nThe network on the same rows, by scene, with class weights.\n\n"
    text += ablation(pick(lines, **scene, weighted=True))
    return text + "Which settings were tried, on validation rows, stands in `compare_classifiers_notes.md`.\n"


def write(path, about, runs):
    """The results, a line a record, and the tables beside them."""
    lines = summary(runs)
    listed = lambda records: ",\n  ".join(map(json.dumps, records))
    text = f'{{\n "about": {json.dumps(about)},\n "summary": [\n  {listed(lines)}\n ],\n "runs": [\n  {listed(runs)}\n ]\n}}\n'
    path.write_text(text)
    path.with_suffix(".md").write_text(tables(about, lines))


def figure(lines, path):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    import matplotlib.ticker

    names = [name for name in ORDER if name != "network, stopped by few"]
    plt.rcParams.update({"font.family": "DejaVu Sans", "font.size": 10, "svg.hashsalt": "marsyard"})
    panels, axes = plt.subplots(1, 2, figsize=(9.6, 3.6), sharey=True)
    for axis, measure, title in zip(axes, ("balanced_accuracy", "auc"), ("balanced accuracy", "area under the ROC curve")):
        for place, name in enumerate(names):
            for weighted, shift, face in ((False, 0.17, "white"), (True, -0.17, None)):
                (line,) = pick(lines, split="scene", judged_on="test scenes", features="listed", weighted=weighted, classifier=name)
                colour = "#c2571a" if name.startswith("network") else "#4a5a6a"
                each, y = line[measure]["each"], place + shift
                axis.plot([min(each), max(each)], [y, y], color=colour, linewidth=1, zorder=1)
                axis.scatter(each, [y] * len(each), s=12, color=colour, facecolor=face or colour, linewidth=0.8, zorder=2)
                axis.plot([line[measure]["mean"]] * 2, [y - 0.16, y + 0.16], color=colour, linewidth=2.2, zorder=3)
        axis.set_title(title, fontsize=10)
        axis.grid(axis="x", color="#dddddd", linewidth=0.7)
        axis.set_axisbelow(True)
        axis.xaxis.set_major_locator(matplotlib.ticker.MaxNLocator(5))
        axis.spines[["top", "right", "left"]].set_visible(False)
        axis.tick_params(axis="y", length=0)
        axis.axhline(len(names) - 2.5, color="#bbbbbb", linewidth=0.7, linestyle=":")
    counts = {name: pick(lines, split="scene", features="listed", weighted=True, classifier=name)[0]["train_rows"] for name in names}
    axes[0].set_yticks(range(len(names)), [f"{name} ({counts[name]:,.0f})" if "all rows" in name else name for name in names])
    axes[0].invert_yaxis()
    for face, word in (("#4a5a6a", "with class weights"), ("white", "without")):
        axes[1].scatter([], [], s=12, color="#4a5a6a", facecolor=face, linewidth=0.8, label=word)
    axes[1].legend(loc="lower left", frameon=False, fontsize=9)
    panels.tight_layout()
    panels.savefig(path, dpi=150, metadata={"Software": None} if str(path).endswith("png") else {"Date": None})


if __name__ == "__main__":
    results = json.loads(pathlib.Path(sys.argv[1]).read_text())
    write(pathlib.Path(sys.argv[1]), results["about"], results["runs"])
    figure(summary(results["runs"]), sys.argv[2])
