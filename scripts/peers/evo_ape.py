#!/usr/bin/env python3
"""TUM files and the absolute trajectory errors found in the repository -> the same errors by evo (an outside check).

    python3 -m venv .venv && .venv/bin/pip install evo
    MARSYARD_TUM=tum cargo test --release --test statistics slam::tum_files -- --ignored
    .venv/bin/python scripts/peers/evo_ape.py tum

No alignment: both trajectories are in the yard's frame, and aligning them would hide the heading error.
Exits with 1 where the two differ by 1e-6 m or more.
"""

import pathlib
import sys

from evo.core import metrics, sync
from evo.tools import file_interface


def ape_rmse_m(truth_path, estimate_path):
    truth, estimate = (file_interface.read_tum_trajectory_file(str(p)) for p in (truth_path, estimate_path))
    pair = sync.associate_trajectories(truth, estimate)
    ape = metrics.APE(metrics.PoseRelation.translation_part)
    ape.process_data(pair)
    return ape.get_statistic(metrics.StatisticsType.rmse)


def main():
    folder = pathlib.Path(sys.argv[1])
    worst = 0.0
    for line in (folder / "ate.txt").read_text().splitlines():
        seed, ours = line.split()
        theirs = ape_rmse_m(folder / f"truth-{seed}.tum", folder / f"estimate-{seed}.tum")
        worst = max(worst, abs(theirs - float(ours)))
        print(f"seed {seed}: marsyard {float(ours):.9f} m, evo {theirs:.9f} m")
    print(f"largest difference {worst:.2e} m")
    return 0 if worst < 1e-6 else 1


if __name__ == "__main__":
    sys.exit(main())
