"""Receipts of very many shards, simulated -> seconds and memory of `status` and `finalize`; memory of a build over its length."""

import json
import os
import pathlib
import shutil
import subprocess
import time

from lab import EVERYTHING, ROOT, Lost

VALIDATION, TEST = (3, 9, 16), (6, 13, 19)


def split(shard):
    return "validation" if shard % 20 in VALIDATION else "test" if shard % 20 in TEST else "train"


def simulate(lab, shards):
    """A place with the receipts of `shards` shards; the tables are links to those of shard 0."""
    place = lab.fresh("many")
    sets = (f"scenes={2 * shards}",)
    code, _, err = lab.run(["generate", str(EVERYTHING), "--out", str(place), "--shards", "0", "--set", *sets])
    if code != 0:
        raise Lost(err)
    receipt = json.loads((place / "receipts/0000000.json").read_text())
    sources = {name: facts["path"] for name, facts in receipt["tables"].items()}
    for shard in range(1, shards):
        of_shard = {**receipt, "shard": shard, "split": split(shard), "scenes": [2 * shard, 2 * shard + 2], "tables": {}}
        for name, facts in receipt["tables"].items():
            path = f"data/{name}/{split(shard)}-{shard:07}.parquet"
            if shard % 30_000 == 0:
                # File systems bound the names of one file.
                shutil.copy(place / sources[name], place / path)
                sources[name] = path
            else:
                os.link(place / sources[name], place / path)
            of_shard["tables"][name] = {**facts, "path": path}
        (place / f"receipts/{shard:07}.json").write_text(json.dumps(of_shard, indent=2))
    return place


def measured(lab, arguments):
    """Seconds, peak resident memory in MB, and stdout of a run that must succeed."""
    started = time.monotonic()
    out, err = lab.folder / "measured.out", lab.folder / "measured.err"
    with out.open("w") as to_out, err.open("w") as to_err:
        child = subprocess.Popen([lab.binary, *arguments], stdout=to_out, stderr=to_err, cwd=lab.folder)
        peak_kb = 0
        while child.poll() is None:
            # The kernel's own high-water mark; the one that wait4 gives begins with that of this script.
            status = pathlib.Path(f"/proc/{child.pid}/status").read_text()
            marks = [int(line.split()[1]) for line in status.splitlines() if line.startswith("VmHWM:")]
            peak_kb = max([peak_kb, *marks])
            time.sleep(0.005)
    if child.returncode != 0:
        raise Lost(f"{arguments[0]}: exit {child.returncode}: {err.read_text()[-300:]}")
    return round(time.monotonic() - started, 2), round(peak_kb / 1000, 1), out.read_text()


def many_shards(lab, shards):
    place = simulate(lab, shards)
    rows = []
    for verb in ("status", "finalize", "status"):
        seconds, megabytes, out = measured(lab, [verb, str(place)])
        if verb == "status" and f"done     {shards:>7}" not in out:
            raise Lost(f"status does not see {shards} shards: {out[:300]}")
        rows.append({"what": f"{verb} of {shards} shards", "seconds": seconds, "peak_mb": megabytes})
    if json.loads((place / "manifest.json").read_text())["shards"] != shards:
        raise Lost("the manifest holds another number of shards")
    shutil.rmtree(place)
    return rows[:2]


def long_builds(lab, counts):
    """Peak memory of builds of growing length, two threads."""
    config = ROOT / "tests/fixtures/training.yaml"
    rows = []
    for scenes in counts:
        place = lab.fresh("long")
        arguments = ["generate", str(config), "--out", str(place), "--threads", "2", "--set", f"scenes={scenes}"]
        seconds, megabytes, _ = measured(lab, arguments)
        rows.append({"what": f"build of {scenes} scenes", "seconds": seconds, "peak_mb": megabytes})
        shutil.rmtree(pathlib.Path(place))
    return rows
