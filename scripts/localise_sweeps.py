#!/usr/bin/env python3
"""What `marsyard localise --sweeps` finds on sweeps that a real sensor made, beside dead reckoning and a LiDAR odometry.

    python scripts/localise_sweeps.py --data FOLDER [--seeds 20]

FOLDER/mcd holds ninety sweeps of the sequence kth_day_06 of MCD (Nguyen et al. 2024), an Ouster with 64 rings that somebody carries for 11 m
past trunks, walls and people: from the example data of the public repository donceykong/OSM-BKI the files velodyne/*.bin, pose_inW.csv and
hhs_calib.yaml. The truth is the data set's (continuous-time, against a survey's map). The recording has no wheels: odometry is made of the
truth, per seed with noise of ODOMETRY, as speed and yaw rate from sweep to sweep, with roll and pitch and without a heading: real sweeps, simulated
instruments. The defaults of --feature-range-m and --sweep-spacing-m were chosen by this recording, so that it is no independent test of
them. The peer is KISS-ICP (Vizzo et al. 2023), as installed but without deskewing, since the files have no times of points; it reads the
sweeps alone, in the sensor's own frame, and is laid on the truth at the first sweep, as is everything here.

ATE and NEES are of x, y (and yaw) over all sweeps, from `localise --json` and for the peer computed here. Needs numpy, scipy, pyyaml and
kiss-icp. Writes localise_sweeps.json and .md into scripts/results.
"""

import argparse
import json
import pathlib
import subprocess
import sys
import tempfile
import time

import numpy as np
import yaml
from scipy.spatial.transform import Rotation

import study
from localise_check import wrap

# Standard deviations: metres and degrees per square root of a metre, degrees of roll and pitch.
ODOMETRY = {"0.05 m, 2 deg": (0.05, 2.0), "0.1 m, 5 deg": (0.1, 5.0)}
IMU_DEG = 0.5
# Metres per square root of a metre: whoever carries a sensor sways.
SIDEWAYS = 0.1
WAYS = {
    "as it is (sight 10 m, spacing 0.4 m, 1000 particles)": [],
    "registration alone": ["--registration"],
    "registration alone, all sweeps": ["--registration", "--sweep-spacing-m", "0"],
    "sight 5.3 m": ["--feature-range-m", "5.3"],
    "sight 20 m": ["--feature-range-m", "20"],
    "all sweeps": ["--sweep-spacing-m", "0"],
    "all sweeps, sight 5.3 m": ["--sweep-spacing-m", "0", "--feature-range-m", "5.3"],
    "spacing 0.2 m": ["--sweep-spacing-m", "0.2"],
    "spacing 0.8 m": ["--sweep-spacing-m", "0.8"],
    "100 particles": ["--particles", "100"],
}


def truth(folder):
    """Times of the sweeps, their files, and the sensor's poses in the world: [n, 4, 4]."""
    rows = np.genfromtxt(folder / "pose_inW.csv", delimiter=",", skip_header=1)
    files = {int(path.stem): path for path in folder.glob("velodyne/*.bin")}
    rows = rows[[int(number) in files for number in rows[:, 0]]]
    world_from_body = np.tile(np.eye(4), (len(rows), 1, 1))
    world_from_body[:, :3, :3] = Rotation.from_quat(rows[:, 5:9]).as_matrix()
    world_from_body[:, :3, 3] = rows[:, 2:5]
    body_from_sensor = np.array(yaml.safe_load((folder / "hhs_calib.yaml").read_text())["body"]["os_sensor"]["T"])
    return rows[:, 1] - rows[0, 1], [files[int(number)] for number in rows[:, 0]], world_from_body @ body_from_sensor


def angles(poses):
    """Roll, pitch and yaw as marsyard has them: radians, yaw about z first."""
    return Rotation.from_matrix(poses[:, :3, :3]).as_euler("ZYX")[:, ::-1]


def record(folder, times, files, poses, noise, seed):
    """Writes odometry.csv, sweeps.csv and truth.csv of one seed."""
    rng = np.random.default_rng(seed)
    of_way, of_heading = noise[0], np.radians(noise[1])
    roll, pitch, yaw = angles(poses).T
    read = np.array([roll, pitch]) + np.radians(IMU_DEG) * rng.normal(size=(2, len(times)))
    odometry = [(times[0], 0.0, 0.0, *read[:, 0])]
    for k in range(1, len(times)):
        step, turn, lasts = poses[k, :3, 3] - poses[k - 1, :3, 3], wrap(yaw[k] - yaw[k - 1]), times[k] - times[k - 1]
        middle = yaw[k - 1] + turn / 2
        ahead = (step[0] * np.cos(middle) + step[1] * np.sin(middle)) / np.cos(pitch[k])
        way = ahead + of_way * np.sqrt(abs(ahead)) * rng.normal()
        turned = turn + (of_heading * np.sqrt(abs(ahead)) + 0.05 * abs(turn)) * rng.normal()
        odometry.append((times[k], way / lasts, turned / lasts, *read[:, k]))
    tables = {
        "odometry": ("time_s,speed_mps,yaw_rate_radps,roll_rad,pitch_rad", odometry),
        "sweeps": ("time_s,file", zip(times, files)),
        "truth": ("time_s,x_m,y_m,z_m,roll_rad,pitch_rad,yaw_rad", zip(times, *poses[:, :3, 3].T, roll, pitch, yaw)),
    }
    for name, (head, rows) in tables.items():
        lines = [",".join(str(float(v)) if not isinstance(v, pathlib.Path) else str(v) for v in row) for row in rows]
        (folder / f"{name}.csv").write_text("\n".join([head, *lines]) + "\n")


def localise(marsyard, folder, noise, options):
    logs = [folder / "odometry.csv", "--sweeps", folder / "sweeps.csv", "--truth", folder / "truth.csv", "--out", folder / "out"]
    stated = ["--odometry-m-per-sqrt-m", noise[0], "--odometry-deg-per-sqrt-m", noise[1], "--imu-deg", IMU_DEG,
              "--sideways-m-per-sqrt-m", SIDEWAYS, "--sensor", "0,0,0"]
    began = time.perf_counter()
    done = subprocess.run([marsyard, "localise", *map(str, [*logs, *stated, *options]), "--json"], capture_output=True, text=True)
    if done.returncode:
        sys.exit(done.stderr)
    return json.loads(done.stdout), time.perf_counter() - began


def of_peer(files, poses):
    """ATE and last error of KISS-ICP, metres, and seconds a sweep."""
    from kiss_icp.config import KISSConfig
    from kiss_icp.kiss_icp import KissICP

    config = KISSConfig()
    config.data.deskew = False
    config.mapping.voxel_size = config.data.max_range / 100.0
    config.registration.max_num_threads = 1
    odometry, found = KissICP(config), []
    began = time.perf_counter()
    for path in files:
        points = np.fromfile(path, "<f4").reshape(-1, 4)[:, :3].astype(float)
        odometry.register_frame(points[np.any(points != 0, axis=1)], np.zeros(0))
        found.append(np.array(odometry.last_pose))
    lasted = time.perf_counter() - began
    laid = poses[0] @ np.linalg.inv(found[0]) @ np.array(found)
    off = np.linalg.norm((laid - poses)[:, :2, 3], axis=1)
    return {"ate_m": float(np.sqrt(np.mean(off**2))), "last_error_m": float(off[-1])}, lasted / len(files)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--marsyard", default=study.ROOT / "target" / "release" / "marsyard")
    parser.add_argument("--data", type=pathlib.Path, required=True)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--out", type=pathlib.Path, default=study.RESULTS)
    arguments = parser.parse_args()
    times, files, poses = truth(arguments.data.resolve() / "mcd")
    way = float(np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1).sum())
    peer, peer_s = of_peer(files, poses)
    rows, results = [], {"sweeps": len(files), "way_m": way, "kiss_icp": {**peer, "seconds_a_sweep": peer_s}, "odometry": {}}
    for of_odometry, noise in ODOMETRY.items():
        found = {"dead reckoning": [], **{way: [] for way in WAYS}}
        lasted = {way: [] for way in WAYS}
        for seed in range(1, arguments.seeds + 1):
            with tempfile.TemporaryDirectory() as folder:
                folder = pathlib.Path(folder)
                record(folder, times, files, poses, noise, seed)
                for name, options in WAYS.items():
                    said, seconds = localise(arguments.marsyard, folder, noise, options)
                    found[name].append(said["score"])
                    lasted[name].append(seconds / len(files))
                found["dead reckoning"].append(said["dead_reckoning"])
        reckoned = np.array([score["ate_m"] for score in found["dead reckoning"]])
        told = results["odometry"][of_odometry] = {}
        for name, scores in found.items():
            ate, last = (np.array([score[key] for score in scores]) for key in ("ate_m", "last_error_m"))
            told[name] = {"ate_m": float(ate.mean()), "last_error_m": float(last.mean()), "better_share": float(np.mean(ate < reckoned)),
                          "heading_rms_deg": float(np.degrees(np.mean([score["heading_rms_rad"] for score in scores]))),
                          "nees": float(np.mean([score["nees"] for score in scores if score["nees"] is not None]))}
            row = told[name]
            rows.append([of_odometry, name, f"{row['ate_m']:.3f}", f"{row['last_error_m']:.3f}",
                         "" if name == "dead reckoning" else f"{100 * row['better_share']:.0f}", f"{row['heading_rms_deg']:.2f}", f"{row['nees']:.1f}",
                         f"{1000 * np.median(lasted[name]):.0f}" if name in lasted else ""])
    rows.append(["none", "KISS-ICP", f"{peer['ate_m']:.3f}", f"{peer['last_error_m']:.3f}", "", "", "", f"{1000 * peer_s:.0f}"])
    head = ["noise of odometry", "method", "ATE m", "at the end m", "better %", "heading deg", "NEES", "ms a sweep"]
    text = f"""# `marsyard localise --sweeps` on real sweeps

`python scripts/localise_sweeps.py --data FOLDER --seeds {arguments.seeds}`: {len(files)} sweeps of an Ouster carried by hand over {way:.1f} m (MCD, kth_day_06). Odometry is made of
the truth with noise of the stated size, per square root of a metre; means over {arguments.seeds} draws of it. NEES of x, y, yaw: 3 is honest. Milliseconds a
listed sweep: one process on a shared machine, files read and dead reckoning included. The defaults of sight and spacing were chosen by this recording.

{study.markdown(head, rows)}
"""
    study.write_results(arguments.out, "localise_sweeps", results, text)


if __name__ == "__main__":
    main()
