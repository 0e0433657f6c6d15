#!/usr/bin/env python3
"""Runs the Python and SQL examples of README.md and docs/columns.md on a finished corpus: what a reader copies must work.

    python scripts/interop/check_readme.py README.md docs/columns.md corpora/quickstart

Each block between ```python or ```sql and ``` runs as it stands, in a folder where corpora/quickstart is the corpus given; SQL in
DuckDB, and must return rows. Exit 1 at the first block that fails.
"""

import itertools
import os
import pathlib
import re
import subprocess
import sys
import tempfile

import duckdb


def blocks(text, language):
    """The blocks with the number of their first line."""
    for found in re.finditer(rf"^```{language}\n(.*?)^```$", text, re.MULTILINE | re.DOTALL):
        yield text[: found.start()].count("\n") + 2, found.group(1)


def run_python(code, folder):
    environment = os.environ | {"HF_HOME": str(folder / "cache"), "HF_HUB_OFFLINE": "1"}
    done = subprocess.run([sys.executable, "-c", code], cwd=folder, env=environment, capture_output=True, text=True)
    return done.returncode == 0, done.stderr or done.stdout


def run_sql(code, folder):
    here = os.getcwd()
    os.chdir(folder)
    try:
        rows = duckdb.sql(code).fetchall()
        return bool(rows), f"{len(rows)} rows"
    except duckdb.Error as error:
        return False, str(error)
    finally:
        os.chdir(here)


def main():
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    *pages, corpus = map(pathlib.Path, sys.argv[1:])
    ran = 0
    with tempfile.TemporaryDirectory() as scratch:
        folder = pathlib.Path(scratch)
        (folder / "corpora").mkdir()
        (folder / "corpora" / "quickstart").symlink_to(corpus.resolve())
        for page, (language, run) in itertools.product(pages, (("python", run_python), ("sql", run_sql))):
            for line, code in blocks(page.read_text(), language):
                fine, said = run(code, folder)
                if not fine:
                    sys.exit(f"FAILED {page}, line {line} ({language}): {said}")
                print(f"ok  {page}, line {line} ({language})")
                ran += 1
    if ran < 3:
        sys.exit(f"FAILED: {ran} examples found; one in Python and two in SQL are expected")


if __name__ == "__main__":
    main()
