#!/usr/bin/env python3
"""Reads a finished corpus with Spark, and checks rows, types, units and labels against its manifest.

    pip install pyspark        (and a Java runtime, 17 or newer)
    python scripts/readers/spark.py corpora/quickstart [--note scripts/results/readers.json]

Units travel in the Arrow schema, which Spark does not read: it is given the table's description of its columns, from the
file's own key-values, as column metadata. Exit 1 at the first difference.
"""

import argparse
import json
import platform
import time

import pyarrow.parquet as pq
import pyspark
from pyspark.sql import SparkSession
from pyspark.sql import functions as F

from expected import Corpus, expect, note

SPARK = {
    "int8": "tinyint", "int32": "int", "int64": "bigint", "float32": "float", "float64": "double", "bool": "boolean",
    "string": "string",
}


def described(frame, file):
    """The frame with unit, role and meaning of each column as Spark's column metadata."""
    columns = json.loads(pq.read_metadata(file).metadata[b"marsyard.columns"])
    facts = {c["name"]: {key: c[key] for key in ("unit", "role", "description")} for c in columns}
    return columns, frame.select([F.col(f"`{name}`").alias(name, metadata=facts[name]) for name in frame.columns])


def check(spark, corpus):
    for table in corpus.tables:
        files = corpus.files(table)
        columns, frame = described(spark.read.parquet(*files), files[0])
        expect(frame.count(), corpus.manifest["tables"][table]["rows"], f"rows of {table}")
        expect(dict(frame.dtypes), {c["name"]: SPARK[c["type"]] for c in columns}, f"types of {table}")
        units = {field.name: field.metadata["unit"] for field in frame.schema.fields}
        expect(units, {c["name"]: c["unit"] for c in columns}, f"units of {table}")
        for split, totals in corpus.splits().items():
            rows = spark.read.parquet(str(corpus.place / "data" / table / f"{split}-*.parquet")).count()
            expect(rows, totals["rows"][table], f"rows of {table}, split {split} by name")
    for split in corpus.splits():
        cells = spark.read.parquet(*corpus.files("cells", split))
        counts = {row["label"]: row["count"] for row in cells.groupBy("label").count().collect()}
        expect(counts, corpus.labels(split), f"labels of {split}")
    # A join across tables and a filter on an integer column, which statistics can skip row groups by.
    cells = spark.read.parquet(*corpus.files("cells"))
    scenes = spark.read.parquet(*corpus.files("scenes"))
    counted = cells.groupBy("scene_id").agg(F.count("*").alias("found"))
    wrong = scenes.join(counted, "scene_id", "left").where(F.coalesce("found", F.lit(0)) != F.col("cells")).count()
    expect(wrong, 0, "scenes whose cells are not those of their rows")
    train = spark.read.parquet(*corpus.files("cells", "train"))
    for feature in corpus.manifest["features"]:
        low, high = train.agg(F.min(feature["name"]), F.max(feature["name"])).first()
        expect((low, high), (feature["min"], feature["max"]), f"range of {feature['name']}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus")
    parser.add_argument("--note", help="JSON file to keep the result in")
    args = parser.parse_args()
    corpus = Corpus(args.corpus)
    spark = (
        SparkSession.builder.master("local[2]").appName("marsyard").config("spark.ui.enabled", "false")
        .config("spark.sql.shuffle.partitions", "4").config("spark.log.level", "ERROR").getOrCreate()
    )
    started = time.monotonic()
    check(spark, corpus)
    java = spark.sparkContext._jvm.System.getProperty("java.version")
    facts = {
        "versions": {"pyspark": pyspark.__version__, "java": java, "python": platform.python_version()},
        "corpus": corpus.manifest["name"], "corpus_id": corpus.manifest["corpus_id"],
        "rows": {table: totals["rows"] for table, totals in corpus.manifest["tables"].items()},
        "checked": "rows of each table and split, types, units, labels by split, ranges of features, cells of each scene",
        "seconds": round(time.monotonic() - started, 1),
    }
    spark.stop()
    print(json.dumps(facts, indent=2))
    if args.note:
        note(args.note, "Spark", facts)


if __name__ == "__main__":
    main()
