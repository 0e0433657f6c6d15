#!/usr/bin/env python3
"""Clouds that other programs write, through `marsyard classify`, and back into other programs.

    python scripts/interop/check_clouds.py MARSYARD MODEL [--keep FOLDER]

MARSYARD is the binary, MODEL a model.safetensors that takes no intensities. One cloud of a yard (fixed seed, with points that
are not finite) is written as PLY (plyfile: ascii, both byte orders), PCD (pypcd4: ascii, binary, binary_compressed), LAS
(laspy: 1.2 and 1.4), KITTI .bin with .label (NumPy), CSV and XYZ (pandas); with Open3D installed, its PLY and compressed PCD
too. Of each, `classify` must give back the same points, intensities and labels. Its output is read by plyfile, pypcd4,
pyarrow, Pillow and PyYAML: cells, counts, features, outputs, classes, map pixels and mesh are computed again with NumPy.
Exit 1 at the first difference.
"""

import argparse
import json
import pathlib
import subprocess
import sys
import tempfile

import laspy
import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import yaml
from PIL import Image
from plyfile import PlyData, PlyElement
from pypcd4 import Encoding, PointCloud

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))
import network_json

try:
    import open3d
except ImportError:
    open3d = None

MAPPING = "labels: {1: traversable, 2: untraversable, 0: ignore}\n"
LAS_GRAIN_M = 1e-4
TEXT = ("plyfile ascii", "pypcd4 ascii", "pandas csv", "numpy xyz")


def expect(good, what):
    if not good:
        sys.exit(f"FAILED {what}")


def yard(seed=3, count=4000):
    """Rough ground with boxes on it, 8 m by 8 m: x, y, z, intensity as f32, a label a point; a few points are no place."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform(-4, 4, (count, 2))
    z = 0.02 * rng.standard_normal(count) + 0.05 * np.sin(xy[:, 0])
    label = np.ones(count, dtype=np.int64)
    for _ in range(12):
        at, side = rng.uniform(-3.5, 3.5, 2), rng.uniform(0.2, 0.5)
        inside = (np.abs(xy - at) < side / 2).all(axis=1)
        z[inside] += rng.uniform(0, 0.4, inside.sum())
        label[inside] = 2
    label[rng.integers(0, count, 40)] = 0
    cloud = np.column_stack([xy, z, rng.uniform(0, 1, count)]).astype(np.float32)
    cloud[::500, 2] = np.nan
    cloud[250, 0] = np.inf
    return cloud, label


def structured(cloud, label):
    rows = np.zeros(len(cloud), dtype=[(n, "f4") for n in ("x", "y", "z", "intensity")] + [("label", "i4")])
    for k, name in enumerate(("x", "y", "z", "intensity")):
        rows[name] = cloud[:, k]
    rows["label"] = label
    return rows


def write_all(folder, cloud, label):
    """Name -> (path, points as the file holds them, labels or None, intensities or None)."""
    finite = np.isfinite(cloud[:, :3]).all(axis=1)
    there, ids = cloud[finite], label[finite]
    files = {}

    def put(name, path, points=there[:, :3], labels=ids, intensities=there[:, 3], lost=int((~finite).sum())):
        files[name] = (path, points.astype(np.float64), labels, intensities, lost)

    for name, text, order in (("ascii", True, "="), ("little", False, "<"), ("big", False, ">")):
        path = folder / f"plyfile-{name}.ply"
        vertices = PlyElement.describe(structured(cloud, label), "vertex")
        PlyData([vertices], text=text, byte_order=order).write(str(path))
        put(f"plyfile {name}", path)
    fields, types = ("x", "y", "z", "intensity", "label"), (np.float32,) * 4 + (np.int32,)
    columns = [cloud[:, k] for k in range(4)] + [label.astype(np.int32)]
    for encoding in (Encoding.ASCII, Encoding.BINARY, Encoding.BINARY_COMPRESSED):
        path = folder / f"pypcd4-{encoding.value}.pcd"
        PointCloud.from_points(columns, fields, types).save(path, encoding=encoding)
        put(f"pypcd4 {encoding.value}", path)
    for version, form in (("1.2", 3), ("1.4", 6)):
        path = folder / f"laspy-{version}.las"
        las = laspy.create(file_version=version, point_format=form)
        las.header.scales, las.header.offsets = [LAS_GRAIN_M] * 3, [1.0, -2.0, 0.5]
        las.x, las.y, las.z = there[:, :3].astype(np.float64).T
        las.intensity = np.round(there[:, 3] * 65535).astype(np.uint16)
        las.classification = ids.astype(np.uint8)
        las.write(str(path))
        again = laspy.read(str(path))
        points = np.column_stack([again.x, again.y, again.z])
        put(f"laspy {version}", path, points, intensities=np.asarray(again.intensity), lost=0)
    path = folder / "kitti.bin"
    cloud.tofile(path)
    ((np.uint32(7) << 16) | label.astype(np.uint32)).astype("<u4").tofile(path.with_suffix(".label"))
    put("KITTI", path)
    path = folder / "pandas.csv"
    pd.DataFrame(structured(there, ids)).to_csv(path, index=False)
    put("pandas csv", path, lost=0)
    path = folder / "numpy.xyz"
    np.savetxt(path, there[:, :3], fmt="%.9g")
    put("numpy xyz", path, labels=None, intensities=None, lost=0)
    if open3d is not None:
        geometry = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(there[:, :3].astype(np.float64)))
        for name, compressed in (("o3d.ply", False), ("o3d-binary.pcd", False), ("o3d-compressed.pcd", True)):
            path = folder / name
            expect(open3d.io.write_point_cloud(str(path), geometry, compressed=compressed), f"Open3D writes {name}")
            put(f"Open3D {name}", path, labels=None, intensities=None, lost=0)
    return files


def classify(marsyard, model, path, out, labelled, mapping):
    command = [marsyard, "classify", model, path, "--frame", "map", "--pose=0,0,0,0,0,0", "--json", "--out", out]
    command += ["--max-range", "100", "--window", "1"] + (["--labels", mapping] if labelled else [])
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True)
    expect(done.returncode == 0, f"classify {path}: {done.stderr}")
    return [json.loads(line) for line in done.stdout.splitlines()]


def check_points(name, out, stem, points, labels, intensities):
    vertices = PlyData.read(str(out / f"{stem}-labelled.ply"))["vertex"].data
    here = np.column_stack([vertices[axis] for axis in "xyz"])
    expect(here.shape == points.shape, f"{name}: {here.shape} points, {points.shape} were written")
    furthest = float(np.abs(here - points).max())
    # Text holds the shortest decimal of an f32, or one of ten digits: half a unit of an f32 below 4 m.
    grain = 1.2e-7 if name in TEXT else 0.0
    expect(furthest <= grain, f"{name}: points move by {furthest} m")
    if labels is not None:
        expect((vertices["label"] == labels).all(), f"{name}: labels")
    if intensities is not None:
        off = np.abs(vertices["intensity"] - intensities.astype(np.float32)).max()
        expect(off <= grain, f"{name}: intensities")
    cloud = PointCloud.from_path(out / f"{stem}-labelled.pcd")
    again = cloud.numpy(("x", "y", "z"))
    expect((again.astype(np.float32) == here.astype(np.float32)).all(), f"{name}: points of the PCD")
    # Singles only where they move no point by more than 1 mm; else the doubles of the PLY.
    moved = np.abs(cloud.pc_data["x"].astype(np.float64) - vertices["x"]).max()
    expect(moved <= (1e-3 if cloud.pc_data["x"].dtype == np.float32 else 0), f"{name}: the PCD moves points by {moved} m")
    of_class = cloud.numpy(("class",))[:, 0]
    expect((of_class == vertices["class"]).all(), f"{name}: classes of PCD and PLY")
    return vertices


def check_cells(name, out, points, vertices, model):
    """Cells, their first features, outputs and classes, from the points alone; the point's verdict is its cell's."""
    about, size = model["about"], model["about"]["cells"]["size_m"]
    cells = pq.read_table(out / "cells.parquet").to_pandas()
    index = pd.DataFrame({"row": np.floor(points[:, 1] / size), "col": np.floor(points[:, 0] / size)}).astype(np.int64)
    z = points[:, 2]
    groups = index.assign(z=z).groupby(["row", "col"])["z"]
    known = groups.agg(["size", "mean", "min", "max"]).reset_index()
    expect((cells[["row", "col"]].to_numpy() == known[["row", "col"]].to_numpy()).all(), f"{name}: cells")
    expect((cells["points"].to_numpy() == known["size"].to_numpy()).all(), f"{name}: counts")
    off = np.abs(cells["mean_height_m"] - known["mean"]).max(), np.abs(
        cells["height_difference_m"] - (known["max"] - known["min"])).max()
    expect(max(off) < 1e-6, f"{name}: heights are off by {off}")
    features = cells[about["features"]].to_numpy(dtype=np.float64)
    outputs = network_json.outputs(model, features)
    worst = float(np.abs(outputs - cells["output"]).max())
    expect(worst < 1e-6, f"{name}: outputs are off by {worst}")
    classes = np.searchsorted(about["thresholds"], cells["output"].to_numpy(), side="right")
    near = np.abs(cells["output"].to_numpy()[:, None] - np.array(about["thresholds"])).min(axis=1) < 1e-6
    expect(((classes == cells["class"]) | near).all(), f"{name}: classes")
    by_point = index.merge(cells[["row", "col", "output", "class"]], how="left", on=["row", "col"])
    expect((by_point["output"].to_numpy(dtype=np.float32) == vertices["output"]).all(), f"{name}: outputs of points")
    expect((by_point["class"].to_numpy() == vertices["class"]).all(), f"{name}: classes of points")
    return cells


def map_server(about, pixels):
    """Occupancies as nav2_map_server reads opaque pixels (map_io.cpp, loadMapFromFile): -1 unknown, 0 free to 100 occupied."""
    shade = pixels / 255.0
    occupancy = shade if about["negate"] else 1.0 - shade
    free, occupied = about["free_thresh"], about["occupied_thresh"]
    if about["mode"] == "raw":
        percent = np.round(shade * 255)
        return np.where(percent <= 100, percent, -1).astype(int)
    between = -1 if about["mode"] == "trinary" else np.rint((occupancy - free) / (occupied - free) * 100)
    return np.where(occupied < occupancy, 100, np.where(occupancy < free, 0, between)).astype(int)


def check_maps(name, out, stem, cells, model):
    """PGM and YAML as a map server reads them: cell by cell, north up, and unknown where there is no cell."""
    low, high = model["about"]["targets"]
    shade = np.clip((cells["output"].to_numpy(dtype=np.float64) - low) / (high - low), 0, 1)
    for kind, mode in (("cost", "raw"), ("class", "trinary")):
        about = yaml.safe_load((out / f"{stem}-{kind}.yaml").read_text())
        expect((about["mode"], about["negate"]) == (mode, 0), f"{name}: mode of {kind}")
        image = np.array(Image.open(out / about["image"]))
        size = about["resolution"]
        row = np.round(cells["row"] - about["origin"][1] / size).astype(int)
        col = np.round(cells["col"] - about["origin"][0] / size).astype(int)
        read = map_server(about, image)
        wanted = 100 * (shade if kind == "cost" else cells["class"].to_numpy(dtype=float))
        there = read[image.shape[0] - 1 - row, col]
        expect(np.abs(there - wanted).max() <= (0.5001 if kind == "cost" else 0), f"{name}: occupancies of {kind}")
        rest = np.ones(image.shape, dtype=bool)
        rest[image.shape[0] - 1 - row, col] = False
        expect((read[rest] == -1).all(), f"{name}: {kind} is not unknown where no cell is")


def check_mesh(name, out, stem, cells):
    mesh = PlyData.read(str(out / f"{stem}-mesh.ply"))
    vertices = np.column_stack([mesh["vertex"][axis] for axis in "xyz"])
    expect(len(vertices) == len(cells), f"{name}: vertices of the mesh")
    expect(np.abs(vertices[:, 2] - cells["mean_height_m"]).max() < 1e-6, f"{name}: heights of the mesh")
    faces = np.stack(mesh["face"]["vertex_indices"])
    a, b, c = vertices[faces[:, 0]], vertices[faces[:, 1]], vertices[faces[:, 2]]
    expect((np.cross(b - a, c - a)[:, 2] > 0).all(), f"{name}: faces of the mesh look up")
    if open3d is not None:
        again = open3d.io.read_triangle_mesh(str(out / f"{stem}-mesh.ply"))
        expect((len(again.vertices), len(again.triangles)) == (len(vertices), len(faces)), f"{name}: Open3D's mesh")


def check_far(marsyard, model_file, folder):
    """UTM coordinates come back from the labelled PLY and PCD as they went in."""
    cloud, _ = yard()
    there = cloud[np.isfinite(cloud[:, :3]).all(axis=1), :3].astype(np.float64) + [445000.125, 5030000.25, 1200.0]
    np.savetxt(folder / "utm.xyz", there, fmt="%.17g")
    pose = "--pose=445000.125,5030000.25,1200,0,0,0"
    command = [marsyard, "classify", model_file, folder / "utm.xyz", "--frame", "map", pose, "--out", folder / "utm-out"]
    done = subprocess.run(list(map(str, command)) + ["--max-range", "100", "--window", "1"], capture_output=True, text=True)
    expect(done.returncode == 0, f"classify utm.xyz: {done.stderr}")
    pcd = PointCloud.from_path(folder / "utm-out/utm-labelled.pcd").pc_data
    ply = PlyData.read(str(folder / "utm-out/utm-labelled.ply"))["vertex"].data
    for name, rows in (("PCD", pcd), ("PLY", ply)):
        off = np.abs(np.column_stack([rows[axis] for axis in "xyz"]) - there).max()
        expect(off <= 1e-9, f"UTM: the {name} is off by {off} m")
    print(f"UTM coordinates            {len(there)} points: equal in PLY and PCD")


def run(marsyard, model_file, folder):
    exported = folder / "model.json"
    subprocess.run([marsyard, "export", model_file, "--json", str(exported)], check=True, capture_output=True)
    model = json.loads(exported.read_text())
    mapping = folder / "mapping.yaml"
    mapping.write_text(MAPPING)
    cloud, label = yard()
    for name, (path, points, labels, intensities, lost) in write_all(folder, cloud, label).items():
        out = folder / f"{path.stem}-out"
        said = classify(marsyard, model_file, path, out, labels is not None, mapping)
        counts = (said[1]["points"], said[1]["points_not_finite"])
        expect(counts == (len(points), lost), f"{name}: {counts} points, {(len(points), lost)} were written")
        vertices = check_points(name, out, path.stem, points, labels, intensities)
        cells = check_cells(name, out, points, vertices, model)
        expect(said[1]["cells"] == len(cells), f"{name}: number of cells")
        check_maps(name, out, path.stem, cells, model)
        check_mesh(name, out, path.stem, cells)
        print(f"{name:<26} {len(points)} points, {lost} not finite, {len(cells)} cells: equal")
    check_far(marsyard, model_file, folder)
    print(f"Open3D {open3d.__version__ if open3d else 'is not installed: its files were not tried'}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("marsyard")
    parser.add_argument("model")
    parser.add_argument("--keep", help="write the files here and leave them")
    args = parser.parse_args()
    if args.keep:
        pathlib.Path(args.keep).mkdir(parents=True, exist_ok=True)
        run(args.marsyard, args.model, pathlib.Path(args.keep))
    else:
        with tempfile.TemporaryDirectory() as folder:
            run(args.marsyard, args.model, pathlib.Path(folder))


if __name__ == "__main__":
    main()
