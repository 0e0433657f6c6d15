#!/usr/bin/env python3
"""Reads a corpus four ways: Polars, DuckDB, pyarrow, pandas. Take the part you need.

    pip install polars duckdb pyarrow pandas
    python scripts/read_corpus.py corpora/quickstart

A corpus is a folder of Parquet files, data/<table>/<split>-<shard>.parquet. `cells` is what a classifier is trained on.
"""

import json
import pathlib
import sys

corpus = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else "corpora/quickstart")
manifest = json.loads((corpus / "manifest.json").read_text())
features = [feature["name"] for feature in manifest["features"]]
train = str(corpus / "data" / "cells" / "train-*.parquet")
scenes = str(corpus / "data" / "scenes" / "*.parquet")


def with_polars():
    import polars as pl

    cells = pl.scan_parquet(train)
    print(cells.group_by("label").agg(pl.len(), pl.col("height_difference_m").mean()).sort("label").collect())


def with_duckdb():
    import duckdb

    print(duckdb.sql(f"""
        SELECT family, count(*) AS scenes, sum(cells) AS cells, sum(cells_untraversable) / sum(cells) AS untraversable
        FROM '{scenes}' GROUP BY family ORDER BY family
    """))


def with_pyarrow():
    """Units and meanings travel with the columns; row groups stream without loading the whole split."""
    import glob

    import pyarrow.parquet as pq

    first = sorted(glob.glob(train))[0]
    for field in pq.read_schema(first):
        about = field.metadata
        print(f"{field.name:24} {str(field.type):8} {about[b'unit'].decode():4} {about[b'role'].decode():8} {about[b'description'].decode()}")
    file = pq.ParquetFile(first)
    for group in range(file.num_row_groups):
        table = file.read_row_group(group, columns=["label", *features])
        print(f"{first}: row group {group}: {table.num_rows} cells")


def with_pandas():
    """X, y as scikit-learn takes them: standardised by the train split's statistics, rows without a label left out."""
    import glob

    import numpy as np
    import pandas as pd

    cells = pd.concat(pd.read_parquet(path, columns=["label", *features]) for path in sorted(glob.glob(train)))
    cells = cells.dropna(subset="label")
    mean = np.array([feature["mean"] for feature in manifest["features"]])
    sd = np.array([(feature["m2"] / feature["count"]) ** 0.5 for feature in manifest["features"]])
    x = (cells[features].to_numpy(np.float64) - mean) / np.where(sd > 0, sd, 1.0)
    y = cells["label"].to_numpy(np.int8)
    print(f"X {x.shape}, y {y.shape}: {y.mean():.2%} untraversable")


if __name__ == "__main__":
    with_polars()
    with_duckdb()
    with_pyarrow()
    with_pandas()
