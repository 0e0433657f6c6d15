"""Runs every extreme_ test, the long ones too, and writes docs/extremes.md from the rows that they print.

    python scripts/extremes.py            # some minutes on two cores, 10 GB of memory for the cell of 10^8 points
    python scripts/extremes.py --only scene   # tests whose path holds a word: prints their rows, writes nothing

Each row is one extreme: what a textbook form does there, what marsyard does, both measured by the test that is named.
"""

import argparse
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "extremes.md"
FAMILIES = {
    "Ground": "Ground",
    "Casting": "Casting",
    "Contact": "Contact",
    "Slam": "SLAM",
    "Cells": "Cells",
    "Filters": "Filters",
    "Sums": "Sums and scaling",
}
# Where the tests live, and how `cargo test` is told.
PROGRAMS = {"": ["--lib"], "statistics: ": ["--test", "statistics"]}

INTRODUCTION = """# Extremes

What happens at the ends of every range: beside marsyard, a textbook form of the same thing, written out in the test and measured in
the same run. Each row comes from the test that it names, which also asserts it; `python scripts/extremes.py` runs all of them, the
long ones too, and writes this page. `cargo test --release` runs those that take less than some seconds.

Where the textbook's form is as good, the row says so. Tests of `statistics:` are in `tests/statistics`, all others in `src`.
"""


def rows_of(program: str, arguments: list[str], only: str) -> list[tuple[str, str, str, str, str]]:
    """The rows that one test program prints; stops where a test fails."""
    command = ["cargo", "test", "--release", *arguments, "extreme_", "--", "--include-ignored", "--nocapture"]
    if only:
        command[command.index("extreme_")] = only
    run = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=False)
    if run.returncode != 0:
        failed = re.findall(r"^test (\S+) \.\.\. FAILED|^    (\S*extreme_\S*)$", run.stdout, re.MULTILINE)
        names = sorted({a or b for a, b in failed})
        sys.exit(f"{' '.join(command)} failed: {', '.join(names) or run.stdout[-2000:]}")
    rows = []
    for line in run.stdout.splitlines():
        if line.startswith("extreme|"):
            _, family, extreme, textbook, marsyard, test = line.split("|")
            if test == "main":
                sys.exit("the tests have no thread names: run them with two threads or more")
            rows.append((family, program + test, extreme, textbook, marsyard))
    return rows


def page(rows: list[tuple[str, str, str, str, str]]) -> str:
    """The whole page; within a family by test, and within a test in the order of its rows."""
    parts = [INTRODUCTION]
    for family, title in FAMILIES.items():
        parts.append(f"\n## {title}\n\n| extreme | a textbook form | marsyard | test |\n|---|---|---|---|\n")
        for _, test, extreme, textbook, marsyard in sorted((r for r in rows if r[0] == family), key=lambda row: row[1]):
            parts.append(f"| {extreme} | {textbook} | {marsyard} | `{test}` |\n")
    return "".join(parts)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", help="a word of the tests' paths; prints, writes nothing")
    only = parser.parse_args().only
    rows = [row for program, arguments in PROGRAMS.items() for row in rows_of(program, arguments, only)]
    if only:
        print(page(rows))
        return
    missing = set(FAMILIES) - {row[0] for row in rows}
    if missing:
        sys.exit(f"no row of {', '.join(sorted(missing))}")
    PAGE.write_text(page(rows), encoding="utf-8")
    print(f"{PAGE.relative_to(ROOT)}: {len(rows)} rows of {len({row[1] for row in rows})} tests")


if __name__ == "__main__":
    main()
