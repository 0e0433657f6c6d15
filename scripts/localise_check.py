#!/usr/bin/env python3
"""Sets `marsyard localise` beside an EKF-SLAM written here, on a simulated log with known ids; makes the sample logs too.

    python scripts/localise_check.py [--seeds 100] [--check] [--sample]

A rover drives a circle of 3 m twice among 20 landmarks, level ground: odometry, ranges and bearings with white noise of stated size, a
feature half way within each fifth step. In a second kind of log each feature's noise is its own, by a factor of a sixth to six, as where a detector
tells how sure it is, and stands in its row. The reference is the textbook's (Thrun et al. 2005, table 10.1): one Gaussian over pose and map in
two dimensions, in NumPy, no code of marsyard's. --check fails where marsyard's mean error, 300 particles, exceeds 1.35 of the
reference's in either kind, where what rows tell of their noise brings it less than twice the standard error of what it brings, or where it does not beat dead
reckoning. --sample writes seed 1 to examples/logs.
"""

import argparse
import json
import pathlib
import subprocess
import sys
import tempfile

import numpy as np

import study

SAMPLE = study.ROOT / "examples" / "logs"
STEP_M, RADIUS_M, LAPS = 0.1, 3.0, 2
ODOMETRY, HEADING = 0.05, np.radians(2)  # per square root of a metre
RANGE, BEARING, REACH_M = 0.05, np.radians(1.5), 4.0
LEAST_RANGE_M = 0.2
MOST_FACTOR = 6.0  # on the noise of a feature, and its inverse: drawn evenly in its logarithm
RMS_FACTOR = np.sqrt(np.sinh(2 * np.log(MOST_FACTOR)) / (2 * np.log(MOST_FACTOR)))  # root mean square of such factors
INFLATION = 4.0  # that of `localise` on the variances of features where it is not told
INFLATION_1, WITHOUT_IDS = ["--measurement-inflation", 1], ["--unknown-ids"]
EKF, TOLD = "EKF-SLAM (NumPy)", "300 particles, told"
UNTOLD = ["300 particles, root mean square", "300 particles, root mean square, inflation 1", "300 particles, middle"]
#: By the kind of log, whether each row has its own noise: the reference, by what it makes of standard deviations; and marsyard, by its particles, the
#: factor on the noise of the options (`None`: it stands in the rows), and more options.
REFERENCES = {False: {EKF: np.square},
              True: {f"{EKF}, told": np.square, f"{EKF}, told, inflation {INFLATION:g}": lambda sigmas: INFLATION * np.square(sigmas),
                     f"{EKF}, root mean square": lambda _: np.square(RMS_FACTOR * np.array([RANGE, BEARING]))}}
WAYS = {False: {"30 particles": (30, 1.0, []), "100 particles": (100, 1.0, []), "300 particles": (300, 1.0, []),
                "300 particles, inflation 1": (300, 1.0, INFLATION_1), "100 particles, ids unknown": (100, 1.0, WITHOUT_IDS)},
        True: {TOLD: (300, None, []), UNTOLD[0]: (300, RMS_FACTOR, []), UNTOLD[1]: (300, RMS_FACTOR, INFLATION_1), UNTOLD[2]: (300, 1.0, []),
               "300 particles, told, ids unknown": (300, None, WITHOUT_IDS),
               "300 particles, root mean square, ids unknown": (300, RMS_FACTOR, WITHOUT_IDS)}}
RECKONED = ["dead reckoning (NumPy)", "dead reckoning (marsyard)"]
LATERAL = 0.02  # what `localise` allows for sideways where it is not told, per square root of a metre


def wrap(angle):
    return (angle + np.pi) % (2 * np.pi) - np.pi


def simulate(seed, by_row=False):
    """Odometry rows (time, speed, rate), feature rows (time, range, bearing, id, their standard deviations), truth rows (time, x, y, yaw)."""
    rng, rng_of_noise = np.random.default_rng(seed), np.random.default_rng([seed, 1])
    landmarks = rng.uniform(-5.5, 5.5, (20, 2)) + [0, RADIUS_M]
    x, y, yaw, turn = 0.0, 0.0, 0.0, STEP_M / RADIUS_M
    odometry, features, truth = [(0.0, 0.0, 0.0)], [], [(0.0, x, y, yaw)]
    for k in range(1, int(LAPS * 2 * np.pi * RADIUS_M / STEP_M) + 1):
        noise = rng.normal(size=2)
        for half in (0.5, 1.0):
            x += 0.5 * STEP_M * np.cos(yaw + 0.25 * turn)
            y += 0.5 * STEP_M * np.sin(yaw + 0.25 * turn)
            yaw = wrap(yaw + 0.5 * turn)
            time = k - 1 + half
            truth.append((time, x, y, yaw))
            if half == 0.5 and k % 5 == 0:
                for number, (lx, ly) in enumerate(landmarks):
                    distance, bearing = np.hypot(lx - x, ly - y), wrap(np.arctan2(ly - y, lx - x) - yaw)
                    if 0.5 < distance < REACH_M and abs(bearing) < np.radians(120):
                        factors = MOST_FACTOR ** rng_of_noise.uniform(-1, 1, 2) if by_row else np.ones(2)
                        sigmas = [*np.array([RANGE, BEARING]) * factors, BEARING]
                        off = [sigmas[0] * rng.normal(), sigmas[1] * rng.normal()]
                        # Nearer than this marsyard takes a feature for none of the sensor's.
                        if distance + off[0] >= LEAST_RANGE_M:
                            features.append((time, distance + off[0], wrap(bearing + off[1]), number, *sigmas))
        odometry.append((float(k), STEP_M + ODOMETRY * np.sqrt(STEP_M) * noise[0],
                         turn + (HEADING * np.sqrt(STEP_M) + 0.05 * turn) * noise[1]))
    return odometry, features, truth


def ekf(odometry, features, with_features=True, variances_of=np.square):
    """(time, x, y, yaw) and 3 x 3 covariances at each time of either log; `variances_of` standard deviations of range and bearing."""
    mean, cov, slots, out = np.zeros(3), np.zeros((3, 3)), {}, [(0.0, np.zeros(3), np.zeros((3, 3)))]
    by_time = {}
    for time, *seen in features:
        by_time.setdefault(time, []).append(seen)

    def drive(speed, rate, dt):
        nonlocal mean, cov
        d, turn = speed * dt, rate * dt
        c, s = np.cos(mean[2] + turn / 2), np.sin(mean[2] + turn / 2)
        mean = mean.copy()
        mean[:3] += [d * c, d * s, turn]
        f = np.eye(len(mean))
        f[0, 2], f[1, 2] = -d * s, d * c
        cov = f @ cov @ f.T
        along, across = np.array([c, s, 0]), np.array([-s, c, 0])
        cov[:3, :3] += ODOMETRY**2 * abs(d) * np.outer(along, along) + LATERAL**2 * abs(d) * np.outer(across, across)
        cov[2, 2] += (HEADING * np.sqrt(abs(d)) + 0.05 * abs(turn)) ** 2

    def observe(distance, bearing, number, *sigmas):
        nonlocal mean, cov
        noise = np.diag(variances_of(sigmas[:2]))
        if number not in slots:
            angle = mean[2] + bearing
            slots[number] = n = len(mean)
            by_pose = np.array([[1, 0, -distance * np.sin(angle)], [0, 1, distance * np.cos(angle)]])
            by_polar = np.array([[np.cos(angle), -distance * np.sin(angle)], [np.sin(angle), distance * np.cos(angle)]])
            mean = np.append(mean, mean[:2] + distance * np.array([np.cos(angle), np.sin(angle)]))
            grown = np.zeros((n + 2, n + 2))
            grown[:n, :n] = cov
            grown[n:, :n] = by_pose @ cov[:3, :]
            grown[:n, n:] = grown[n:, :n].T
            grown[n:, n:] = by_pose @ cov[:3, :3] @ by_pose.T + by_polar @ noise @ by_polar.T
            cov = grown
            return
        j = slots[number]
        dx, dy = mean[j : j + 2] - mean[:2]
        q = dx * dx + dy * dy
        r = np.sqrt(q)
        h = np.zeros((2, len(mean)))
        h[:, :3] = [[-dx / r, -dy / r, 0], [dy / q, -dx / q, -1]]
        h[:, j : j + 2] = [[dx / r, dy / r], [-dy / q, dx / q]]
        gain = cov @ h.T @ np.linalg.inv(h @ cov @ h.T + noise)
        mean = mean + gain @ np.array([distance - r, wrap(bearing - np.arctan2(dy, dx) + mean[2])])
        cov = (np.eye(len(mean)) - gain @ h) @ cov

    now = 0.0
    for time, speed, rate in odometry[1:]:
        for cut in sorted(t for t in by_time if now < t < time):
            drive(speed, rate, cut - now)
            now = cut
            if with_features:
                for seen in by_time[cut]:
                    observe(*seen)
            out.append((cut, mean[:3].copy(), cov[:3, :3].copy()))
        drive(speed, rate, time - now)
        now = time
        out.append((time, mean[:3].copy(), cov[:3, :3].copy()))
    return out


def scored(out, truth):
    at = {row[0]: row[1:] for row in truth}
    off, nees = [], []
    for time, mean, cov in out:
        error = mean - np.array(at[time])
        error[2] = wrap(error[2])
        off.append(np.hypot(*error[:2]))
        if cov[0, 0] > 0:
            nees.append(error @ np.linalg.solve(cov, error))
    return float(np.sqrt(np.mean(np.square(off)))), float(np.mean(nees))


def write_logs(folder, odometry, features, truth, with_sigmas=False):
    folder.mkdir(parents=True, exist_ok=True)
    columns = ["time_s", "range_m", "bearing_rad", "id", *["range_sigma_m", "bearing_sigma_rad", "elevation_sigma_rad"] * with_sigmas]
    for name, head, rows in [("odometry", "time_s,speed_mps,yaw_rate_radps", odometry), ("features", ",".join(columns), [row[: len(columns)] for row in features]),
                             ("truth", "time_s,x_m,y_m,yaw_rad", truth)]:
        lines = [",".join(f"{v:.9g}" if isinstance(v, float) else str(v) for v in map(lambda v: v if isinstance(v, int) else float(v), row)) for row in rows]
        (folder / f"{name}.csv").write_text("\n".join([head, *lines]) + "\n")


def localise(marsyard, folder, logs, particles, factor, options):
    """What marsyard says of logs; `factor` is on the noise that the options tell, and `None` where rows tell it."""
    written = folder / ("told" if factor is None else "untold")
    if not written.exists():
        write_logs(written, *logs, with_sigmas=factor is None)
    noise = ["--range-m", (factor or 1.0) * RANGE, "--bearing-deg", np.degrees((factor or 1.0) * BEARING)]
    files = [written / "odometry.csv", "--features", written / "features.csv", "--truth", written / "truth.csv", "--out", folder / "out"]
    done = subprocess.run([marsyard, "localise", *map(str, [*files, *noise, "--json", "--particles", particles, *options])], capture_output=True, text=True)
    if done.returncode:
        sys.exit(done.stderr)
    return json.loads(done.stdout)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--marsyard", default=study.ROOT / "target" / "release" / "marsyard")
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--sample", action="store_true", help="write the logs of seed 1 to examples/logs, and stop")
    arguments = parser.parse_args()
    if arguments.sample:
        write_logs(SAMPLE, *simulate(1))
        return
    table = {name: [] for name in [EKF, *RECKONED, *WAYS[False], *REFERENCES[True], *WAYS[True]]}
    score_of = lambda score: (score["ate_m"], score["nees"])
    for seed in range(1, arguments.seeds + 1):
        for by_row in (False, True):
            logs = simulate(seed, by_row)
            for name, variances_of in REFERENCES[by_row].items():
                table[name].append(scored(ekf(*logs[:2], variances_of=variances_of), logs[2]))
            with tempfile.TemporaryDirectory() as folder:
                for name, way in WAYS[by_row].items():
                    said = localise(arguments.marsyard, pathlib.Path(folder), logs, *way)
                    table[name].append(score_of(said["score"]))
            if not by_row:
                table[RECKONED[0]].append(scored(ekf(*logs[:2], with_features=False), logs[2]))
                table[RECKONED[1]].append(score_of(said["dead_reckoning"]))
    means = {name: [float(np.mean([pair[k] for pair in pairs])) for k in (0, 1)] for name, pairs in table.items()}
    off_of = lambda name: np.array([ate for ate, _ in table[name]])
    gains = off_of(min(UNTOLD, key=lambda name: means[name][0])) - off_of(TOLD)
    gain = (float(np.mean(gains)), float(2 * np.std(gains, ddof=1) / np.sqrt(len(gains))))
    of = lambda names: study.markdown(["method", "ATE m", "NEES"], [[name, f"{means[name][0]:.4f}", f"{means[name][1]:.2f}"] for name in names])
    text = f"""# `marsyard localise` beside an EKF-SLAM written in NumPy

`python scripts/localise_check.py --seeds {arguments.seeds}`: two laps of {RADIUS_M:g} m radius among 20 landmarks, ids known unless said. ATE: mean over seeds.
NEES of x, y, yaw over all steps: 3 is honest; steps of a run hang together, and a filter of particles grows optimistic with the way.

{of([EKF, *RECKONED, *WAYS[False]])}

## Noise of its own in each row

The same laps, but each feature's noise is its own, by a factor of 1 / {MOST_FACTOR:g} to {MOST_FACTOR:g}, even in its logarithm; *told*: it stands in the row. Where it does not, all
are taken to have the root mean square of it, or its middle. Told, marsyard's error is {gain[0]:.4f} ± {gain[1]:.4f} m (twice the standard error, over seeds) below the best of the other three with ids.

{of([*REFERENCES[True], *WAYS[True]])}
"""
    study.write_results(study.RESULTS, "localise", {"seeds": arguments.seeds, "means": means, "gain_of_told_noise_m": gain}, text)
    if arguments.check:
        reference, reckoned = means[EKF][0], means[RECKONED[0]][0]
        own, own_reckoned = means["300 particles"][0], means[RECKONED[1]][0]
        if not (own <= 1.35 * reference and own < reckoned and abs(own_reckoned / reckoned - 1) < 1e-3):
            sys.exit(f"300 particles {own:.4f} m, reference {reference:.4f}; dead reckoning {own_reckoned:.5f} and {reckoned:.5f}")
        reference, told = means[f"{EKF}, told"][0], means[TOLD][0]
        if not (told <= 1.35 * reference and gain[0] > gain[1]):
            sys.exit(f"noise by row: 300 particles {told:.4f} m, reference {reference:.4f}; told noise gains {gain[0]:.4f} ± {gain[1]:.4f} m")


if __name__ == "__main__":
    main()
