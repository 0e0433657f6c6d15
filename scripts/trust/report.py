"""What was found -> one page: conditions with their hashes, faults with what they cost, readers with their versions."""

import json

from lab import ROOT


def table(head, rows):
    lines = [f"| {' | '.join(head)} |", f"|{'---|' * len(head)}"]
    return "\n".join(lines + [f"| {' | '.join(str(cell) for cell in row)} |" for row in rows]) + "\n"


def page(result):
    conditions = table(("condition", "times", "compared", "files", "f64 results of the stages"), [
        (c["condition"], c["times"], c["compared"], f"`{c['files']}`", f"`{c['f64']}`") for c in result["conditions"]])
    faults = table(("fault", "injected", "lost", "how the disturbed runs ended"), [
        (f["fault"], f["times"], len(f["lost"]) or "nothing",
         ", ".join(f"{end}: {count}" for end, count in sorted(f["ends"].items()))) for f in result["faults"]])
    imports = "; ".join(f"{kind} binary: {', '.join(names) or 'none'}" for kind, names in result["imports"].items())
    text = f"""# What a corpus can be trusted with

Written by `python scripts/trust/run.py target/release/marsyard --times {result['times']}` (seed {result['seed']}, {result['machine']}), over
`tests/fixtures/everything.yaml` with {result['scenes']} scenes: every stage and every effect.

## The same bytes

Hashes over all files of the corpus, and over the f64 results of every stage of every scene. Each row was compared with a corpus
built undisturbed; an emulated processor with one scene built here.

{conditions}
Transcendental functions that the binary takes from the C library: {imports}.

## The night

Each fault came at a random moment, or into a random place. After it: what counts as whole is whole, the same command completes,
`marsyard verify` finds nothing, and every byte is that of the undisturbed corpus. RUST_BACKTRACE is 0 throughout: where it is 1 and memory
is limited, the standard library's backtrace of a failed allocation was seen to wait for itself for ever; killed then, nothing is lost.

{faults}"""
    for fault in result["faults"]:
        text += "".join(f"\n- {fault['fault']}: {lost}" for lost in fault["lost"])
    text += "\n## Many shards, long builds\n\n" + table(("what", "seconds", "peak resident memory, MB"), [
        (row["what"], row["seconds"], row["peak_mb"]) for row in result["scale"]])
    return text + "\n## Readers\n\n" + readers_table() + STORE


STORE = """
Object stores have faults of their own: `scripts/store/check_store.py` injects them (in CI a few, its long run is `store.json`). Builds on
several machines: `scale_out.md`.
"""


def readers_table():
    """The readers that CI runs, with the versions that it asks for, and those whose scripts keep their results."""
    asked = dict(line.split("==") for line in (ROOT / "scripts/interop/requirements.txt").read_text().split() if "==" in line)
    in_ci = "in CI: rows, types, units, labels, splits (`scripts/interop/check_corpus.py`)"
    rows = [(name, asked[name], in_ci) for name in ("pyarrow", "pandas", "polars", "duckdb", "datasets", "mlcroissant")]
    kept = json.loads((ROOT / "scripts/results/readers.json").read_text())
    for name, found in sorted(kept.items()):
        versions = ", ".join(f"{part} {version}" for part, version in found["versions"].items())
        rows.append((name, versions, f"{found['rows']['cells']} cells: {found['checked']} (`readers.md`)"))
    return table(("reader", "version", "checked"), rows)
