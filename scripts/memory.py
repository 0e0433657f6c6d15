"""How much memory a training takes: rows of the corpus by settings, the most that a run holds (ru_maxrss of `marsyard train`).

Corpora are configs/mixed.yaml cut to each size, in shards of 10 scenes, and configs/quickstart.yaml as it is, in shards of 50; each is trained for a pass
by the default and by the Kalman filter, with one thread and two, and with no window, one and four read ahead; of more than 2000 scenes with two threads and one
window ahead alone. The report that `train` writes at the end (its test split judged) is part of the run.

    cargo build --release && python scripts/memory.py [--sizes 70,500,2000,8000]
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
#: Larger corpora are trained as it is usual, and not by the large network, whose pass takes ten times as long.
MOST_SCENES_OF_ALL, USUAL = 2000, {("default", 2, 1), ("Kalman filter", 2, 1)}


def most_megabytes(command):
    process = subprocess.Popen([str(word) for word in command], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    said = process.stderr.read()
    _, status, used = os.wait4(process.pid, 0)
    if status:
        sys.exit(f"{command} failed:\n{said.decode()[-2000:]}")
    return used.ru_maxrss / 1024


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", default="70,500,2000,8000", help="scenes (default 70,500,2000,8000)")
    study.add_arguments(parser, "memory")
    options = parser.parse_args()
    marsyard = study.Marsyard(options.marsyard, options.work, options.threads)
    sizes = [int(size) for size in options.sizes.split(",")]
    places = {f"mixed, {size} scenes": (size, marsyard.corpus(f"mixed-{size}", held_out.CONFIG, [], size, held_out.PER_SHARD)) for size in sizes}
    places["quickstart"] = (0, marsyard.shipped("quickstart"))
    rows_in = lambda place: json.loads((place / "manifest.json").read_text())["tables"]["cells"]["rows"]
    rows_of = {corpus: rows_in(place) for corpus, (_, place) in places.items()}
    results, table = [], []
    for title, sets, threads, prefetch in SETTINGS:
        row = [title, threads, prefetch]
        for corpus, (scenes, place) in places.items():
            if scenes > MOST_SCENES_OF_ALL and (title, threads, prefetch) not in USUAL:
                row.append("-")
                continue
            run = options.work / "run"
            shutil.rmtree(run, ignore_errors=True)
            most = most_megabytes([marsyard.binary, "train", place, "--out", run, "--threads", threads, "--prefetch", prefetch,
                                   *study.overrides([*sets, "epochs=1"])])
            results.append({"training": title, "threads": threads, "prefetch": prefetch, "corpus": corpus, "rows": rows_of[corpus], "most_megabytes": most})
            row.append(f"{most:.0f}")
            study.note(f"{title}, {threads} threads, {prefetch} ahead, {corpus}: {most:.0f} MB")
        table.append(row)
    head = ["training", "threads", "windows ahead", *[f"{corpus}: {rows / 1e6:.2f} M rows" for corpus, rows in rows_of.items()]]
    text = f"""# How much memory a training takes

{marsyard.version()}, {platform.machine()}; `python scripts/memory.py`. Megabytes at most, of a pass over mixed.yaml cut to some scenes,
in shards of {held_out.PER_SHARD}, and over quickstart.yaml, in its own of 50, the report on the test split included.

{study.markdown(head, table)}
"""
    study.write_results(options.out, "memory", results, text)


if __name__ == "__main__":
    main()
