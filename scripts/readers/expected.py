"""What a corpus says of itself, and how a check fails: shared by the readers of this folder. Needs the standard library only."""

import json
import pathlib
import sys


class Corpus:
    def __init__(self, place):
        self.place = pathlib.Path(place).resolve()
        self.manifest = json.loads((self.place / "manifest.json").read_text())
        self.shards = [json.loads(line) for line in (self.place / "shards.jsonl").read_text().splitlines()]
        self.tables = list(self.manifest["tables"])

    def files(self, table, split=None):
        shards = [shard for shard in self.shards if split in (None, shard["split"])]
        return [str(self.place / shard["tables"][table]["path"]) for shard in shards]

    def splits(self):
        return {name: split for name, split in self.manifest["splits"].items() if split["shards"]}

    def labels(self, split):
        """Cells by label, as the manifest counts them; labels that do not occur are left out."""
        found = self.manifest["splits"][split]["labels"]
        counts = {0: found["traversable"], 1: found["untraversable"], None: found["unknown"]}
        return {label: count for label, count in counts.items() if count}


def expect(found, expected, what):
    if found != expected:
        sys.exit(f"FAILED {what}: expected {expected!r}, found {found!r}")


def note(path, reader, facts):
    """Keeps what a reader found under its name in a JSON file, beside what others found, and all of it as a table beside that."""
    path = pathlib.Path(path)
    notes = json.loads(path.read_text()) if path.exists() else {}
    notes[reader] = facts
    path.write_text(json.dumps(dict(sorted(notes.items())), indent=2) + "\n")
    path.with_suffix(".md").write_text(table(notes))


def table(notes):
    lines = [
        "# Readers too heavy for CI", "",
        "`python scripts/readers/spark.py CORPUS --note scripts/results/readers.json`, and `torch_loader.py` in the same way. Each compares what",
        "it read with the manifest and stops at the first difference. CI does the same with pyarrow, pandas, Polars, DuckDB, datasets and",
        "mlcroissant (`scripts/interop/run.sh`).", "",
        "| reader | versions | corpus | rows | checked | seconds |", "|---|---|---|---|---|---:|",
    ]
    for reader, facts in sorted(notes.items()):
        versions = ", ".join(f"{name} {version}" for name, version in facts["versions"].items())
        rows = ", ".join(f"{name} {count:,}" for name, count in facts["rows"].items())
        corpus = f"{facts['corpus']} ({facts['corpus_id'][:12]})"
        lines.append(f"| {reader} | {versions} | {corpus} | {rows} | {facts['checked']} | {facts['seconds']} |")
    return "\n".join(lines) + "\n"
