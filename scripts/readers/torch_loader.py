#!/usr/bin/env python3
"""Feeds a finished corpus to PyTorch: a DataLoader whose workers share the row groups, without the corpus in memory.

    pip install torch pyarrow numpy
    python scripts/readers/torch_loader.py corpora/quickstart [--workers 2] [--note scripts/results/readers.json]

`RowGroups` is what to copy into a training of your own. The rest checks it against the manifest: rows, types, units and labels of
every split, each row once whatever the number of workers, and another order in another epoch. Exit 1 at the first difference.
"""

import argparse
import collections
import json
import platform
import time

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import torch
from torch.utils.data import DataLoader, IterableDataset, get_worker_info

from expected import Corpus, expect, note


class RowGroups(IterableDataset):
    """Batches of (features, labels) of a split; rows whose label is unknown are left out.

    Row groups are permuted by (seed, epoch), dealt out to the workers, and the rows of each permuted: memory holds one group a worker.
    """

    def __init__(self, files, features, batch_rows, seed=0, epoch=0):
        self.files, self.features, self.batch_rows, self.seed, self.epoch = files, features, batch_rows, seed, epoch
        self.groups = [(file, k) for file in files for k in range(pq.read_metadata(file).num_row_groups)]

    def __iter__(self):
        worker = get_worker_info()
        number, workers = (worker.id, worker.num_workers) if worker else (0, 1)
        order = np.random.default_rng((self.seed, self.epoch)).permutation(len(self.groups))
        for at in order[number::workers]:
            file, group = self.groups[at]
            rows = pq.ParquetFile(file).read_row_group(group, columns=[*self.features, "label"])
            rows = rows.filter(rows["label"].is_valid())
            x = np.column_stack([rows[name].to_numpy() for name in self.features])
            y = rows["label"].to_numpy().astype(np.int64)
            mixed = np.random.default_rng((self.seed, self.epoch, int(at))).permutation(len(y))
            for start in range(0, len(y), self.batch_rows):
                chosen = mixed[start : start + self.batch_rows]
                yield torch.from_numpy(x[chosen]), torch.from_numpy(y[chosen])


def loader(corpus, features, split, workers, epoch=0, batch_rows=4096):
    dataset = RowGroups(corpus.files("cells", split), features, batch_rows, epoch=epoch)
    return DataLoader(dataset, batch_size=None, num_workers=workers)


def check(corpus, workers):
    columns = json.loads(pq.read_metadata(corpus.files("cells")[0]).metadata[b"marsyard.columns"])
    features = [column["name"] for column in columns if column["role"] == "feature"]
    schema = pq.read_schema(corpus.files("cells")[0])
    for column in (column for column in columns if column["role"] == "feature"):
        expect(schema.field(column["name"]).type, pa.float32(), f"type of {column['name']}")
        expect(schema.field(column["name"]).metadata[b"unit"].decode(), column["unit"], f"unit of {column['name']}")
    rows = 0
    for split in corpus.splits():
        counts, low, high = collections.Counter(), np.inf, -np.inf
        for x, y in loader(corpus, features, split, workers):
            expect((x.dtype, x.shape[1], y.dtype), (torch.float32, len(features), torch.int64), f"a batch of {split}")
            expect(bool(torch.isfinite(x).all()), True, f"finite features in {split}")
            counts.update(y.tolist())
            low, high = np.minimum(low, x.amin(0).numpy()), np.maximum(high, x.amax(0).numpy())
        expected = {label: count for label, count in corpus.labels(split).items() if label is not None}
        expect(dict(counts), expected, f"labels of {split}")
        rows += sum(counts.values())
        if split == "train" and None not in corpus.labels(split):
            ranges = [(feature["min"], feature["max"]) for feature in corpus.manifest["features"]]
            expect([tuple(map(float, pair)) for pair in zip(low, high)], ranges, "ranges of the features")
    sums = lambda workers, epoch: sorted(float(x.double().sum()) for x, _ in loader(corpus, features, "validation", workers, epoch))
    expect(sums(workers, 0), sums(0, 0), "the batches of many workers and of none")
    expect(sums(0, 0) == sums(0, 1), False, "another epoch has the same batches")
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--note", help="JSON file to keep the result in")
    args = parser.parse_args()
    corpus = Corpus(args.corpus)
    torch.set_num_threads(1)
    started = time.monotonic()
    rows = check(corpus, args.workers)
    facts = {
        "versions": {"torch": torch.__version__, "pyarrow": pa.__version__, "python": platform.python_version()},
        "corpus": corpus.manifest["name"], "corpus_id": corpus.manifest["corpus_id"], "workers": args.workers, "rows": {"cells": rows},
        "checked": "rows, types, units, labels by split, ranges of features; each row once with any number of workers",
        "seconds": round(time.monotonic() - started, 1),
    }
    print(json.dumps(facts, indent=2))
    if args.note:
        note(args.note, "PyTorch DataLoader", facts)


if __name__ == "__main__":
    main()
