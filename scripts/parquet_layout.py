#!/usr/bin/env python3
"""What row groups, pages, compression and byte-stream-split cost and bring: size, scan time in DuckDB and pyarrow.

    pip install pyarrow duckdb numpy
    python scripts/parquet_layout.py corpora/quickstart [--rounds 7]      -> scripts/results/parquet_layout.{json,md}

All cells of a finished corpus are written as one file, once a setting, by pyarrow with the encodings that marsyard uses (floats
byte-stream-split, others dictionary, zstd). One property is changed at a time. Each file is then read in five ways, one thread, in
interleaved rounds; figures are medians of CPU time over all threads, and their ratio to the default's within the same round.
"""

import argparse
import json
import pathlib
import platform
import statistics
import tempfile
import time

import duckdb
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

RESULTS = pathlib.Path(__file__).resolve().parent / "results"
DEFAULT = {"row_group": 131_072, "page_rows": 20_000, "level": 3, "split": True}
GRID = [
    {},
    {"row_group": 8_192}, {"row_group": 32_768}, {"row_group": 524_288}, {"row_group": 1_048_576},
    {"page_rows": 1_000}, {"page_rows": 5_000}, {"page_rows": 100_000},
    {"level": 1}, {"level": 6}, {"level": 9}, {"level": 15},
    {"split": False}, {"split": False, "level": 9},
    {"split": True, "level": 9, "row_group": 1_048_576},
]


def name(change):
    words = {"row_group": "row groups of {:,} rows", "page_rows": "pages of {:,} rows", "level": "zstd {}"}
    said = [words[key].format(value) for key, value in change.items() if key in words]
    return ", ".join(said + ["floats plain"] * (change.get("split") is False)) or "default"


def write(table, path, setting):
    floats = [field.name for field in table.schema if pa.types.is_floating(field.type)]
    others = [field.name for field in table.schema if field.name not in floats]
    pq.write_table(
        table, path, row_group_size=setting["row_group"], max_rows_per_page=setting["page_rows"], compression="zstd",
        compression_level=setting["level"], use_dictionary=others, data_page_size=1 << 20, write_page_index=True,
        column_encoding={column: "BYTE_STREAM_SPLIT" for column in floats} if setting["split"] else None,
        write_page_checksum=True, store_schema=True,
    )


def readers(table, scene):
    """Name -> what reads a file; each gives an answer, which must be the same for every setting."""
    features = ["mean_height_m", "height_difference_m", "label"]
    hashes = ", ".join(f'bit_xor(hash("{column}"))' for column in table.column_names)
    sql = duckdb.connect(config={"threads": 1})
    return {
        "pyarrow, all": lambda path: pq.ParquetFile(path).read(use_threads=False).num_rows,
        "pyarrow, 3 columns": lambda path: pq.ParquetFile(path).read(columns=features, use_threads=False).num_rows,
        "DuckDB, 2 columns": lambda path: sql.sql(
            f"SELECT sum(CASE WHEN label = 1 THEN points END) FROM '{path}'").fetchall()[0][0],
        # A hash of every value: no statistics can answer it.
        "DuckDB, all": lambda path: sql.sql(f"SELECT {hashes} FROM '{path}'").fetchall()[0],
        "DuckDB, one scene": lambda path: sql.sql(f"SELECT {hashes} FROM '{path}' WHERE scene_id = {scene}").fetchall()[0],
    }


def measure(table, rounds):
    scenes = table["scene_id"].to_numpy()
    how = readers(table, int(np.median(scenes)))
    with tempfile.TemporaryDirectory() as folder:
        files, rows = {}, []
        for k, change in enumerate(GRID):
            path = pathlib.Path(folder) / f"{k}.parquet"
            started = time.process_time()
            write(table, path, DEFAULT | change)
            facts = {"setting": name(change), **(DEFAULT | change), "write_cpu_s": time.process_time() - started}
            files[facts["setting"]] = path
            rows.append(facts | {"bytes": path.stat().st_size, "bytes_per_row": path.stat().st_size / table.num_rows})
        times = {(setting, reader): [] for setting in files for reader in how}
        answers = {}
        for round_ in range(rounds + 1):
            for setting, path in files.items():
                for reader, read in how.items():
                    started = time.process_time()
                    answer = read(path)
                    took = time.process_time() - started
                    assert answers.setdefault(reader, answer) == answer, (setting, reader)
                    # The first round fills the page cache.
                    if round_:
                        times[setting, reader].append(took)
        for row in rows:
            for reader in how:
                own, base = times[row["setting"], reader], times["default", reader]
                row[reader] = {
                    "cpu_s": statistics.median(own), "ratio": statistics.median(a / b for a, b in zip(own, base)),
                    "spread": statistics.stdev(a / b for a, b in zip(own, base)),
                }
    return rows, list(how)


def markdown(facts):
    rows, how = facts["settings"], facts["readers"]
    base = rows[0]
    lines = [
        "# Row groups, pages, compression", "",
        f"`python scripts/parquet_layout.py corpora/{facts['corpus']} --rounds {facts['rounds']}`: {facts['rows']:,} cells in one file a",
        f"setting, written by pyarrow {facts['versions']['pyarrow']}, read by it and by DuckDB {facts['versions']['duckdb']}, one thread. The first",
        "line is marsyard's own layout (row groups of 131,072 rows, pages of 20,000 rows, zstd 3, floats byte-stream-split), in seconds of CPU and",
        "bytes a row; the others change what they name, as ratios to it (median over rounds ± their standard deviation).", "",
        "| setting | size | write | " + " | ".join(how) + " |", "|---|" + "---:|" * (len(how) + 2),
    ]
    for row in rows:
        if row is base:
            cells = [f"{row['bytes_per_row']:.1f} B", f"{row['write_cpu_s']:.2f} s"] + [f"{row[r]['cpu_s']:.3f} s" for r in how]
        else:
            ratios = [f"{row['bytes'] / base['bytes']:.3f}", f"{row['write_cpu_s'] / base['write_cpu_s']:.2f}"]
            cells = ratios + [f"{row[r]['ratio']:.2f} ± {row[r]['spread']:.2f}" for r in how]
        lines.append(f"| {row['setting']} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus")
    parser.add_argument("--rounds", type=int, default=7)
    args = parser.parse_args()
    pa.set_cpu_count(1)
    pa.set_io_thread_count(1)
    place = pathlib.Path(args.corpus)
    manifest = json.loads((place / "manifest.json").read_text())
    files = sorted((place / "data" / "cells").glob("*.parquet"), key=lambda path: path.stem.split("-")[1])
    table = pa.concat_tables([pq.read_table(path, use_threads=False) for path in files]).combine_chunks()
    rows, how = measure(table, args.rounds)
    facts = {
        "corpus": manifest["name"], "corpus_id": manifest["corpus_id"], "rows": table.num_rows, "rounds": args.rounds, "readers": how,
        "versions": {"pyarrow": pa.__version__, "duckdb": duckdb.__version__, "python": platform.python_version()}, "settings": rows,
    }
    (RESULTS / "parquet_layout.json").write_text(json.dumps(facts, indent=2) + "\n")
    (RESULTS / "parquet_layout.md").write_text(markdown(facts))
    print(markdown(facts))


if __name__ == "__main__":
    main()
