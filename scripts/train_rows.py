"""Rows of a corpus in memory, and marsyard's network trained on any choice of them: what the studies in this folder share.

The network is that of configs/train/ekf.yaml where the settings name no filter.

The network is trained by the example `train_rows`, which learns by the trainer's own code on one thread:

    cargo build --release --example train_rows
"""

import json
import pathlib
import subprocess
import tempfile

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

import study

ROOT = pathlib.Path(__file__).resolve().parents[1]
TRAINER = ROOT / "target" / "release" / "examples" / "train_rows"
NEIGHBOURS = [f"neighbour_{place}_m" for place in ("sw", "s", "se", "w", "e", "nw", "n", "ne")]
LISTED = ["mean_height_m", "height_variance_m2", "height_difference_m", "point_count", "pitch_rad", "roll_rad", *NEIGHBOURS]
#: What tables call marsyard's networks: of the Kalman filter, of the trainer's defaults, and the same by the squared error.
NETWORK, DEFAULT_NETWORK, SQUARED_NETWORK = "network (EKF)", "network (default)", "network (squared)"


def settings_of(sets):
    """`key=value` each -> a value by key."""
    return dict(key.split("=", 1) for key in sets)


#: Settings of the trainer's default, and what makes it learn by the squared error.
DEFAULT = {"filter": "{kronecker: {}}", "allow_few_rows": "true"}
SQUARED = settings_of(study.SQUARED)


class Cells:
    """The labelled rows of one split, all or at most so many: then drawn at random from all scenes alike, by a seed of their own."""

    def __init__(self, corpus, split, names, at_most=0):
        files = sorted(pathlib.Path(corpus, "data", "cells").glob(f"{split}-*.parquet"))
        if not files:
            raise SystemExit(f"{corpus} has no {split} cells: build it with `marsyard generate`, with more scenes if it is small")
        share = min(1.0, at_most / sum(pq.read_metadata(file).num_rows for file in files)) if at_most else 1.0
        table = pa.concat_tables(self.read(file, names, share, number) for number, file in enumerate(files))
        self.scenes = table["scene_id"].to_numpy()
        self.labels = table["label"].to_numpy().astype(np.int8)
        self.values = np.stack([table[name].to_numpy() for name in names], axis=1)

    @staticmethod
    def read(file, names, share, number):
        table = pq.read_table(file, columns=["scene_id", "label", *names])
        kept = table["label"].is_valid()
        if share < 1:
            kept = pa.compute.and_(kept, pa.array(np.random.default_rng([6, number]).random(len(table)) < share))
        return table.filter(kept)

    def keep(self, rows):
        self.scenes, self.labels, self.values = self.scenes[rows], self.labels[rows], self.values[rows]

    def whole_scenes(self, rows, rng):
        """Indices of the rows of scenes drawn until there are at least so many; 0 = all scenes."""
        if not rows:
            return np.arange(len(self.labels))
        starts = np.flatnonzero(np.r_[True, self.scenes[1:] != self.scenes[:-1]])
        spans = list(zip(starts, np.r_[starts[1:], len(self.scenes)]))
        drawn, count = [], 0
        for scene in rng.permutation(len(spans)):
            drawn.append(np.arange(*spans[scene]))
            count += len(drawn[-1])
            if count >= rows:
                break
        return np.concatenate(drawn)


def train(train, validation, judged, settings, trainer=TRAINER, names=None):
    """Trains on (values, labels) and stops by others; without the features' names no column is known for a neighbour's height. Returns the outputs for each array of values in `judged`, and what the trainer told."""
    with tempfile.TemporaryDirectory() as folder:
        told = run(folder, train, validation, judged, settings, trainer, names)
        outputs = np.load(f"{folder}/outputs.npy")
    return np.split(outputs[len(train[0]) + len(validation[0]) :], np.cumsum([len(j) for j in judged])[:-1]), told


def looks(train, looked, settings, cpu_s, names):
    """What the looks at all of `looked` find while so many CPU seconds are learnt on (values, labels), and the resolved config."""
    with tempfile.TemporaryDirectory() as folder:
        return run(folder, train, looked, [], settings, names=names, flags=["--look-at-all", "--only-looks-of-s", str(cpu_s)])


def run(folder, train, validation, judged, settings, trainer=TRAINER, names=None, flags=()):
    """What the trainer tells; its outputs are outputs.npy in the folder, for all rows in their order."""
    if not pathlib.Path(trainer).is_file():
        raise SystemExit(f"{trainer} is missing: cargo build --release --example train_rows")
    values = np.concatenate([train[0], validation[0], *judged]).astype(np.float32, copy=False)
    own = len(train[0]) + len(validation[0])
    labels = np.concatenate([train[1], validation[1], np.zeros(len(values) - own, np.int8)])
    roles = np.repeat([0, 1, 2], [len(train[0]), len(validation[0]), len(values) - own]).astype(np.int8)
    columns = {"role": roles, "label": labels} | {name: np.ascontiguousarray(v) for name, v in zip(names or [f"x{i}" for i in range(values.shape[1])], values.T)}
    rows = f"{folder}/rows.parquet"
    pq.write_table(pa.table(columns), rows, compression="none", use_dictionary=False)
    if not any(key.startswith("filter") for key in settings):
        settings = settings_of(study.KALMAN_FILTER) | settings
    sets = [word for key, value in settings.items() for word in ("--set", f"{key}={value}")]
    done = subprocess.run([trainer, rows, f"{folder}/outputs.npy", *sets, *flags], capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"{trainer} failed:\n{done.stderr}")
    return json.loads(done.stdout)
