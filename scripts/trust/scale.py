"""Receipts of very many shards, simulated -> seconds and memory of `status` and `finalize`; memory of a build over its length."""

import json
import os
import pathlib
import shutil
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
    for shard in range(1, shards):
        of_shard = {**receipt, "shard": shard, "split": split(shard), "scenes": [2 * shard, 2 * shard + 2], "tables": {}}
        for name, facts in receipt["tables"].items():
            path = f"data/{name}/{split(shard)}-{shard:07}.parquet"
            os.link(place / facts["path"], place / path)
            of_shard["tables"][name] = {**facts, "path": path}
        (place / f"receipts/{shard:07}.json").write_text(json.dumps(of_shard, indent=2))
    return place


def measured(lab, arguments):
    """Seconds, peak resident memory in MB, and stdout of a run that must succeed."""
    started = time.monotonic()
    child = lab.start(arguments)
    out = child.stdout.read()
    _, status, usage = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode != 0:
        raise Lost(f"{arguments[0]}: exit {child.returncode}: {child.stderr.read()[-300:]}")
    return round(time.monotonic() - started, 2), round(usage.ru_maxrss / 1024, 1), out


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
