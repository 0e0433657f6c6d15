"""The crash tests of the gate, counted: every kill point, and power cuts and failing calls spread over each run.

    python scripts/trust/kill_points.py

Runs tests/crash on the release build and writes scripts/results/kill_points.md; exit 1 where anything was
lost. Needs a C compiler and the right to trace; Python's standard library alone.
"""

import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
COMMAND = "cargo test --release --locked --test crash -- --nocapture --test-threads 2"
HEAD = """# Every kill point

`scripts/trust/kill_points.py`: `tests/crash` as the gate runs it. Each verb runs on a tiny corpus and is disturbed at each of its system
calls: killed before each change to a file (all of them); at calls spread over the run cut off from power, once with all names on disk and once with those that
were synced, and always without the data that was not; or with that call failing (EIO, ENOSPC, EINTR, EMFILE, EROFS, EXDEV, half of the
bytes). Lost: the same command does not end with the bytes of an undisturbed run, a temporary file stays, a message names no
cure, or there is a panic. Mixed: a reader takes a corpus that is neither that of before nor that of after, or a model that is
not the run's.

| verb | what happened | attempts | lost | mixed |
|---|---|--:|--:|--:|
"""


def main():
    done = subprocess.run(COMMAND.split(), cwd=ROOT, stdout=subprocess.PIPE, text=True)
    print(done.stdout)
    if "| " not in done.stdout:
        sys.exit("nothing was traced here")
    rows = sorted(line[line.index("| "):] for line in done.stdout.splitlines() if line.count(" | ") == 4)
    counts = [[int(cell) for cell in row.strip("| ").split(" | ")[2:]] for row in rows]
    attempts, lost, mixed = (sum(column) for column in zip(*counts))
    text = HEAD + "\n".join(rows) + f"\n\n**{lost + mixed} of {attempts}** attempts lost or mixed anything.\n"
    (ROOT / "scripts/results/kill_points.md").write_text(text)
    sys.exit(done.returncode)


if __name__ == "__main__":
    main()
