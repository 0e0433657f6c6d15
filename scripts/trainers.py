"""The default trainer beside the Kalman filter on every shipped config but mixed.yaml (that one: learning_curve.py): accuracy, CPU, bytes.

Each config is generated as it is shipped (paper.yaml with 2000 scenes), trained by `train`'s defaults and by configs/train/ekf.yaml (16-16
neurons), three times each, and judged on scenes of another seed that no build has.

    cargo build --release && python scripts/trainers.py            # some 15 minutes on 2 cores

Needs numpy and pyarrow.
"""

import argparse
import json
import platform

import numpy as np

import held_out
import study
import unseen

#: Config: overrides, scenes to judge on, and what trainings set.
CONFIGS = {
    "quickstart": ([], 400, []),
    "paper": (["scenes=2000", "scenes_per_shard=50"], 400, []),
    "mars": ([], 50, []),
    "holes": ([], 150, ["features=seen+unseen"]),
}
TRAINERS = {"default": None, "Kalman filter": study.ROOT / "configs" / "train" / "ekf.yaml"}
SEEDS = (1, 2, 3)


def trained(marsyard, name, place, title, config, sets):
    """Networks of a trainer, mean CPU seconds and rows learnt."""
    runs, cpu, rows = [], [], []
    for seed in SEEDS:
        run = marsyard.work / "runs" / f"{name}-{title.replace(' ', '-')}-{seed}"
        kept = run.with_suffix(".json")
        if not kept.exists():
            study.note(f"{name}, {title}, seed {seed}")
            asked = ["--config", config] if config else []
            kept.write_text(json.dumps(marsyard.cpu_s("train", place, "--out", run, "--seed", seed, *asked, *study.overrides(sets))))
        runs.append(held_out.network(marsyard, run))
        cpu.append(json.loads(kept.read_text()))
        rows.append(json.loads((run / "training.json").read_text())["rows_learnt"])
    return runs, float(np.mean(cpu)), float(np.mean(rows))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    study.add_arguments(parser, "trainers")
    parser.add_argument("--only", choices=CONFIGS, action="append", help="one config (repeatable); the rows of the others stay")
    options = parser.parse_args()
    marsyard = study.Marsyard(options.marsyard, options.work, options.threads)
    kept = options.out / "trainers.json"
    results = json.loads(kept.read_text()) if kept.exists() else {}
    for name in options.only or CONFIGS:
        sets, scenes, training = CONFIGS[name]
        place = marsyard.shipped(name, sets)
        yards = base = None
        for title, config in TRAINERS.items():
            models, cpu_s, learnt = trained(marsyard, name, place, title, config, training)
            if yards is None:
                yards = unseen.Yards(marsyard, name, [], models[0]["about"]["features"], scenes)
            accuracy = yards.accuracy(models)
            base = base or accuracy
            lead = held_out.told_difference(base, accuracy) if title != "default" else ""
            results.setdefault(name, {})[title] = {"accuracy": held_out.interval(accuracy), "lead": lead, "train_cpu_s": cpu_s, "rows_learnt": learnt}
    rows = [[name, title, f"{of['rows_learnt'] * 1e-3:.0f}", f"{of['train_cpu_s']:.1f}", held_out.told_interval(of["accuracy"]), of["lead"]]
            for name in CONFIGS if name in results for title, of in results[name].items()]
    head = ["config", "trainer", "rows learnt, thousands", "CPU s, train", "balanced accuracy, %", "the default's lead, points"]
    text = f"""# The default trainer beside the Kalman filter

{marsyard.version()}, {platform.machine()}; `python scripts/trainers.py`: {len(SEEDS)} trainings each, judged on scenes of another seed. Intervals: 95 %,
over scenes and trainings, differences in pairs. CPU seconds of this machine, of a config's rows at one time. mixed.yaml: [learning_curve.md](learning_curve.md).

{study.markdown(head, rows)}
"""
    study.write_results(options.out, "trainers", results, text)


if __name__ == "__main__":
    main()
