"""Casting rate and range error of marsyard against Open3D's RaycastingScene, in one run.

Usage:  cargo build --release --example cast_peer
        pip install open3d numpy
        python scripts/peers/open3d_cast.py [--rounds 15] [--out results.json]

The Rust example `cast_peer` writes scene S2 (a degree-8 polynomial on 20 x 20 m, 60 convex rocks) as a 0.05 m mesh, with rays
and exact ranges, and casts sweeps on request. Engines take turns round by round; each round counts CPU seconds of one
thread, and the ratio is the median of the rounds' ratios. Both sides get their rays ready-made (Open3D as float32 tensors)
and write ranges and ids; Open3D writes normals and uv too, as its interface has it.

The range error of both is against the exact surface: for marsyard (first-hit solver) it is measured by how far the hit
point lies off the polynomial or rock planes in the Rust tests; here, Open3D's ranges are compared with marsyard's.
"""

import argparse
import json
import os
import pathlib
import subprocess
import tempfile
import time

import numpy as np
import open3d as o3d

ROOT = pathlib.Path(__file__).resolve().parents[2]


class Marsyard:
    """The Rust side, kept running and asked for one sweep at a time."""

    def __init__(self, binary, folder):
        self.process = subprocess.Popen(
            [binary, folder], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self.facts = []
        while (line := self.process.stdout.readline().strip()) != "ready":
            if not line and self.process.poll() is not None:
                raise SystemExit(f"{binary} ended early")
            self.facts.append(json.loads(line))

    def cast(self, sweep, method):
        self.process.stdin.write(f"{sweep} {method}\n")
        self.process.stdin.flush()
        return float(self.process.stdout.readline())

    def close(self):
        self.process.stdin.close()
        self.process.wait()


def quantiles(values):
    names = ("median", "p99", "max")
    return dict(zip(names, (float(np.quantile(values, q)) for q in (0.5, 0.99, 1.0))))


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--binary", default=str(ROOT / "target/release/examples/cast_peer"))
    parser.add_argument("--out", help="write the figures as JSON")
    arguments = parser.parse_args()
    folder = pathlib.Path(tempfile.mkdtemp(prefix="cast_peer_"))
    marsyard = Marsyard(arguments.binary, str(folder))
    vertices = np.fromfile(folder / "vertices.f64").reshape(-1, 3)
    triangles = np.fromfile(folder / "triangles.i32", dtype=np.int32).reshape(-1, 3)
    scene = o3d.t.geometry.RaycastingScene(nthreads=1)
    scene.add_triangles(
        o3d.core.Tensor(vertices.astype(np.float32)),
        o3d.core.Tensor(triangles.astype(np.uint32)),
    )
    methods = ("exact", "raster", "mesh")
    report = {"open3d": o3d.__version__, "rounds": arguments.rounds, "facts": marsyard.facts, "sweeps": {}}
    for name in ("urg", "sick"):
        rays = np.fromfile(folder / f"{name}.rays.f64").reshape(-1, 6)
        exact = np.fromfile(folder / f"{name}.exact.f64")
        reach = next(fact["reach_m"] for fact in marsyard.facts if fact.get("sweep") == name)
        tensor = o3d.core.Tensor(rays.astype(np.float32))
        answer = scene.cast_rays(tensor, nthreads=1)["t_hit"].numpy()
        for method in methods:
            marsyard.cast(name, method)
        seconds = {"open3d": [], **{method: [] for method in methods}}
        for _ in range(arguments.rounds):
            begin = time.process_time()
            scene.cast_rays(tensor, nthreads=1)
            seconds["open3d"].append(time.process_time() - begin)
            for method in methods:
                seconds[method].append(marsyard.cast(name, method))
        base = np.array(seconds["open3d"])
        peer = np.where(answer <= reach, answer.astype(np.float64), np.inf)
        both = np.isfinite(peer) & np.isfinite(exact)
        result = {
            "rays": len(rays),
            "engines": {
                engine: {
                    "mray_per_s": len(rays) / float(np.median(times)) / 1e6,
                    "ratio_to_open3d": float(np.median(base / np.array(times))),
                    "ratio_low_high": [float(q) for q in np.quantile(base / np.array(times), (0.1, 0.9))],
                }
                for engine, times in seconds.items()
            },
            "open3d_range_error_m": quantiles(np.abs(peer[both] - exact[both])),
            "hits": {
                "both": int(both.sum()),
                "open3d_only": int((np.isfinite(peer) & ~np.isfinite(exact)).sum()),
                "marsyard_only": int((~np.isfinite(peer) & np.isfinite(exact)).sum()),
            },
        }
        report["sweeps"][name] = result
        print(f"{name}: {len(rays)} rays, one thread, {arguments.rounds} rounds")
        for engine, figures in result["engines"].items():
            low, high = figures["ratio_low_high"]
            print(
                f"  {engine:8} {figures['mray_per_s']:7.2f} Mray/s"
                f"   {figures['ratio_to_open3d']:5.2f} x Open3D ({low:.2f} .. {high:.2f})"
            )
        error = result["open3d_range_error_m"]
        print(f"  Open3D against the exact surface: median {error['median']:.1e} m,", end=" ")
        print(f"p99 {error['p99']:.1e} m, max {error['max']:.1e} m; hits {result['hits']}")
    marsyard.close()
    if arguments.out:
        pathlib.Path(arguments.out).write_text(json.dumps(report, indent=1) + os.linesep)


if __name__ == "__main__":
    main()
