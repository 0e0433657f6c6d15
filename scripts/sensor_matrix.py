"""Trained with one sensor, judged with another: the whole matrix.

Hewitt, Ellery & de Ruiter 2017, "Outdoor tests", train on one scan pattern and judge scans of others without retraining (A66 in docs/paper.md).

Usage:  cargo build --release
        python scripts/sensor_matrix.py [--scenes 160] [--seeds 1,2,3] [--quick] [--figure docs/sensor-matrix.png]

The same yards are built once for every sensor under configs/sensors: the training families of configs/mixed.yaml, with their own rovers,
drives and draws, and with one sensor in all of them. Then the default network is trained on each sensor's train split, and judged on
every sensor's test split. The test yards are the same for all sensors and in no train split, so that columns differ by the sensor alone.
Two more rows: trained on all sensors together, and on all but the one it is judged on. Beside them one height-difference threshold,
tuned on the judged sensor's own validation split: a baseline that knows the sensor. Calls are made at 0.5.

Needs numpy, and matplotlib for the figure. Writes sensor_matrix.json and sensor_matrix.md into scripts/results.
"""

import argparse
import pathlib

import held_out
import study

ALL, OTHERS, HEIGHT = "all", "all but it", "height threshold"


def corpus_sets(sensor):
    """Overrides of configs/mixed.yaml: one sensor in all training families, and nothing of the families that are held out."""
    trained = range(len(held_out.TRAINING))
    none = [f"families.{len(trained) + k}.weight={held_out.NONE}" for k in range(len(held_out.FAMILIES))]
    return [f"families.{k}.sweep.sensor={sensor}" for k in trained] + none


def rates(report, panel="network"):
    """What is kept of a report: by cells and by points, all cells and those of three points or more."""
    kept = {}
    for group in report["groups"]:
        name = {"all": "all"}.get(group["group"]) if isinstance(group["group"], str) else None
        name = name or ("three" if "points" in group["group"] else None)
        if name is None:
            continue
        at = group[panel]["at"][0]
        kept[name] = {
            "auc": group[panel]["auc"],
            "balanced_accuracy": at["cells"]["balanced_accuracy"],
            "missed_untraversable": at["cells"]["missed_untraversable"],
            "false_untraversable": at["cells"]["false_untraversable"],
            "missed_points": at["points"]["missed_untraversable"],
            "false_points": at["points"]["false_untraversable"],
        }
    return kept


def over_seeds(seeds):
    """[{group: {rate: x}}] -> {group: {rate: {mean, sd, seeds}}}."""
    first = seeds[0]
    return {g: {r: study.mean_spread([s[g][r] for s in seeds]) for r in first[g]} for g in first}


def table(sensors, rows, matrix, group, rate):
    head = ["trained on / judged on", *sensors]
    body = [[row, *[study.percent(matrix[row][s][group][rate]["mean"], 1) for s in sensors]] for row in rows]
    return study.markdown(head, body)


def figure(sensors, rows, matrix, path):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    import numpy as np

    values = np.array([[100 * matrix[row][s]["all"]["balanced_accuracy"]["mean"] for s in sensors] for row in rows])
    shape, axes = plt.subplots(figsize=(8.4, 6.6))
    picture = axes.imshow(values, cmap="viridis", vmin=70, vmax=100, aspect="auto")
    axes.set_xticks(range(len(sensors)), sensors, rotation=35, ha="right")
    axes.set_yticks(range(len(rows)), rows)
    axes.set_xlabel("judged on the scans of")
    axes.set_ylabel("trained on the scans of")
    axes.axhline(len(sensors) - 0.5, color="white", linewidth=3)
    for (row, column), value in np.ndenumerate(values):
        axes.text(column, row, f"{value:.0f}", ha="center", va="center", color="white" if value < 86 else "black")
    shape.colorbar(picture, label="balanced accuracy by cells, %")
    axes.set_title("The same yards through other eyes", fontsize=11)
    shape.tight_layout()
    shape.savefig(path, dpi=110)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    study.add_arguments(parser, "sensor-matrix")
    parser.add_argument("--config", default=study.ROOT / "configs" / "mixed.yaml", type=pathlib.Path)
    parser.add_argument("--scenes", default=160, type=int, help="yards, the same for each sensor (default 160)")
    parser.add_argument("--seeds", default="1,2,3", help="of the networks (default 1,2,3)")
    parser.add_argument("--no-others", action="store_true", help="leave out the row that is trained on all but the judged sensor")
    parser.add_argument("--figure", type=pathlib.Path, help="draw the matrix into this file (PNG or SVG)")
    arguments = parser.parse_args()
    seeds = [1] if arguments.quick else [int(seed) for seed in arguments.seeds.split(",")]
    scenes = 20 if arguments.quick else arguments.scenes
    marsyard = study.Marsyard(arguments.marsyard, arguments.work, arguments.threads)

    sensors = sorted(path.stem for path in (arguments.config.parent / "sensors").glob("*.yaml"))
    per_shard = max(scenes // 20, 1)
    corpora = {s: marsyard.corpus(s, arguments.config, corpus_sets(s), scenes, per_shard) for s in sensors}

    found = {}  # (row, column) -> one report a seed
    for seed in seeds:
        for row in sensors:
            run = marsyard.train(row, [corpora[row]], seed, study.KALMAN_FILTER)
            for column in sensors:
                report = marsyard.evaluate(run, corpora[column], f"on-{column}")
                found.setdefault((row, column), []).append(rates(report))
                if row == column:
                    found[HEIGHT, column] = [rates(report, "height_difference")]
        run = marsyard.train(ALL, list(corpora.values()), seed, study.KALMAN_FILTER)
        for column in sensors:
            found.setdefault((ALL, column), []).append(rates(marsyard.evaluate(run, corpora[column], f"on-{column}")))
    for seed in [] if arguments.no_others else seeds:
        for column in sensors:
            run = marsyard.train(f"without-{column}", [corpora[s] for s in sensors if s != column], seed, study.KALMAN_FILTER)
            found.setdefault((OTHERS, column), []).append(rates(marsyard.evaluate(run, corpora[column], f"on-{column}")))

    rows = [*sensors, ALL, *([] if arguments.no_others else [OTHERS]), HEIGHT]
    matrix = {row: {column: over_seeds(found[row, column]) for column in sensors} for row in rows}
    of = lambda row, column: matrix[row][column]["all"]["balanced_accuracy"]["mean"]
    own = study.mean_spread([of(s, s) for s in sensors])
    foreign = study.mean_spread([of(r, c) for r in sensors for c in sensors if r != c])
    worst = min((of(r, c), r, c) for r in sensors for c in sensors)
    largest_sd = max(matrix[r][c]["all"]["balanced_accuracy"]["sd"] or 0.0 for r in rows for c in sensors)
    means = {row: study.mean_spread([of(row, c) for c in sensors])["mean"] for row in rows}

    text = f"""# Trained with one sensor, judged with another

`python scripts/sensor_matrix.py --scenes {scenes} --seeds {','.join(map(str, seeds))}`: {scenes} yards of the training families of
`configs/mixed.yaml`, the same for all sensors; trained by the Kalman filter; mean of {len(seeds)} seeds; at 0.5, by cells, percent. The largest standard
deviation of any balanced accuracy over seeds is {study.percent(largest_sd)} points; 15 in 100 yards are for testing, so that a column as a whole may
be a few points easier or harder than another set of yards would be.

Balanced accuracy, all cells:

{table(sensors, rows, matrix, "all", "balanced_accuracy")}

Balanced accuracy, cells of three points or more:

{table(sensors, rows, matrix, "three", "balanced_accuracy")}

`missed_untraversable`, all cells:

{table(sensors, rows, matrix, "all", "missed_untraversable")}

`false_untraversable`, all cells:

{table(sensors, rows, matrix, "all", "false_untraversable")}

- On its own sensor a network has {study.percent(own['mean'], 1)} % on average, on another one {study.percent(foreign['mean'], 1)} %; the worst pair is
  {worst[1]} judged on {worst[2]}: {study.percent(worst[0], 1)} %.
- Trained on all sensors: {study.percent(means[ALL], 1)} %; on all but the one judged: {study.percent(means.get(OTHERS), 1)} %.
- One tuned height threshold: {study.percent(means[HEIGHT], 1)} %.
- Sensors differ in more than pattern: in reach, in the share of cells of one or two points, and so in how hard their cells are. Compare within a
  column.
"""
    results = {
        "versions": study.versions(marsyard), "scenes": scenes, "seeds": seeds, "threshold": 0.5, "sensors": sensors,
        "own_balanced_accuracy": own["mean"], "foreign_balanced_accuracy": foreign["mean"],
        "means": means, "matrix": matrix,
    }
    study.write_results(arguments.out, "sensor_matrix", results, text)
    if arguments.figure:
        figure(sensors, rows, matrix, arguments.figure)


if __name__ == "__main__":
    main()
