"""A whole pipeline of Open3D, SciPy, NumPy and PyArrow against marsyard, on the same yards, in one run.

Usage:  cargo build --release && cargo build --release --example pipeline_peer
        pip install open3d numpy numba scipy pyarrow
        python scripts/peers/whole_pipeline.py [--scenes 60] [--rounds 5] [--out results.json]

There are three peers, on meshes of 0.1 and of 0.05 m. All have the ground's heights by two matrix products, convex hulls by SciPy, Open3D's
RaycastingScene, 682 x 100 rays, Gaussian range noise and gates, points to the map, 14 features, labels, Parquet with zstd through PyArrow.

  plain             As a careful user of those libraries would write it: one scan a yard of `configs/paper.yaml`, the whole yard as a mesh, cells by
                    sorting and `bincount` / `reduceat` (no loop over rays or cells).
  expert            As their expert would: mesh and rocks cut to what cells are made of, and all that follows the casting compiled by numba.
  expert, 4 sweeps  The same with one mesh for the four sweeps that a yard has, cut to the sensor's reach, which FastSLAM reads; those on the way are cast
                    from where the last one is, and that is all.

They have no drive, no SLAM, no random grounds to generate and fit, and no yards that are thrown away: yards and poses are given. What is the same
for all yards (grid, triangles, Legendre bases, Open3D's tensors of triangles, compiling) is made once and not counted. marsyard does all of
its work: random ground and fit, rocks, drive and wheel contact, four sweeps a yard, FastSLAM, cells of the last, shards on disk, start of the
program. An eighth of its yards lack one of the classes and are made anew. With true poses it casts the last sweep of a yard alone and has no SLAM
either: the row of like work, but for the drive, the random ground and those yards.

CPU seconds, one thread, rounds interleaved: the plain peer's and marsyard's per sweep cast, the experts' and marsyard's per scan that is delivered
as cells. Before that, they make the same cells: without noise, the peers' against marsyard's.
"""

import argparse
import json
import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

import pathlib
import shutil
import subprocess
import tempfile
import time

import numba
import numpy as np
import open3d as o3d
import pyarrow as pa
import pyarrow.parquet as pq
from scipy.spatial import ConvexHull

ROOT = pathlib.Path(__file__).resolve().parents[2]
SCANS_A_FILE = 50
SWEEPS_A_YARD = 4
NEIGHBOURS = [(r, c) for r in (-1, 0, 1) for c in (-1, 0, 1) if (r, c) != (0, 0)]
NAMES = ["mean_height_m", "height_variance_m2", "height_difference_m", "point_count", "pitch_rad", "roll_rad"]
NAMES += [f"neighbour_{name}_m" for name in ("sw", "s", "se", "w", "e", "nw", "n", "ne")]


class Yard:
    """A yard and a pose, as marsyard wrote them."""

    def __init__(self, path):
        facts = json.loads(path.read_text())
        self.__dict__.update(facts)
        n = self.degree + 1
        self.matrix = np.zeros((n, n))
        self.matrix[[i for i in range(n) for _ in range(n - i)], [j for i in range(n) for j in range(n - i)]] = self.coefficients
        self.rocks = [np.array(rock) for rock in self.rocks]
        self.rotation = np.array(self.world_from_sensor)
        self.sensor = np.array(self.sensor_m)


class Mesh:
    """What all yards share: the grid of the ground and its triangles."""

    sweeps = 1

    def __init__(self, spacing_m, yard):
        side = round(yard.extent_m / spacing_m) + 1
        self.axis = np.linspace(0.0, yard.extent_m, side)
        u = (self.axis - yard.extent_m / 2) / yard.half_m
        self.basis = np.polynomial.legendre.legvander(u, yard.degree) * np.sqrt(2 * np.arange(yard.degree + 1) + 1)
        self.triangles = {}

    def ground(self, yard, rows, columns):
        """Corners and triangles of a window of the grid."""
        y, x = np.meshgrid(self.axis[rows], self.axis[columns], indexing="ij")
        z = self.basis[rows] @ yard.matrix.T @ self.basis[columns].T
        corners = np.stack([x, y, z], axis=-1).reshape(-1, 3).astype(np.float32)
        if z.shape not in self.triangles:
            height, width = z.shape
            sw = (np.arange(height - 1)[:, None] * width + np.arange(width - 1)).reshape(-1)
            two = np.stack([sw, sw + 1, sw + width + 1, sw, sw + width + 1, sw + width], axis=-1)
            self.triangles[z.shape] = o3d.core.Tensor(two.reshape(-1, 3).astype(np.uint32))
        return o3d.core.Tensor(corners), self.triangles[z.shape]

    def scene(self, yard):
        """Open3D's scene; geometry 0 is the ground, 1 the rocks."""
        return scene_of(self.ground(yard, slice(None), slice(None)), yard.rocks)

    def cells(self, yard, scene, directions, random):
        return cells_by_sorting(yard, *points(yard, scene, directions, random))


class CutMesh(Mesh):
    """The same of what is within reach, for some sweeps of a yard."""

    def __init__(self, spacing_m, yard, sweeps):
        super().__init__(spacing_m, yard)
        self.sweeps = sweeps
        # What noise moves into the cells' range lies a little beyond it.
        self.reach_m = yard.sensor_range_m[1] if sweeps > 1 else yard.max_range_m + 0.2

    def scene(self, yard):
        window = [slice(max(np.searchsorted(self.axis, at - self.reach_m) - 1, 0), np.searchsorted(self.axis, at + self.reach_m) + 1)
                  for at in yard.sensor[:2]]
        is_near = lambda rock: np.linalg.norm((rock - yard.sensor)[:, :2], axis=1).min() <= self.reach_m + np.ptp(rock, axis=0).max()
        return scene_of(self.ground(yard, window[1], window[0]), [rock for rock in yard.rocks if is_near(rock)])

    def cells(self, yard, scene, directions, random):
        for _ in range(self.sweeps - 1):
            cast(yard, scene, directions)
        turned, answer = cast(yard, scene, directions)
        noise = random.standard_normal(len(turned)) if random is not None else np.zeros(0)
        sigmas = np.array([yard.range_noise[name] for name in ("sigma_m", "sigma_per_m", "min_sigma_m")])
        row, col, label, features = binned(answer["t_hit"].numpy(), answer["geometry_ids"].numpy(), turned, noise, sigmas, np.array(yard.sensor_range_m),
                                           yard.sensor, yard.max_range_m, yard.cell_m, yard.rover_z_m, yard.pitch_rad, yard.roll_rad)
        return row, col, label, list(features)


def scene_of(ground, rocks):
    scene = o3d.t.geometry.RaycastingScene(nthreads=1)
    scene.add_triangles(*ground)
    if rocks:
        offsets = np.cumsum([0] + [len(rock) for rock in rocks])
        triangles = np.concatenate([ConvexHull(rock).simplices + k for rock, k in zip(rocks, offsets)])
        corners = np.concatenate(rocks).astype(np.float32)
        scene.add_triangles(o3d.core.Tensor(corners), o3d.core.Tensor(triangles.astype(np.uint32)))
    return scene


def cast(yard, scene, directions):
    rays = np.empty((len(directions), 6), dtype=np.float32)
    turned = directions @ yard.rotation.T
    rays[:, :3] = yard.sensor
    rays[:, 3:] = turned
    return turned, scene.cast_rays(o3d.core.Tensor(rays), nthreads=1)


def points(yard, scene, directions, random):
    """Points of a scan in the map, and which lie on a rock; noise where there is a generator."""
    turned, answer = cast(yard, scene, directions)
    range_m = answer["t_hit"].numpy().astype(np.float64)
    near_m, far_m = yard.sensor_range_m
    hit = np.flatnonzero(range_m <= far_m)
    range_m, turned = range_m[hit], turned[hit]
    on_rock = answer["geometry_ids"].numpy()[hit] == 1
    if random is not None:
        sigma_m = np.maximum(yard.range_noise["sigma_m"] + yard.range_noise["sigma_per_m"] * range_m, yard.range_noise["min_sigma_m"])
        range_m = range_m + random.standard_normal(len(hit)) * sigma_m
        good = (range_m >= near_m) & (range_m <= far_m)
        range_m, turned, on_rock = range_m[good], turned[good], on_rock[good]
    offset = turned * range_m[:, None]
    good = offset[:, 0] ** 2 + offset[:, 1] ** 2 <= yard.max_range_m**2
    return offset[good] + yard.sensor, on_rock[good]


def cells_by_sorting(yard, place, on_rock):
    """Rows, columns, labels and 14 features."""
    col, row = (np.floor(place[:, k] / yard.cell_m).astype(np.int64) for k in (0, 1))
    height = place[:, 2] - yard.rover_z_m
    # A dense grid with a border of empty cells.
    first_row, first_col = row.min() - 1, col.min() - 1
    rows, cols = row.max() - first_row + 2, col.max() - first_col + 2
    index = (row - first_row) * cols + (col - first_col)
    count = np.bincount(index, minlength=rows * cols)
    full = np.flatnonzero(count)
    points = count[full]
    sums = np.bincount(index, weights=height, minlength=rows * cols)
    mean = np.full(rows * cols, np.nan)
    mean[full] = sums[full] / points
    variance = np.bincount(index, weights=(height - mean[index]) ** 2, minlength=rows * cols)[full] / points
    obstacle = np.bincount(index[on_rock], minlength=rows * cols)[full]
    order = np.argsort(index, kind="stable")
    starts = np.cumsum(points) - points
    by_cell = height[order]
    spread = np.maximum.reduceat(by_cell, starts) - np.minimum.reduceat(by_cell, starts)
    own = mean[full]
    around = [mean[full + r * cols + c] for r, c in NEIGHBOURS]
    around = [np.where(np.isnan(height), own, height) for height in around]
    same = np.ones(len(full))
    features = [own, variance, spread, points, yard.pitch_rad * same, yard.roll_rad * same, *around]
    label = (obstacle > 0).astype(np.int8)
    return full // cols + first_row, full % cols + first_col, label, [f.astype(np.float32) for f in features]


@numba.njit(cache=False)
def binned(range_m, geometry, turned, noise, sigmas, gates_m, sensor_m, reach_m, cell_m, rover_z_m, pitch_rad, roll_rad):
    """Hits to rows, columns, labels and 14 features: as `points` and `cells_by_sorting`, whose sums run in another order."""
    first_row, first_col = int(np.floor((sensor_m[1] - reach_m) / cell_m)) - 1, int(np.floor((sensor_m[0] - reach_m) / cell_m)) - 1
    rows = int(np.floor((sensor_m[1] + reach_m) / cell_m)) - first_row + 2
    cols = int(np.floor((sensor_m[0] + reach_m) / cell_m)) - first_col + 2
    index, height = np.empty(len(range_m), np.int64), np.empty(len(range_m))
    count, obstacle = np.zeros(rows * cols, np.int64), np.zeros(rows * cols, np.int8)
    mean, variance = np.zeros(rows * cols), np.zeros(rows * cols)
    low, high = np.full(rows * cols, np.inf), np.full(rows * cols, -np.inf)
    points = 0
    for k in range(len(range_m)):
        far_m = np.float64(range_m[k])
        if far_m > gates_m[1]:
            continue
        if len(noise):
            far_m += noise[k] * max(sigmas[0] + sigmas[1] * far_m, sigmas[2])
            if far_m < gates_m[0] or far_m > gates_m[1]:
                continue
        x, y = turned[k, 0] * far_m, turned[k, 1] * far_m
        if x * x + y * y > reach_m * reach_m:
            continue
        at = (int(np.floor((y + sensor_m[1]) / cell_m)) - first_row) * cols + int(np.floor((x + sensor_m[0]) / cell_m)) - first_col
        z = turned[k, 2] * far_m + sensor_m[2] - rover_z_m
        index[points], height[points] = at, z
        points += 1
        count[at] += 1
        mean[at] += z
        low[at], high[at] = min(low[at], z), max(high[at], z)
        if geometry[k] == 1:
            obstacle[at] = 1
    for at in range(rows * cols):
        mean[at] = mean[at] / count[at] if count[at] else np.nan
    for k in range(points):
        off = height[k] - mean[index[k]]
        variance[index[k]] += off * off
    full = np.flatnonzero(count)
    features = np.empty((14, len(full)), np.float32)
    for k in range(len(full)):
        at = full[k]
        features[0, k], features[1, k], features[2, k] = mean[at], variance[at] / count[at], high[at] - low[at]
        features[3, k], features[4, k], features[5, k] = count[at], pitch_rad, roll_rad
        column = 6
        for r in (-1, 0, 1):
            for c in (-1, 0, 1):
                if r != 0 or c != 0:
                    beside = mean[at + r * cols + c]
                    features[column, k] = mean[at] if np.isnan(beside) else beside
                    column += 1
    return full // cols + first_row, full % cols + first_col, obstacle[full], features


def table(scene, found):
    row, col, label, features = found
    columns = {
        "scene_id": np.full(len(row), scene, dtype=np.int64),
        "scan_id": np.zeros(len(row), dtype=np.int32),
        "row": row.astype(np.int32),
        "col": col.astype(np.int32),
        "label": label,
    }
    return pa.table(columns | dict(zip(NAMES, features)))


def run_peer(yards, mesh, directions, folder, random):
    """CPU seconds a yard, the last sweep of each written to Parquet files."""
    begin = time.process_time()
    waiting = []
    for k, yard in enumerate(yards):
        waiting.append(table(k, mesh.cells(yard, mesh.scene(yard), directions, random)))
        if len(waiting) == SCANS_A_FILE or k + 1 == len(yards):
            pq.write_table(pa.concat_tables(waiting), folder / f"{k}.parquet", compression="zstd")
            waiting = []
    return (time.process_time() - begin) / len(yards)


def run_marsyard(binary, scenes, sets, folder):
    """CPU seconds of a whole build, how many rays it cast, and how many scans it delivered, one a scene."""
    out = folder / "corpus"
    shutil.rmtree(out, ignore_errors=True)
    a_shard = next(n for n in range(min(scenes, SCANS_A_FILE), 0, -1) if scenes % n == 0)
    command = [binary, "generate", str(ROOT / "configs/paper.yaml"), "--threads", "1", "--out", str(out)]
    for override in (f"scenes={scenes}", f"scenes_per_shard={a_shard}", *sets):
        command += ["--set", override]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    talk = process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    if status != 0:
        raise SystemExit(f"{' '.join(command)}\n{talk}")
    report = json.loads((out / "report.json").read_text())
    return usage.ru_utime + usage.ru_stime, report["rays"], json.loads((out / "manifest.json").read_text())["tables"]["scenes"]["rows"]


def compare(yards, mesh, directions):
    """A peer's cells without noise against marsyard's: shares and errors."""
    cells_all = same_cells = equal_counts = labels_other = 0
    errors = []
    for yard in yards:
        row, col, label, features = mesh.cells(yard, mesh.scene(yard), directions, None)
        theirs = {key: k for k, key in enumerate(zip(row.tolist(), col.tolist()))}
        ours = {(r, c): k for k, (r, c, _, _) in enumerate(yard.cells)}
        cells_all += len(ours.keys() | theirs.keys())
        both = sorted(ours.keys() & theirs.keys())
        same_cells += len(both)
        mine, peers = [ours[key] for key in both], [theirs[key] for key in both]
        our_features = np.array(yard.features)[mine]
        their_features = np.stack(features, axis=1)[peers].astype(np.float64)
        equal_counts += int((our_features[:, 3] == their_features[:, 3]).sum())
        labels_other += int((np.array([yard.cells[k][2] for k in mine]) != label[peers]).sum())
        # A mean moves with the points in the cell too; where those are as many, they are most likely the same.
        alike = our_features[:, 3] == their_features[:, 3]
        errors.append(np.abs(our_features - their_features)[alike])
    errors = np.concatenate(errors)
    return {
        "cells": cells_all,
        "in_both": same_cells,
        "equal_point_counts": equal_counts,
        "other_labels": labels_other,
        "feature_error_where_counts_are_equal": {
            name: {"median": float(np.median(e)), "p99": float(np.quantile(e, 0.99)), "max": float(e.max())}
            for name, e in zip(NAMES, errors.T)
        },
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--scenes", type=int, default=60)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--binary", default=str(ROOT / "target/release/marsyard"))
    parser.add_argument("--example", default=str(ROOT / "target/release/examples/pipeline_peer"))
    parser.add_argument("--out", help="write the figures as JSON")
    arguments = parser.parse_args()
    pa.set_cpu_count(1)
    folder = pathlib.Path(tempfile.mkdtemp(prefix="whole_pipeline_"))
    listed = subprocess.run([arguments.example, str(folder), str(arguments.scenes)], check=True, capture_output=True, text=True)
    yards = [Yard(folder / f"{scene}.json") for scene in listed.stdout.split()]
    directions = np.fromfile(folder / "directions.f64").reshape(-1, 3)
    kinds = {"plain": (Mesh,), "expert": (CutMesh, 1), f"expert, {SWEEPS_A_YARD} sweeps": (CutMesh, SWEEPS_A_YARD)}
    meshes = {f"{name}, {spacing_m} m": kind(spacing_m, yards[0], *sweeps) for name, (kind, *sweeps) in kinds.items() for spacing_m in (0.1, 0.05)}
    configs = {"paper.yaml": (), "paper.yaml, the paper's own contact solver: nelder_mead": ("drive.contact=nelder_mead",),
               "paper.yaml, true poses": ("slam=truth",)}

    report = {"yards": len(yards), "rays": len(directions), "rounds": arguments.rounds, "agreement": {}}
    # Of four sweeps the last makes the cells that one makes.
    for peer, mesh in ((peer, mesh) for peer, mesh in meshes.items() if mesh.sweeps == 1):
        agreement = report["agreement"][peer] = compare(yards, mesh, directions)
        print(
            f"without noise, {peer}: {agreement['in_both']} of {agreement['cells']} cells in both,"
            f" {agreement['equal_point_counts']} with as many points, {agreement['other_labels']} of another label"
        )
        for name, e in agreement["feature_error_where_counts_are_equal"].items():
            print(f"  {name:22} median {e['median']:.1e}  p99 {e['p99']:.1e}  max {e['max']:.1e}")

    random = np.random.default_rng(1)
    for mesh in meshes.values():
        run_peer(yards[:2], mesh, directions, folder, random)
    seconds, sweeps_a_scan = {}, {}
    note = lambda name, value: seconds.setdefault(name, []).append(value)
    for _ in range(arguments.rounds):
        for peer, mesh in meshes.items():
            note(peer, run_peer(yards, mesh, directions, folder, random))
        for name, sets in configs.items():
            cpu_s, rays, scans = run_marsyard(arguments.binary, arguments.scenes, sets, folder)
            sweeps_a_scan[name] = rays / len(directions) / scans
            note(f"{name}, a scan", cpu_s / scans)
            note(f"{name}, a sweep", cpu_s / scans / sweeps_a_scan[name])
    report["load"] = os.getloadavg()[0]
    report["cpu_ms"] = {name: 1e3 * float(np.median(times)) for name, times in seconds.items()}
    report["sweeps_a_scan"], report["ratios"] = sweeps_a_scan, {}
    for peer in meshes:
        print(f"{peer}: {report['cpu_ms'][peer]:.1f} ms of CPU a yard")
    for name in configs:
        print(f"marsyard, {name}: {report['cpu_ms'][f'{name}, a sweep']:.2f} ms of CPU a sweep, {report['cpu_ms'][f'{name}, a scan']:.1f} a scan"
              f" of {sweeps_a_scan[name]:.2f} sweeps")
        for peer in meshes:
            unit = "a sweep" if peer.startswith("plain") else "a scan"
            ratios = np.array(seconds[peer]) / np.array(seconds[f"{name}, {unit}"])
            low, middle, high = (float(q) for q in np.quantile(ratios, (0.1, 0.5, 0.9)))
            report["ratios"][f"{peer} over {name}"] = [low, middle, high]
            print(f"  {middle:5.1f} times less {unit} than {peer} ({low:.1f} .. {high:.1f})")
    print(f"load {report['load']:.1f}")
    shutil.rmtree(folder)
    if arguments.out:
        pathlib.Path(arguments.out).write_text(json.dumps(report, indent=1) + os.linesep)


if __name__ == "__main__":
    main()
