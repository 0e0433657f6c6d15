"""How cost grows with each size of the work: fitted exponents, in one table.

Usage:  cargo build --release --examples --bins
        pip install numpy
        python scripts/complexity.py [--out scripts/results/complexity]     # writes .json and .md

One size grows by factors of two, all others stay; CPU seconds of one thread, medians of interleaved rounds. The exponent is the slope of
log cost over log size, by least squares over the upper half of the sizes, where what is paid once counts least; with it the range of
the slopes between neighbouring sizes there. A logarithm looks like an exponent that falls towards 0. Memory is the peak of whole
builds (`marsyard generate`), bytes resident.
"""

import argparse
import json
import os
import pathlib
import shutil
import subprocess
import tempfile

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[1]
ROUNDS = 3

# Size -> values, what is counted, and the greatest exponent that is right.
CASTS = {
    "rays": ([4000 * 2**k for k in range(6)], "rays of a sweep", 1.0),
    "rocks": ([125 * 2**k for k in range(8)], "rocks in the yard, a sweep of 30 m among them", "log"),
    "rocks_setup": ([125 * 2**k for k in range(8)], "rocks in the yard, made ready to be cast at", 1.0),
    "range": ([2.0 * 2**k for k in range(7)], "reach of a sweep, m, among 30,000 rocks on 400 x 400 m", 1.0),
    "degree": ([1, 2, 3, 4, 5, 6, 8, 10, 12], "degree of the ground", 2.0),
    "particles": ([16 * 2**k for k in range(7)], "particles, 8 features a scan", 1.0),
    "features": ([2 * 2**k for k in range(6)], "features a scan, 100 particles", 1.0),
    "cells": ([500 * 2**k for k in range(6)], "cells of a sweep of 68,200 points", 1.0),
}
# Widths of both hidden layers of the network; weights = 14 n + n + n^2 + n + 2 n + 2 or so.
WIDTHS = [8, 12, 16, 24, 32, 48]
FILTERS = {"ekf-f32": ("weights s, full covariance", 2.0), "node-f32": ("weights s, covariance by node", 1.5)}
SCENES = [10, 100, 1000]


class Server:
    def __init__(self, *command):
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def ask(self, *words):
        self.process.stdin.write(" ".join(str(word) for word in words) + "\n")
        self.process.stdin.flush()
        line = self.process.stdout.readline()
        if not line:
            raise SystemExit(f"{self.process.args}: no answer to {words}")
        return float(line)

    def close(self):
        self.process.stdin.close()
        self.process.wait()


def weights_of(width, inputs=14):
    return (inputs + 1) * width + (width + 1) * width + (width + 1)


def fitted(sizes, costs):
    """Slope over the upper half, and the range of its pieces."""
    half = len(sizes) // 2
    x, y = np.log(np.array(sizes[half:], dtype=float)), np.log(np.array(costs[half:]))
    pieces = np.diff(y) / np.diff(x)
    return float(np.polyfit(x, y, 1)[0]), [float(pieces.min()), float(pieces.max())]


def casts(server):
    found = {}
    for name, (sizes, what, bound) in CASTS.items():
        rounds = [[server.ask(name, size) for size in sizes] for _ in range(ROUNDS)]
        found[name] = {"what": what, "bound": bound, "sizes": sizes, "cpu_s": np.median(rounds, axis=0).tolist()}
        print(name, [f"{1e3 * s:.3g}" for s in found[name]["cpu_s"]], flush=True)
    return found


def filters(server):
    found = {}
    for name, (what, bound) in FILTERS.items():
        sizes = [weights_of(width) for width in WIDTHS]
        rows = [max(16, int(4e7 / s**2) // 8 * 8) for s in sizes]
        rounds = [[server.ask(f"{w}x{w}", name, n) / n for w, n in zip(WIDTHS, rows)] for _ in range(ROUNDS)]
        found[name] = {"what": what, "bound": bound, "sizes": sizes, "cpu_s": np.median(rounds, axis=0).tolist()}
        print(name, [f"{1e6 * s:.3g} us" for s in found[name]["cpu_s"]], flush=True)
    return found


def builds(binary, folder):
    """CPU and peak memory of whole builds on two threads."""
    cpu_s, peak_bytes = [], []
    for scenes in SCENES:
        out = folder / str(scenes)
        command = [binary, "generate", str(ROOT / "configs/quickstart.yaml"), "--threads", "2", "--out", str(out)]
        command += ["--set", f"scenes={scenes}", "--set", "scenes_per_shard=10", "--set", "fidelity=draft"]
        process = subprocess.Popen(command, stderr=subprocess.DEVNULL)
        _, status, usage = os.wait4(process.pid, 0)
        if status != 0:
            raise SystemExit(f"{' '.join(command)} failed")
        cpu_s.append(usage.ru_utime + usage.ru_stime)
        peak_bytes.append(usage.ru_maxrss * 1024)
        shutil.rmtree(out)
        print(f"{scenes} scenes: {cpu_s[-1]:.2f} s, {peak_bytes[-1] / 1e6:.0f} MB", flush=True)
    return {
        "scenes": {"what": "scenes of a build (quickstart, draft)", "bound": 1.0, "sizes": SCENES, "cpu_s": cpu_s},
        "memory": {"what": "scenes of a build: peak memory, bytes", "bound": 0.0, "sizes": SCENES, "bytes": peak_bytes},
    }


def table(found):
    lines = ["| cost against | from .. to | cost there | exponent, upper half | pieces of it | should be |", "|---|---|---|---|---|---|"]
    for entry in found.values():
        costs = entry.get("cpu_s", entry.get("bytes"))
        shown = [f"{c / 1e6:.0f} MB" if "bytes" in entry else f"{1e3 * c:.3g} ms" for c in (costs[0], costs[-1])]
        bound = entry["bound"]
        should = "at most log" if bound == "log" else "flat" if bound == 0 else f"at most {bound:g}"
        slope, (low, high) = entry["exponent"], entry["pieces"]
        sizes = entry["sizes"]
        lines.append(
            f"| {entry['what']} | {sizes[0]:g} .. {sizes[-1]:g} | {shown[0]} .. {shown[1]} | {slope:.2f} | {low:.2f} .. {high:.2f} | {should} |"
        )
    return lines


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--target", default=str(ROOT / "target/release"))
    parser.add_argument("--out", help="write OUT.json and OUT.md")
    arguments = parser.parse_args()
    target = pathlib.Path(arguments.target)
    server = Server(str(target / "examples/complexity"))
    found = casts(server)
    server.close()
    server = Server(str(target / "examples/filter_peer"), "serve")
    found |= filters(server)
    server.close()
    folder = pathlib.Path(tempfile.mkdtemp(prefix="complexity_"))
    found |= builds(str(target / "marsyard"), folder)
    shutil.rmtree(folder)
    for entry in found.values():
        entry["exponent"], entry["pieces"] = fitted(entry["sizes"], entry.get("cpu_s", entry.get("bytes")))
    lines = table(found)
    print("\n".join(lines))
    if arguments.out:
        out = pathlib.Path(arguments.out)
        out.with_suffix(".json").write_text(json.dumps({"load": os.getloadavg()[0], "sizes": found}, indent=1) + "\n")
        head = ["# How cost grows", "", "`python scripts/complexity.py`; what is measured, and how, is said at its head.", ""]
        out.with_suffix(".md").write_text("\n".join(head + lines) + "\n")


if __name__ == "__main__":
    main()
