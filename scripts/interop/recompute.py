"""Computes the cells of a corpus again with NumPy, from its `points` and `poses` tables and plan.yaml alone.

Written from the meaning of the columns, not from the Rust code: an independent second opinion. Indices, counts and labels
must be equal, f32 features within 2 units in the last place or 1e-9. What needs the yard itself (the true slope, the height
of objects) cannot be computed from points; `truth_slope_rad` is taken as it stands.
"""

import sys

import numpy as np
import polars as pl
import yaml

NEIGHBOURS = {  # name -> (rows to the north, columns to the east), in the order of the mask's bits
    4: {"s": (-1, 0), "w": (0, -1), "e": (0, 1), "n": (1, 0)},
    8: {"sw": (-1, -1), "s": (-1, 0), "se": (-1, 1), "w": (0, -1), "e": (0, 1), "nw": (1, -1), "n": (1, 0), "ne": (1, 1)},
}
NEIGHBOURS[24] = {
    "s" * -r + "n" * r + "w" * -c + "e" * c: (r, c) for r in range(-2, 3) for c in range(-2, 3) if (r, c) != (0, 0)
}


def rotation(roll, pitch, yaw):
    """Rz(yaw) Ry(pitch) Rx(roll)."""
    (sr, sp, sy), (cr, cp, cy) = np.sin([roll, pitch, yaw]), np.cos([roll, pitch, yaw])
    rz = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    ry = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    rx = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    return rz @ ry @ rx


def mount_of(family, scene):
    """rover_from_sensor, rotation and position: the rover's mount, with what the scene drew for `sweep.mount`."""
    drawn = {key.removeprefix("sweep.mount."): value for key, value in scene.items() if key.startswith("sweep.mount.")}
    mount = family["drive"]["rover"]["mount"] | {key: value for key, value in drawn.items() if value is not None}
    angles = [mount[key] for key in ("roll_deg", "pitch_deg", "yaw_deg")]
    return rotation(*np.radians(angles)), np.array([mount[key] for key in ("x_m", "y_m", "z_m")])


class Scan:
    """A kept scan: the pose it was taken at, as believed, and its points."""

    def __init__(self, points, pose, mount):
        self.pose = pose
        hits = points.filter(pl.col("status") == 0)
        self.hits = len(hits)
        self.sensor = hits.select("sensor_x_m", "sensor_y_m", "sensor_z_m").to_numpy()
        self.map = hits.select("map_x_m", "map_y_m", "map_z_m").to_numpy()
        self.range_m = hits["range_m"].to_numpy()
        self.intensity = hits["intensity"].to_numpy().astype(np.float64)
        self.obstacle = hits["truth_obstacle"].to_numpy()
        self.top = hits["truth_top"].to_numpy()
        self.object = hits["truth_object_id"].to_numpy()
        self.placed = hits["row"].is_not_null().to_numpy()
        self.row = hits["row"].fill_null(0).to_numpy()
        self.col = hits["col"].fill_null(0).to_numpy()
        self.distance_m = self.distances(*mount)

    def distances(self, rover_from_sensor, lever):
        """Horizontal distance of each point from the sensor; checks the points' places on the way."""
        position = np.array([self.pose[key] for key in ("x_m", "y_m", "z_m")])
        turn = rotation(self.pose["roll_rad"], self.pose["pitch_rad"], self.pose["yaw_rad"])
        expect_close(np.linalg.norm(self.sensor, axis=1), self.range_m, 1e-9, "length of points and range", self)
        there = self.sensor @ (turn @ rover_from_sensor).T + (turn @ lever + position)
        expect_close(there, self.map, 1e-9, "points in the map", self)
        offset = self.map - (turn @ lever + position)
        return np.hypot(offset[:, 0], offset[:, 1])

    def check_places(self, size_m, max_range_m):
        row, col = (np.floor(self.map[:, k] / size_m).astype(np.int64) for k in (1, 0))
        # Points within a rounding of the limit may fall on either side.
        certain = np.abs(self.distance_m - max_range_m) > 1e-9
        expect_equal(self.placed[certain], (self.distance_m <= max_range_m)[certain], "points with a cell", self)
        expect_equal(self.row[self.placed], row[self.placed], "row of points", self)
        expect_equal(self.col[self.placed], col[self.placed], "col of points", self)


def expect_equal(found, expected, what, scan):
    wrong = np.flatnonzero(np.atleast_1d(np.asarray(found) != np.asarray(expected)))
    if len(wrong):
        k = wrong[0]
        sys.exit(f"FAILED {what} in {scan.pose['scene_id']}/{scan.pose['scan_id']}: {len(wrong)} differ, the first is "
                 f"{np.atleast_1d(found)[k]}, computed {np.atleast_1d(expected)[k]} (row {k})")


def expect_close(found, expected, tolerance, what, scan):
    if len(found) and np.abs(found - expected).max() > tolerance:
        sys.exit(f"FAILED {what} in {scan.pose['scene_id']}/{scan.pose['scan_id']}: off by {np.abs(found - expected).max()}")


def ulps(a, b):
    """Distance of f32 values in units in the last place."""
    def ordered(x):
        bits = x.view(np.int32).astype(np.int64)
        return np.where(bits < 0, -(bits & 0x7FFFFFFF), bits)
    return np.abs(ordered(a) - ordered(b))


def expect_f32(found, computed, what, scan, worst):
    found, computed = found.astype(np.float32), np.asarray(computed).astype(np.float32)
    off = ulps(found, computed)
    fine = (off <= 2) | (np.abs(found.astype(np.float64) - computed) <= 1e-9)
    worst[what] = max(worst.get(what, 0), int(off.max(initial=0)))
    if not fine.all():
        k = np.flatnonzero(~fine)[0]
        sys.exit(f"FAILED {what} in {scan.pose['scene_id']}/{scan.pose['scan_id']}: stored {found[k]!r}, computed "
                 f"{computed[k]!r} (row {k}, {off[k]} units in the last place)")


def local_ground(index, mean, local, size_m):
    """Per cell, the percentile (nearest rank) of the means of all cells within the radius, itself included."""
    # Whole numbers of cells; a centre on the circle lies within.
    reach_squared = (local["radius_m"] / size_m) ** 2 * (1 + 1e-9)
    ground = np.empty(len(index))
    for k, cell in enumerate(index.astype(np.int64)):
        near = np.sort(mean[((index - cell) ** 2).sum(axis=1) <= reach_squared])
        ground[k] = near[max(int(np.ceil(local["percentile"] * len(near) / 100)), 1) - 1]
    return ground


def compare(cells, window, kept, params, worst):
    """The stored cells of one kept scan against those of its window's points."""
    def gather(take):
        return np.concatenate([take(scan)[scan.placed] for scan in window])

    row, col = gather(lambda s: s.row), gather(lambda s: s.col)
    height = gather(lambda s: s.map[:, 2]) - kept.pose["z_m"]
    index, of_point = np.unique(np.stack([row, col], axis=1), axis=0, return_inverse=True)
    of_point = of_point.ravel()
    stored = {name: cells[name].to_numpy() for name in cells.columns}
    expect_equal([len(cells)], [len(index)], "number of cells", kept)
    expect_equal(stored["row"], index[:, 0], "row of cells", kept)
    expect_equal(stored["col"], index[:, 1], "col of cells", kept)

    def total(values):
        return np.bincount(of_point, weights=values, minlength=len(index))

    count = np.bincount(of_point, minlength=len(index))
    expect_equal(stored["points"], count, "points", kept)
    mean = total(height) / count
    low, high = np.full(len(index), np.inf), np.full(len(index), -np.inf)
    np.minimum.at(low, of_point, height)
    np.maximum.at(high, of_point, height)
    computed = {
        "mean_height_m": mean,
        "height_variance_m2": total((height - mean[of_point]) ** 2) / count,
        "height_difference_m": high - low,
        "point_count": count,
        "range_m": total(gather(lambda s: s.distance_m)) / count,
    }
    for name in ("pitch_rad", "roll_rad", "sigma_x_m", "sigma_y_m", "sigma_z_m", "sigma_roll_rad", "sigma_pitch_rad", "sigma_yaw_rad"):
        computed[name] = np.full(len(index), kept.pose[name])
    if "intensity_mean" in stored:
        power = gather(lambda s: s.intensity * s.range_m**2)
        computed["intensity_mean"] = total(power) / count
        computed["intensity_variance"] = total((power - computed["intensity_mean"][of_point]) ** 2) / count
    where = {tuple(cell): k for k, cell in enumerate(index.tolist())}
    mask = np.zeros(len(index), np.int64)
    for bit, (name, (north, east)) in enumerate(NEIGHBOURS[params["neighbours"]].items()):
        beside = np.array([where.get((r + north, c + east), -1) for r, c in index.tolist()], np.int64)
        mask |= (beside >= 0).astype(np.int64) << bit
        computed[f"neighbour_{name}_m"] = np.where(beside >= 0, mean[beside], mean)
    local = params.get("local_height")
    expect_equal("local_height_m" in stored, local is not None, "column local_height_m", kept)
    if local:
        computed["local_height_m"] = mean - local_ground(index, mean, local, params["size_m"])
    expect_equal(stored["neighbour_mask"], mask, "neighbour_mask", kept)
    for name, values in computed.items():
        expect_f32(stored[name], values, name, kept, worst)

    obstacle = gather(lambda s: s.obstacle)
    obstacles = total(obstacle.astype(float)).astype(np.int64)
    tops = total((obstacle & gather(lambda s: s.top)).astype(float)).astype(np.int64)
    expect_equal(stored["truth_obstacle_points"], obstacles, "truth_obstacle_points", kept)
    expect_equal(stored["truth_top_points"], tops, "truth_top_points", kept)
    rule = params["labels"]
    bad = obstacles >= rule["min_obstacle_points"]
    if rule.get("max_ground_slope_deg") is not None:
        bad |= stored["truth_slope_rad"].astype(np.float64) > np.radians(rule["max_ground_slope_deg"])
    expect_equal(stored["label"], bad.astype(np.int64), "label", kept)
    # The tallest object is one of the cell's own; ground alone is -1.
    objects = set(zip(of_point.tolist(), gather(lambda s: s.object).tolist()))
    solid = {k for k, thing in objects if thing >= 0}
    known = [(k, thing) in objects if thing >= 0 else k not in solid for k, thing in enumerate(stored["truth_object_id"].tolist())]
    expect_equal(known, [True] * len(index), "truth_object_id", kept)


def check_cells(corpus):
    plan = yaml.safe_load((corpus.place / "plan.yaml").read_text())
    # A plan of one kind of scene has no families: its own sections are the one named default.
    families = {family["name"]: family for family in plan.get("families", [plan | {"name": "default"}])}
    worst, scans, rows = {}, 0, 0
    for shard in corpus.shards:
        tables = {name: pl.read_parquet(corpus.place / facts["path"]) for name, facts in shard["tables"].items()}
        poses = tables["poses"].filter(pl.col("scan_id").is_not_null())
        scene_of = {scene["scene_id"]: scene for scene in tables["scenes"].iter_rows(named=True)}
        points = tables["points"].partition_by("scene_id", "scan_id", as_dict=True)
        cells = tables["cells"].partition_by("scene_id", "scan_id", as_dict=True)
        earlier, hits = [], {}
        for pose in poses.iter_rows(named=True):
            address = (pose["scene_id"], pose["scan_id"])
            scene = scene_of[pose["scene_id"]]
            family = families[scene["family"]]
            params = family["cells"]
            scan = Scan(points[address], pose, mount_of(family, scene))
            max_range_m = params.get("max_range_m") or family["sweep"]["sensor"]["max_range_m"]
            scan.check_places(params["size_m"], max_range_m)
            earlier = [s for s in earlier if s.pose["scene_id"] == pose["scene_id"]] + [scan]
            window = earlier[-params["window_scans"] :]
            complete = params["window_scans"] == 1 or family["drive"]["keep"] == "all"
            if not complete:
                sys.exit("FAILED: a window over scans that are not kept cannot be computed again; use keep: all")
            hits[pose["scene_id"]] = hits.get(pose["scene_id"], 0) + sum(s.hits for s in window)
            stored = cells.get(address, tables["cells"].clear())
            compare(stored, window, scan, params, worst)
            scans, rows = scans + 1, rows + len(stored)
        for scene, count in hits.items():
            if scene_of[scene]["points_in"] != count:
                sys.exit(f"FAILED points_in of scene {scene}: stored {scene_of[scene]['points_in']}, counted {count}")
    print(f"    recomputed {rows} cells of {scans} scans; worst: {max(worst.values(), default=0)} units in the last place")
