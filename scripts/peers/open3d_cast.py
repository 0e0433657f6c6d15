"""Casting rate, range error and set-up of marsyard against Open3D's RaycastingScene and raw Embree, in one run.

Usage:  cargo build --release --example cast_peer
        pip install open3d numpy
        apt install libembree-dev          # Embree 3, optional: without it its rows are left out
        python scripts/peers/open3d_cast.py [--rounds 15] [--yards s2,s3] [--out results.json]

The Rust example `cast_peer` writes yards S2 (a degree-8 polynomial on 20 x 20 m, 60 convex rocks, 0.05 m mesh) and S3 (100 x 100 m, 2000
rocks, 0.1 m mesh: two million triangles), with rays and exact ranges, and casts sweeps on request; `embree_cast.c` does the same by
rtcIntersect8, in Embree's robust mode (which Open3D uses) and its default mode. Engines take turns round by round; each round counts
CPU seconds of one thread, and a ratio is the median of the rounds' ratios. All sides get their rays ready-made in the form they like
(Open3D as float32 tensors; Embree as arrays of components, marked coherent and cut off at the sensor's reach, which Open3D has no means for)
and write ranges and ids; Open3D writes normals and uv too, as its interface has it.

The range error is against the exact surface: for marsyard (first-hit solver) it is measured by how far the hit
point lies off the polynomial or rock planes in the Rust tests; here, the peers' ranges are compared with marsyard's. Set-up is the
CPU time from ground and rocks in memory to ready to be cast at: bounds and trees here, the BVH of the finished mesh there.
"""

import argparse
import json
import os
import pathlib
import shutil
import subprocess
import tempfile
import time

import numpy as np
import open3d as o3d

ROOT = pathlib.Path(__file__).resolve().parents[2]
SWEEPS = ("urg", "sick")
SETUP_ROUNDS = 5


class Engine:
    """A program that casts on request: one line in, CPU seconds out."""

    def __init__(self, *command):
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def line(self):
        line = self.process.stdout.readline()
        if not line:
            raise SystemExit(f"{self.process.args[0]} ended early")
        return line.strip()

    def ask(self, *words):
        self.process.stdin.write(" ".join(str(word) for word in words) + "\n")
        self.process.stdin.flush()
        return float(self.line())

    def close(self):
        self.process.stdin.close()
        self.process.wait()


def compiled_embree(folder):
    """The raw Embree program, or None where there is no compiler or no Embree 3."""
    if not shutil.which("cc") or not pathlib.Path("/usr/include/embree3/rtcore.h").exists():
        return None
    program = str(folder / "embree_cast")
    source = str(ROOT / "scripts/peers/embree_cast.c")
    subprocess.run(["cc", "-O3", "-mavx2", "-mfma", "-o", program, source, "-lembree3", "-lm"], check=True)
    return program


def quantiles(values):
    names = ("median", "p99", "max")
    return dict(zip(names, (float(np.quantile(values, q)) for q in (0.5, 0.99, 1.0))))


def against_exact(peer, exact):
    both = np.isfinite(peer) & np.isfinite(exact)
    return {
        "range_error_m": quantiles(np.abs(peer[both] - exact[both])),
        "hits_both": int(both.sum()),
        "missed": int((~np.isfinite(peer) & np.isfinite(exact)).sum()),
        "invented": int((np.isfinite(peer) & ~np.isfinite(exact)).sum()),
    }


def open3d_scene(folder, yard):
    vertices = np.fromfile(folder / f"{yard}.vertices.f64").reshape(-1, 3)
    triangles = np.fromfile(folder / f"{yard}.triangles.i32", dtype=np.int32).reshape(-1, 3)
    tensors = o3d.core.Tensor(vertices.astype(np.float32)), o3d.core.Tensor(triangles.astype(np.uint32))
    begin = time.process_time()
    scene = o3d.t.geometry.RaycastingScene(nthreads=1)
    scene.add_triangles(*tensors)
    # The BVH is built when the first ray is cast.
    scene.cast_rays(o3d.core.Tensor(np.array([[0, 0, 9, 0, 0, 1]], dtype=np.float32)), nthreads=1)
    return scene, time.process_time() - begin


def measure_yard(folder, yard, marsyard, embree, facts, rounds):
    """Set-up and sweeps of one yard."""
    scene, open3d_setup = open3d_scene(folder, yard)
    embrees = {}
    setups = {"open3d": open3d_setup}
    for mode in ("robust", "default") if embree else ():
        engine = Engine(embree, str(folder), yard, mode)
        setups[f"embree8 {mode}"] = float(engine.line())
        embrees[mode] = engine
    # A mesh of millions of triangles takes seconds to build here too, and is nobody's choice.
    methods = ("exact", "raster", "mesh") if yard == "s2" else ("exact", "raster")
    for method in (*methods, "raw"):
        setups[f"marsyard {method}"] = float(np.median([marsyard.ask(yard, "setup", method) for _ in range(SETUP_ROUNDS)]))
    result = {"setup_s": setups, "sweeps": {}}
    for sweep in SWEEPS:
        rays = np.fromfile(folder / f"{yard}.{sweep}.rays.f64").reshape(-1, 6)
        exact = np.fromfile(folder / f"{yard}.{sweep}.exact.f64")
        reach = next(fact["reach_m"] for fact in facts if fact.get("sweep") == f"{yard}.{sweep}")
        tensor = o3d.core.Tensor(rays.astype(np.float32))

        def by_open3d():
            begin = time.process_time()
            answer = scene.cast_rays(tensor, nthreads=1)
            return time.process_time() - begin, answer

        engines = {"open3d": lambda: by_open3d()[0]}
        for mode, engine in embrees.items():
            engines[f"embree8 {mode}"] = lambda engine=engine: engine.ask(sweep, reach)
        for method in methods:
            engines[f"marsyard {method}"] = lambda method=method: marsyard.ask(yard, sweep, method)
        for engine in engines.values():
            engine()
        seconds = {name: [] for name in engines}
        for _ in range(rounds):
            for name, engine in engines.items():
                seconds[name].append(engine())
        seconds = {name: np.array(times) for name, times in seconds.items()}

        peer = by_open3d()[1]["t_hit"].numpy().astype(np.float64)
        errors = {"open3d": against_exact(np.where(peer <= reach, peer, np.inf), exact)}
        for mode in embrees:
            peer = np.fromfile(folder / f"{yard}.{sweep}.{mode}.f32", dtype=np.float32).astype(np.float64)
            errors[f"embree8 {mode}"] = against_exact(peer, exact)
        result["sweeps"][sweep] = {
            "rays": len(rays),
            "engines": {
                name: {
                    "mray_per_s": len(rays) / float(np.median(times)) / 1e6,
                    **{
                        f"ratio_to_{peer.replace(' ', '_')}": [float(q) for q in np.quantile(seconds[peer] / times, (0.5, 0.1, 0.9))]
                        for peer in seconds
                        if not peer.startswith("marsyard")
                    },
                }
                for name, times in seconds.items()
            },
            "against_exact": errors,
        }
        tell(yard, sweep, result["sweeps"][sweep], rounds)
    for engine in embrees.values():
        engine.close()
    print("  set-up, ms of CPU: " + ", ".join(f"{name} {1e3 * s:.3g}" for name, s in setups.items()))
    return result


def tell(yard, sweep, result, rounds):
    print(f"{yard} {sweep}: {result['rays']} rays, one thread, {rounds} rounds; ratios: median (10 % .. 90 %)")
    for name, figures in result["engines"].items():
        ratios = (
            f"{ratio[0]:5.2f} x {key.removeprefix('ratio_to_')} ({ratio[1]:.2f} .. {ratio[2]:.2f})"
            for key, ratio in figures.items()
            if key.startswith("ratio_to_") and name.startswith("marsyard")
        )
        print(f"  {name:16} {figures['mray_per_s']:7.2f} Mray/s  " + "; ".join(ratios))
    for name, error in result["against_exact"].items():
        e = error["range_error_m"]
        print(
            f"  {name} against the exact surface: median {e['median']:.1e} m, p99 {e['p99']:.1e} m, max {e['max']:.1e} m;"
            f" missed {error['missed']}, invented {error['invented']} of {error['hits_both']}"
        )


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--yards", default="s2,s3")
    parser.add_argument("--binary", default=str(ROOT / "target/release/examples/cast_peer"))
    parser.add_argument("--out", help="write the figures as JSON")
    arguments = parser.parse_args()
    folder = pathlib.Path(tempfile.mkdtemp(prefix="cast_peer_"))
    embree = compiled_embree(folder)
    marsyard = Engine(arguments.binary, str(folder))
    facts = []
    while (line := marsyard.line()) != "ready":
        facts.append(json.loads(line))
    report = {"open3d": o3d.__version__, "rounds": arguments.rounds, "load": os.getloadavg()[0], "facts": facts, "yards": {}}
    for yard in arguments.yards.split(","):
        report["yards"][yard] = measure_yard(folder, yard, marsyard, embree, facts, arguments.rounds)
    marsyard.close()
    shutil.rmtree(folder)
    if arguments.out:
        pathlib.Path(arguments.out).write_text(json.dumps(report, indent=1) + os.linesep)


if __name__ == "__main__":
    main()
