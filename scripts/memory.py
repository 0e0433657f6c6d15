"""How much memory a training takes: rows of the corpus by settings, the most that a run holds (ru_maxrss of `marsyard train`).

Corpora are configs/mixed.yaml cut to each size; each is trained for a pass by the default and by the Kalman filter, with one thread and two, and
with no window, one and four read ahead. The report that `train` writes at the end (its test split judged) is part of the run.

    cargo build --release && python scripts/memory.py [--sizes 70,500,2000]
"""

import argparse
import json
import os
import platform
import shutil
import subprocess
import sys

import held_out
import study

SETTINGS = [*(("default", [], threads, ahead) for threads, ahead in ((1, 1), (2, 0), (2, 1), (2, 4))), ("Kalman filter", study.KALMAN_FILTER, 2, 1),
            ("network of 256-256", ["network.hidden=[256,256]"], 2, 1)]


def most_megabytes(command):
    process = subprocess.Popen([str(word) for word in command], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    said = process.stderr.read()
    _, status, used = os.wait4(process.pid, 0)
    if status:
        sys.exit(f"{command} failed:\n{said.decode()[-2000:]}")
    return used.ru_maxrss / 1024


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", default="70,500,2000", help="scenes (default 70,500,2000)")
    study.add_arguments(parser, "memory")
    options = parser.parse_args()
    marsyard = study.Marsyard(options.marsyard, options.work, options.threads)
    sizes = [int(size) for size in options.sizes.split(",")]
    places = {size: marsyard.corpus(f"mixed-{size}", held_out.CONFIG, [], size, held_out.PER_SHARD) for size in sizes}
    rows_in = lambda place: json.loads((place / "manifest.json").read_text())["tables"]["cells"]["rows"]
    rows_of = {size: rows_in(place) for size, place in places.items()}
    results, table = [], []
    for title, sets, threads, prefetch in SETTINGS:
        row = [title, threads, prefetch]
        for size in sizes:
            run = options.work / "run"
            shutil.rmtree(run, ignore_errors=True)
            most = most_megabytes([marsyard.binary, "train", places[size], "--out", run, "--threads", threads, "--prefetch", prefetch,
                                   *study.overrides([*sets, "epochs=1"])])
            results.append({"training": title, "threads": threads, "prefetch": prefetch, "rows": rows_of[size], "most_megabytes": most})
            row.append(f"{most:.0f}")
            study.note(f"{title}, {threads} threads, {prefetch} ahead, {size} scenes: {most:.0f} MB")
        table.append(row)
    head = ["training", "threads", "windows ahead", *[f"{rows_of[size] * 1e-6:.2f} M rows" for size in sizes]]
    text = f"""# How much memory a training takes

{marsyard.version()}, {platform.machine()}; `python scripts/memory.py`. Megabytes at most, of a pass over mixed.yaml cut to {', '.join(map(str, sizes))} scenes
in shards of {held_out.PER_SHARD}, the report on the test split included.

{study.markdown(head, table)}
"""
    study.write_results(options.out, "memory", results, text)


if __name__ == "__main__":
    main()
