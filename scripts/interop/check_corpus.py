#!/usr/bin/env python3
"""Checks a finished corpus with the readers that its users have.

    python scripts/interop/check_corpus.py corpora/quickstart
    python scripts/interop/check_corpus.py corpora/points --datasets --croissant

pyarrow, pandas, Polars and DuckDB each read every table: rows, types, units. Labels and features are looked at as a trainer
would. Where the corpus has a `points` table, cells are computed again with NumPy (recompute.py). Exit 1 at the first
difference, with what was expected and what was found.
"""

import argparse
import hashlib
import json
import pathlib
import sys

import duckdb
import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pyarrow.dataset
import pyarrow.parquet as pq

import recompute

ARROW = {
    "int8": pa.int8(), "int32": pa.int32(), "int64": pa.int64(), "float32": pa.float32(), "float64": pa.float64(),
    "bool": pa.bool_(), "string": pa.string(),
}
POLARS = {
    "int8": pl.Int8, "int32": pl.Int32, "int64": pl.Int64, "float32": pl.Float32, "float64": pl.Float64,
    "bool": pl.Boolean, "string": pl.String,
}
DUCKDB = {
    "int8": "TINYINT", "int32": "INTEGER", "int64": "BIGINT", "float32": "FLOAT", "float64": "DOUBLE",
    "bool": "BOOLEAN", "string": "VARCHAR",
}


class Corpus:
    """What the corpus says of itself: the expected values of most checks."""

    def __init__(self, place):
        self.place = pathlib.Path(place)
        self.manifest = json.loads((self.place / "manifest.json").read_text())
        self.shards = [json.loads(line) for line in (self.place / "shards.jsonl").read_text().splitlines()]
        self.tables = list(self.manifest["tables"])

    def files(self, table):
        return [self.place / shard["tables"][table]["path"] for shard in self.shards]

    def glob(self, table, split="*"):
        return str(self.place / "data" / table / f"{split}-*.parquet")

    def columns(self, table):
        """Name, type, nullability, unit and meaning of each column, as every file carries them."""
        return json.loads(pq.read_metadata(self.files(table)[0]).metadata[b"marsyard.columns"])

    def rows(self, table):
        return self.manifest["tables"][table]["rows"]

    def splits(self):
        return {name: split for name, split in self.manifest["splits"].items() if split["shards"]}


def expect(found, expected, what):
    if found != expected:
        sys.exit(f"FAILED {what}: expected {expected!r}, found {found!r}")


def check_files(corpus):
    """Every file by pyarrow, with page checksums: hash, rows, types, metadata of columns and of the file."""
    for shard in corpus.shards:
        for table, facts in shard["tables"].items():
            path = corpus.place / facts["path"]
            columns = corpus.columns(table)
            expect(hashlib.sha256(path.read_bytes()).hexdigest(), facts["sha256"], f"sha256 of {path}")
            file = pq.ParquetFile(path, page_checksum_verification=True)
            rows = file.read()
            rows.validate(full=True)
            expect(rows.num_rows, facts["rows"], f"rows of {path}")
            expect(file.metadata.num_row_groups, facts["row_groups"], f"row groups of {path}")
            # The format of the tables, which has changed less often than that of the manifest.
            expect(file.metadata.created_by, "marsyard 1", f"created_by of {path}")
            own = file.metadata.metadata
            expect(own[b"marsyard.scene_plan_hash"].decode(), corpus.manifest["scene_plan_hash"], f"plan hash of {path}")
            expect(own[b"marsyard.split"].decode(), shard["split"], f"split of {path}")
            expect(json.loads(own[b"marsyard.columns"]), columns, f"marsyard.columns of {path}")
            schema = file.schema_arrow
            expect(schema.names, [c["name"] for c in columns], f"column names of {path}")
            for column in columns:
                field = schema.field(column["name"])
                name = f"{column['name']} in {path}"
                expect(field.type, ARROW[column["type"]], f"type of {name}")
                expect(field.nullable, column["nullable"], f"nullability of {name}")
                expect(field.metadata[b"unit"].decode(), column["unit"], f"unit of {name}")
                expect(field.metadata[b"description"].decode(), column["description"], f"description of {name}")
            check_row_groups(file, path)
            scenes = rows["scene_id"].to_numpy()
            if len(scenes):
                low, high = shard["scenes"]
                expect(bool((scenes >= low).all() and (scenes < high).all()), True, f"scenes of {path} in {low}..{high}")
                expect(bool((np.diff(scenes) >= 0).all()), True, f"ascending scenes of {path}")


def check_row_groups(file, path):
    """No scan is in two row groups."""
    if "scan_id" not in file.schema_arrow.names or "points" not in file.schema_arrow.names:
        return
    seen = set()
    for group in range(file.metadata.num_row_groups):
        rows = file.read_row_group(group, columns=["scene_id", "scan_id"]).to_pandas()
        scans = set(map(tuple, rows.drop_duplicates().to_numpy().tolist()))
        expect(seen & scans, set(), f"scans cut by row groups in {path}")
        seen |= scans


def check_pandas(corpus):
    for table in corpus.tables:
        frame = pd.concat([pd.read_parquet(path, dtype_backend="pyarrow") for path in corpus.files(table)])
        expect(len(frame), corpus.rows(table), f"pandas: rows of {table}")
        for column in corpus.columns(table):
            expect(frame[column["name"]].dtype, pd.ArrowDtype(ARROW[column["type"]]), f"pandas: type of {table}.{column['name']}")


def check_polars(corpus):
    for table in corpus.tables:
        lazy = pl.scan_parquet(corpus.glob(table))
        expect(lazy.select(pl.len()).collect().item(), corpus.rows(table), f"Polars: rows of {table}")
        found = dict(lazy.collect_schema())
        expected = {column["name"]: POLARS[column["type"]] for column in corpus.columns(table)}
        expect(found, expected, f"Polars: types of {table}")
    for split, totals in corpus.splits().items():
        cells = pl.scan_parquet(corpus.glob("cells", split))
        counts = dict(cells.group_by("label").agg(pl.len()).collect().iter_rows())
        labels = totals["labels"]
        expected = {0: labels["traversable"], 1: labels["untraversable"], None: labels["unknown"]}
        expect(counts, {k: v for k, v in expected.items() if v}, f"Polars: labels of {split}")


def check_duckdb(corpus):
    sql = duckdb.connect()
    for table in corpus.tables:
        source = f"read_parquet('{corpus.glob(table)}')"
        expect(sql.sql(f"SELECT count(*) FROM {source}").fetchall()[0][0], corpus.rows(table), f"DuckDB: rows of {table}")
        found = {name: kind for name, kind, *_ in sql.sql(f"DESCRIBE SELECT * FROM {source}").fetchall()}
        expected = {column["name"]: DUCKDB[column["type"]] for column in corpus.columns(table)}
        expect(found, expected, f"DuckDB: types of {table}")
        pairs = sql.sql(f"SELECT key, value FROM parquet_kv_metadata('{corpus.files(table)[0]}')").fetchall()
        units = {bytes(k).decode(): bytes(v).decode() for k, v in pairs}["marsyard.columns"]
        expect(json.loads(units), corpus.columns(table), f"DuckDB: marsyard.columns of {table}")
    low, high = sql.sql(f"SELECT min(scene_id), max(scene_id) FROM read_parquet('{corpus.glob('scenes')}')").fetchall()[0]
    expect((low, high), (0, corpus.manifest["scenes"] - 1), "DuckDB: scenes")


def check_training(corpus):
    """What a trainer relies on: both classes in each split, features that vary, statistics that are true."""
    features = [column["name"] for column in corpus.columns("cells") if column["role"] == "feature"]
    expect(features, [feature["name"] for feature in corpus.manifest["features"]], "feature names of the manifest")
    for split in corpus.splits():
        cells = pl.read_parquet(corpus.glob("cells", split), columns=["label", *features])
        labels = set(cells["label"].unique().to_list()) - {None}
        expect(labels, {0, 1}, f"classes in {split}")
    cells = pl.read_parquet(corpus.glob("cells", "train"), columns=features)
    for feature in corpus.manifest["features"]:
        values = cells[feature["name"]].to_numpy().astype(np.float64)
        name = feature["name"]
        expect(int((~np.isfinite(values)).sum()), feature["not_finite"], f"values of {name} that are not finite")
        expect(feature["not_finite"], 0, f"NaN and infinities in {name}")
        expect(bool(values.min() < values.max()), True, f"{name} varies in the train split")
        expect((len(values), values.min(), values.max()), (feature["count"], feature["min"], feature["max"]), f"range of {name}")
        mean, m2 = values.mean(), ((values - values.mean()) ** 2).sum()
        expect(bool(abs(mean - feature["mean"]) <= 1e-9 * np.abs(values).max()), True, f"mean of {name} ({mean})")
        expect(bool(abs(m2 - feature["m2"]) <= 1e-8 * m2), True, f"M2 of {name} ({m2})")


def check_scenes(corpus):
    """Each scene is in one split, and its counts are those of its rows."""
    scenes = pl.read_parquet(corpus.glob("scenes"))
    cells = pl.read_parquet(corpus.glob("cells"), columns=["scene_id", "label"])
    expect(sorted(scenes["scene_id"].to_list()), list(range(corpus.manifest["scenes"])), "scene numbers")
    counted = cells.group_by("scene_id").agg(
        cells_found=pl.len(), untraversable_found=(pl.col("label") == 1).sum()
    )
    both = scenes.join(counted, on="scene_id", how="left").fill_null(0)
    expect(both["cells"].to_list(), both["cells_found"].to_list(), "cells of each scene")
    expect(both["cells_untraversable"].to_list(), both["untraversable_found"].to_list(), "untraversable cells of each scene")
    sums = both["points_binned"] + both["points_beyond_range"] + both["points_off_grid"]
    expect(both["points_in"].to_list(), sums.to_list(), "points in = points binned + points dropped")
    failed = scenes.filter(pl.col("status") == "failed")["scene_id"].sort().to_list()
    expect(failed, [entry["scene"] for entry in corpus.manifest["failed"]], "failed scenes")


def check_datasets(corpus):
    """Hugging Face datasets reads the card's configs, splits and class names."""
    import tempfile

    import datasets

    datasets.disable_progress_bars()
    with tempfile.TemporaryDirectory() as cache:
        for table in corpus.tables:
            loaded = datasets.load_dataset(str(corpus.place.resolve()), table, cache_dir=cache)
            expected = {name: split["rows"][table] for name, split in corpus.splits().items()}
            expect({name: split.num_rows for name, split in loaded.items()}, expected, f"datasets: rows of {table}")
            if table == "cells":
                label = loaded["train"].features["label"]
                expect(label.names, ["traversable", "untraversable"], "datasets: class names")
            streamed = datasets.load_dataset(str(corpus.place.resolve()), table, cache_dir=cache, streaming=True)
            expect(sorted(streamed), sorted(expected), f"datasets, streaming: splits of {table}")
            for name, rows in expected.items():
                first = list(streamed[name].take(5))
                expect(first, [loaded[name][k] for k in range(min(5, rows))], f"datasets, streaming: first rows of {table}, {name}")


def check_card(corpus):
    """Hugging Face's own parser reads the front matter of README.md: configs, splits, features, licence."""
    from huggingface_hub import DatasetCard

    card = DatasetCard.load(corpus.place / "README.md")
    facts = card.data.to_dict()
    expect([config["config_name"] for config in facts["configs"]], corpus.tables, "card: configs")
    for config in facts["configs"]:
        splits = {file["split"] for file in config["data_files"]}
        expect(splits, set(corpus.splits()), f"card: splits of {config['config_name']}")
    for info in facts["dataset_info"]:
        names = [feature["name"] for feature in info["features"]]
        expect(names, [c["name"] for c in corpus.columns(info["config_name"])], f"card: columns of {info['config_name']}")
    expect(bool(facts.get("license")), True, "card: a licence")


def check_croissant(corpus):
    """mlcroissant accepts croissant.json and reads records through it."""
    import itertools

    import mlcroissant

    dataset = mlcroissant.Dataset(jsonld=str(corpus.place / "croissant.json"))
    expect(dataset.metadata.issues.errors, set(), "mlcroissant: errors")
    for table in corpus.tables:
        records = list(itertools.islice(dataset.records(table), 3))
        expect(len(records), min(3, corpus.rows(table)), f"mlcroissant: records of {table}")
        names = [f"{table}/{column['name']}" for column in corpus.columns(table)]
        expect(sorted(records[0]), sorted(names), f"mlcroissant: fields of {table}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus", help="folder of a finished corpus")
    parser.add_argument("--datasets", action="store_true", help="also load it, and its card, with Hugging Face's libraries")
    parser.add_argument("--croissant", action="store_true", help="also validate and read croissant.json with mlcroissant")
    args = parser.parse_args()
    corpus = Corpus(args.corpus)
    checks = [check_files, check_pandas, check_polars, check_duckdb, check_training, check_scenes]
    if "points" in corpus.tables:
        checks.append(recompute.check_cells)
    checks += [check_datasets, check_card] * args.datasets + [check_croissant] * args.croissant
    for check in checks:
        check(corpus)
        print(f"ok  {check.__name__.removeprefix('check_')}")


if __name__ == "__main__":
    main()
