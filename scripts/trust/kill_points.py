"""The crash tests, counted: every kill point and every power cut, and failing calls spread over each run as the gate takes them.

    python scripts/trust/kill_points.py

Runs tests/crash on the release build (some four minutes) and writes scripts/results/kill_points.md; exit 1 where anything was
lost. Needs a C compiler and the right to trace; Python's standard library alone.
"""

import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
TESTS = "cargo test --release --locked --test crash -- --nocapture --test-threads 2"
RUNS = ["--ignored law_every_kill_point law_every_power_cut", "faults::"]
HEAD = """# Every kill point

`scripts/trust/kill_points.py`: `tests/crash` in its long form for kills and cuts. Each verb runs on a tiny corpus and is disturbed at each
of its system calls: killed before each change to a file; cut off from power before each, once with all names on disk and once with
those that were synced, and always without the data that was not; or, at calls spread over the run, with that call failing (EIO, ENOSPC,
EINTR, EMFILE, EROFS, EXDEV, half of the bytes). Lost: the same command does not end with the bytes of an undisturbed run, the command that
a refusal names does not lead to the old corpus or the new one, a temporary file stays, a message names no cure, or there is a panic.
Mixed: a reader takes a corpus that is neither that of before nor that of after, or a model that is not the run's.

| verb | what happened | attempts | lost | mixed |
|---|---|--:|--:|--:|
"""


def main():
    done = [subprocess.run((TESTS + " " + run).split(), cwd=ROOT, stdout=subprocess.PIPE, text=True) for run in RUNS]
    said = "".join(run.stdout for run in done)
    print(said)
    if "| " not in said:
        sys.exit("nothing was traced here")
    rows = sorted(line[line.index("| "):] for line in said.splitlines() if line.count(" | ") == 4)
    counts = [[int(cell) for cell in row.strip("| ").split(" | ")[2:]] for row in rows]
    attempts, lost, mixed = (sum(column) for column in zip(*counts))
    text = HEAD + "\n".join(rows) + f"\n\n**{lost + mixed} of {attempts}** attempts lost or mixed anything.\n"
    (ROOT / "scripts/results/kill_points.md").write_text(text)
    sys.exit(max(run.returncode for run in done))


if __name__ == "__main__":
    main()
