#!/usr/bin/env python3
"""How many faults, put into the code one at a time, the tests notice: a sample of cargo-mutants's mutants, all in one build.

    python scripts/mutants/run.py sample build reach run report [--work /tmp/mutants] [--wanted 320] [--seed 13]

cargo-mutants builds the crate once a mutant, minutes each. Here one build of a copy of the tree holds all sampled mutants behind
switches (schemata.py), and an environment variable picks one when a test binary starts. Steps, each resumed where it was left:

sample  asks `cargo mutants --list` for every mutant of the folders below, leaves out what no switch or no test can meet, and draws, by
        a fixed seed, from each folder a share that grows with the root of what it has.
build   writes the mutated copy, drops mutants that do not compile (the next of the same folder takes the place), builds the tests.
reach   runs each test alone, no mutant switched on: how long it takes and which mutants' places it comes by. A test that fails here, or
        takes more CPU time than --longest, is left out.
run     each mutant: the unit tests that come by it, its own folder's first, then the others, each group from the quickest, until one
        fails. Five times the usual CPU time, and five seconds, count as caught, as does a crash.
report  scripts/results/mutants.json and .md; survivors with what explained.json says of them.

Unit tests alone are asked: neither the golden tests nor the others of tests/contract, nor tests/statistics, which only a release
build has. What these notice beside comes on top. Needs cargo-mutants on the PATH (or --cargo-mutants), and
`pip install tree_sitter tree_sitter_rust`. `run --again` runs the survivors once more, after tests were added and `build` and `reach`
were done again.
"""

import argparse
import collections
import concurrent.futures
import json
import math
import os
import pathlib
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time

import schemata

ROOT = pathlib.Path(__file__).resolve().parents[2]
HERE = pathlib.Path(__file__).resolve().parent
RESULTS = ROOT / "scripts/results"
FOLDERS = ["scene", "drive", "sweep", "slam", "cells", "corpus", "train", "evaluate"]
LEAST_A_FOLDER = 24
MEMORY = 6 << 30


def identity(mutant):
    """What names a mutant in results: file, line, column, mutation."""
    return mutant["name"]


def read(path, default=None):
    return json.loads(path.read_text()) if path.exists() else default


def write(path, value):
    beside = path.with_suffix(".new")
    beside.write_text(json.dumps(value, indent=1) + "\n")
    beside.replace(path)


# -- sample


def listed(options):
    """All mutants of the folders, in cargo-mutants's order."""
    command = [options.cargo_mutants, "mutants", "--list", "--json", "--line-col=true"]
    command += [argument for folder in FOLDERS for argument in ("--file", f"src/{folder}/**/*.rs")]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    if done.returncode:
        sys.exit(done.stderr)
    return json.loads(done.stdout)


def test_only():
    """Files of tests and their fixtures: what `#[cfg(test)] mod` names; files of object stores, which a plain build leaves out."""
    left_out = set()
    guarded = re.compile(r"#\[cfg\([^\]]*(?:test|object-stores)[^\]]*\)\]\s*(?:pub(?:\([a-z]+\))? )?mod (\w+);")
    for path in sorted((ROOT / "src").rglob("*.rs")):
        for name in guarded.findall(path.read_text()):
            home = path.parent if path.name in ("mod.rs", "lib.rs") else path.with_suffix("")
            for found in [home / f"{name}.rs", *(home / name).rglob("*.rs")]:
                left_out.add(str(found.relative_to(ROOT)))
    return left_out


def sample(options):
    """work/order.json: all candidates, shuffled, by folder; work/quota.json: how many of each folder."""
    skipped, order, sources = collections.Counter(), {folder: [] for folder in FOLDERS}, {}
    left_out = test_only()
    for mutant in listed(options):
        function = (mutant.get("function") or {}).get("function_name", "")
        if mutant["file"] in left_out:
            skipped["in a test's file, or in a file of object stores, which a plain build leaves out"] += 1
        elif function.split("::")[-1].rstrip(">") == "fmt" or "fmt::Display" in function or "fmt::Debug" in function:
            skipped["only text: Display or Debug"] += 1
        else:
            source = sources.setdefault(mutant["file"], schemata.Source((ROOT / mutant["file"]).read_text()))
            try:
                source.edit(0, mutant)
            except schemata.Skipped as reason:
                skipped[f"no switch can stand: {reason}"] += 1
                continue
            order[mutant["file"].split("/")[1]].append(mutant)
    draws = random.Random(options.seed)
    for mutants in order.values():
        draws.shuffle(mutants)
    roots = {folder: math.sqrt(len(mutants)) for folder, mutants in order.items()}
    quota = {folder: max(LEAST_A_FOLDER, round(options.wanted * root / sum(roots.values()))) for folder, root in roots.items()}
    write(options.work / "order.json", order)
    tree = subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip()
    candidates = {folder: len(mutants) for folder, mutants in order.items()}
    write(options.work / "quota.json", {"tree": tree, "quota": quota, "skipped": skipped, "candidates": candidates})
    print(quota, dict(skipped), candidates)


# -- build


def chosen(options):
    """Number -> mutant: of each folder the first of the shuffled that compile, one a place."""
    order, quota = read(options.work / "order.json"), read(options.work / "quota.json")["quota"]
    broken = set(read(options.work / "broken.json", []))
    picked, number = {}, 0
    for folder in FOLDERS:
        places, taken = set(), 0
        for mutant in order[folder]:
            # Numbers stay with their mutants, whatever is dropped.
            number += 1
            place = (mutant["file"], json.dumps(mutant["span"]["start"]))
            if taken < quota[folder] and identity(mutant) not in broken and place not in places:
                picked[number], taken = mutant, taken + 1
                places.add(place)
    return picked


def weave(options, picked):
    """Writes the mutated copy; returns file -> [(number, first byte, end)]."""
    tree = options.work / "tree"
    tree.mkdir(exist_ok=True)
    files = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout.split("\0")
    by_file = collections.defaultdict(list)
    # Numbers in the copy are small and dense: the switch has a table of them.
    for small, (number, mutant) in enumerate(sorted(picked.items())):
        by_file[mutant["file"]].append((small, mutant))
    spans = {}
    for name in filter(None, files):
        if not (ROOT / name).exists():
            continue
        content = (ROOT / name).read_bytes()
        if name in by_file:
            source = schemata.Source(content.decode())
            content, spans[name] = source.render([source.edit(small, mutant) for small, mutant in by_file[name]])
        if name == "src/lib.rs":
            text = content.decode()
            first = re.search(r"^pub mod ", text, re.M).start()
            text = text[:first] + "pub mod mutation;\n\n" + text[first:]
            first = re.search(r"^(?!//!)", text, re.M).start()
            allowed = "#![allow(warnings, arithmetic_overflow, unconditional_panic)]\n"
            content = (text[:first] + allowed + text[first:]).encode()
        put(tree / name, content)
    put(tree / "src/mutation.rs", (HERE / "switch.rs").read_bytes())
    return spans


def put(path, content):
    """Writes a file only where its content changes, so that cargo builds no more than it must."""
    if not path.exists() or path.read_bytes() != content:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)


def cargo(options, *arguments):
    environment = {**os.environ, "CARGO_TARGET_DIR": str(options.target)}
    command = ["nice", "cargo", *arguments, "--offline"]
    return subprocess.run(command, cwd=options.work / "tree", env=environment, capture_output=True, text=True)


def build(options):
    """work/built.json: the mutants in the copy, by number, and the binary of the unit tests."""
    while True:
        picked = chosen(options)
        spans = weave(options, picked)
        print(f"{time.strftime('%T')} {len(picked)} mutants woven in")
        done = cargo(options, "check", "--lib", "--message-format=json")
        if done.returncode == 0:
            break
        numbers = [number for number, _ in sorted(picked.items())]
        guilty = {small for message in messages(done.stdout) for small in blamed(message, spans)}
        if not guilty:
            sys.exit(f"no mutant explains these errors:\n{rendered(done)[-6000:]}\n{done.stderr[-2000:]}")
        broken = read(options.work / "broken.json", []) + [identity(picked[numbers[small]]) for small in guilty]
        print(f"{len(guilty)} mutants do not compile")
        write(options.work / "broken.json", broken)
    done = cargo(options, "test", "--lib", "--no-run", "--message-format=json")
    if done.returncode:
        sys.exit(done.stderr + rendered(done))
    said = [json.loads(line) for line in done.stdout.splitlines()]
    made = next(line["executable"] for line in said if line.get("executable") and line["profile"]["test"])
    # A copy: the next build may replace what cargo made while it runs.
    binary = options.work / "unit-tests"
    shutil.copy(made, binary)
    mutants = [mutant for _, mutant in sorted(picked.items())]
    write(options.work / "built.json", {"mutants": mutants, "binary": str(binary)})
    print(f"{time.strftime('%T')} built")


def messages(output):
    """The compiler's errors."""
    for line in output.splitlines():
        said = json.loads(line)
        if said.get("reason") == "compiler-message" and said["message"]["level"] == "error":
            yield said["message"]


def rendered(done):
    return "\n".join(message.get("rendered") or "" for message in messages(done.stdout))


def blamed(message, spans):
    """Numbers of the mutants whose text an error points at: the innermost at its primary span, else any that it touches."""
    for primary in (True, False):
        found = set()
        for span in message["spans"]:
            while span:
                if span["is_primary"] == primary or not primary:
                    inside = [(high - low, number) for number, low, high in spans.get(span["file_name"], [])
                              if low < max(span["byte_end"], span["byte_start"] + 1) and span["byte_start"] < high]
                    if inside:
                        found.add(min(inside)[1])
                span = (span.get("expansion") or {}).get("span")
        if found:
            return found
    # What the error is about may lie behind the mutant: the nearest one before it.
    before = [(low, number) for span in message["spans"] for number, low, _ in spans.get(span["file_name"], []) if low < span["byte_start"]]
    return {max(before)[1]} if before else set()


# -- reach and run


def limits(cpu_s):
    def set_limits():
        os.nice(19)
        resource.setrlimit(resource.RLIMIT_CPU, (math.ceil(cpu_s), math.ceil(cpu_s) + 2))
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    return set_limits


def tests_of(binary, options):
    def listed_with(*arguments):
        command = [binary, "--list", "--format", "terse", *arguments]
        said = subprocess.run(command, cwd=options.work / "tree", capture_output=True, text=True, check=True).stdout
        return [line[:-len(": test")] for line in said.splitlines() if line.endswith(": test")]

    ignored = set(listed_with("--ignored"))
    return [name for name in listed_with() if name not in ignored]


def reach_one(options, binary, name):
    """CPU seconds of a test and the mutants that it comes by; None where it fails or takes too long."""
    with tempfile.TemporaryDirectory(dir=options.work) as folder:
        seen = pathlib.Path(folder) / "seen"
        environment = {**os.environ, "MARSYARD_MUTANTS_REACHED": str(seen)}
        process = subprocess.Popen([binary, "--exact", name, "--test-threads", "1"], cwd=options.work / "tree", env=environment,
                                   stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, preexec_fn=limits(options.longest))
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = status
        if status:
            return None
        reached = sorted({int(line) for line in seen.read_text().split()}) if seen.exists() else []
        return {"cpu_s": round(used.ru_utime + used.ru_stime, 3), "reached": reached}


def reach(options):
    """work/tests.json: test -> what reach_one found."""
    binary = read(options.work / "built.json")["binary"]
    known = {} if options.fresh else read(options.work / "tests.json", {})
    # Those of the mutants' own folders first; measurements and searches, which run everything many times, last.
    heavy = ("measure::", "search::", "cli::")
    rank = lambda test: 0 if test.split("::")[0] in FOLDERS else 2 if test.startswith(heavy) else 1
    todo = sorted((test for test in tests_of(binary, options) if test not in known), key=rank)
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        futures = {pool.submit(reach_one, options, binary, test): test for test in todo}
        for done, future in enumerate(concurrent.futures.as_completed(futures)):
            known[futures[future]] = future.result()
            if done % 20 == 0:
                write(options.work / "tests.json", known)
    write(options.work / "tests.json", known)
    left_out = [test for test, found in known.items() if found is None]
    cpu_s = sum(found["cpu_s"] for found in known.values() if found)
    print(f"{time.strftime('%T')} {len(known)} tests, {cpu_s:.0f} CPU s; left out: {left_out}")


def batches(tests):
    """Tests from the quickest, in batches of some 1, 4, 16 ... CPU seconds."""
    batch, spent, most = [], 0.0, 1.0
    for name, cpu_s in sorted(tests.items(), key=lambda item: item[1]):
        batch.append(name)
        spent += cpu_s
        if spent >= most or len(batch) >= 200:
            yield batch, spent
            batch, spent, most = [], 0.0, most * 4
    if batch:
        yield batch, spent


def run_batch(options, binary, number, names, cpu_s):
    """None where all pass; else which test noticed and how."""
    environment = {**os.environ, "MARSYARD_MUTANT": str(number)}
    process = subprocess.Popen([binary, "--exact", *names, "--test-threads", "1"], cwd=options.work / "tree", env=environment, text=True,
                               stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, preexec_fn=limits(5 * cpu_s + 5), start_new_session=True)
    waited_out = threading.Event()

    def give_up():
        waited_out.set()
        os.killpg(process.pid, signal.SIGKILL)

    # Of the wall clock, for what waits for ever; the machine may be busy.
    timer = threading.Timer(40 * cpu_s + 120, give_up)
    timer.start()
    last = ""
    try:
        for line in process.stdout:
            if found := re.match(r"test (\S+)", line):
                last = found[1]
            if line.startswith("test ") and line.rstrip().endswith("FAILED"):
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()
                return last, "failed"
        code = process.wait()
    finally:
        timer.cancel()
    if code == 0:
        return None
    return last, "timeout" if waited_out.is_set() or code in (-signal.SIGXCPU, -signal.SIGKILL) else "crashed"


def run_one(options, built, tests, number):
    mutant = built["mutants"][number]
    folder = mutant["file"].split("/")[1] + "::"
    reaching = {name: found["cpu_s"] for name, found in tests.items() if found and number in found["reached"]}
    own = {name: cpu_s for name, cpu_s in reaching.items() if name.startswith(folder)}
    others = {name: cpu_s for name, cpu_s in reaching.items() if name not in own}
    for group, tests_of_group in (("own tests", own), ("other unit tests", others)):
        for names, cpu_s in batches(tests_of_group):
            if noticed := run_batch(options, built["binary"], number, names, cpu_s):
                return {"caught": True, "by": group, "test": noticed[0], "how": noticed[1]}
    return {"caught": False, "tests_that_come_by": len(reaching), "their_cpu_s": round(sum(reaching.values()), 1)}


def run(options):
    """work/outcomes.json: identity -> outcome."""
    built, tests = read(options.work / "built.json"), read(options.work / "tests.json")
    outcomes = read(options.work / "outcomes.json", {})

    def is_due(mutant):
        outcome = outcomes.get(identity(mutant))
        return outcome is None or (options.again and not outcome["caught"])

    def cost(number):
        return sum(found["cpu_s"] for found in tests.values() if found and number in found["reached"])

    # The cheapest first: a run that is cut short has met most mutants.
    todo = sorted((number for number, mutant in enumerate(built["mutants"]) if is_due(mutant)), key=cost)
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        futures = {pool.submit(run_one, options, built, tests, number): built["mutants"][number] for number in todo}
        for future in concurrent.futures.as_completed(futures):
            mutant, outcome = futures[future], future.result()
            before = outcomes.get(identity(mutant))
            if before and outcome["caught"]:
                outcome["after_a_test_was_added"] = True
            outcomes[identity(mutant)] = outcome
            write(options.work / "outcomes.json", outcomes)
            if not outcome["caught"]:
                print(time.strftime("%T"), "SURVIVED", mutant["name"], outcome, flush=True)
    print(f"{time.strftime('%T')} {sum(o['caught'] for o in outcomes.values())} of {len(outcomes)} caught")


# -- report


def report(options):
    built, quota = read(options.work / "built.json"), read(options.work / "quota.json")
    outcomes, explained = read(options.work / "outcomes.json"), read(HERE / "explained.json", {})
    rows, table = [], {}
    for mutant in built["mutants"]:
        if identity(mutant) not in outcomes:
            continue
        outcome = outcomes[identity(mutant)]
        mutation = mutant["name"].split(": ", 1)[1]
        row = {"file": mutant["file"], "line": mutant["span"]["start"]["line"], "mutation": mutation, "genre": mutant["genre"], **outcome}
        if not outcome["caught"]:
            row["explanation"] = explained.get(identity(mutant), "")
        rows.append(row)
        counts = table.setdefault(mutant["file"].split("/")[1], collections.Counter())
        counts["sampled"] += 1
        counts["caught"] += outcome["caught"]
        counts[outcome.get("by", "survived")] += 1
        counts["timeout"] += outcome.get("how") == "timeout"
        counts["added"] += outcome.get("after_a_test_was_added", False)
    broken = read(options.work / "broken.json", [])
    skipped = {**quota["skipped"], "drawn, but the mutant does not compile": len(broken)}
    about = {"seed": options.seed, "tree": quota["tree"], "candidates": quota["candidates"], "skipped": skipped}
    write(RESULTS / "mutants.json", {**about, "mutants": rows})
    (RESULTS / "mutants.md").write_text(page(options, table, rows, quota, skipped))
    print((RESULTS / "mutants.md").read_text())


def page(options, table, rows, quota, skipped):
    caught = sum(counts["caught"] for counts in table.values())
    added = sum(counts["added"] for counts in table.values())
    columns = ["sampled", "caught", "own tests", "other unit tests", "timeout", "added", "survived"]
    lines = ["# Faults that the tests notice", "",
             f"Of {len(rows)} mutants of cargo-mutants, drawn by seed {options.seed} from {sum(quota['candidates'].values())}, the unit "
             f"tests catch {caught} ({100 * caught / len(rows):.1f} %). Golden, contract and statistics tests were not asked. Made by "
             f"`python scripts/mutants/run.py sample build reach run report`; lines are those of {quota['tree']}.", "",
             f"Before tests were added for what went by, they caught {caught - added} ({100 * (caught - added) / len(rows):.1f} %): "
             "expect about that of another sample, not the figure above.", "",
             "| folder | candidates | sampled | caught | share | by its own tests | by other unit tests "
             "| of these by running on without end | by a test added for it | survived |",
             "|---|---|---|---|---|---|---|---|---|---|"]
    total = collections.Counter()
    for folder in FOLDERS:
        counts = table.get(folder, collections.Counter())
        total += counts
        lines.append(line_of(folder, quota["candidates"][folder], counts, columns))
    lines.append(line_of("all", sum(quota["candidates"].values()), total, columns))
    lines += ["", "Left out before or while drawing:", ""]
    lines += [f"- {count} {reason}" for reason, count in sorted(skipped.items(), key=lambda item: -item[1])]
    lines += ["", "## Survivors", "", "| where | mutation | why no test notices |", "|---|---|---|"]
    for row in rows:
        if not row["caught"]:
            lines.append(f"| {row['file']}:{row['line']} | {row['mutation'].replace('|', chr(92) + '|')} | {row['explanation'] or '-'} |")
    answered = [row for row in rows if row.get("after_a_test_was_added")]
    lines += ["", "## Survivors that a test was added for", "", "| where | mutation | test |", "|---|---|---|"]
    lines += [f"| {row['file']}:{row['line']} | {row['mutation'].replace('|', chr(92) + '|')} | `{row['test']}` |" for row in answered]
    return "\n".join(lines) + "\n"


def line_of(folder, candidates, counts, columns):
    share = f"{100 * counts['caught'] / counts['sampled']:.0f} %" if counts["sampled"] else "-"
    cells = [folder, candidates, counts["sampled"], counts["caught"], share, *(counts[column] for column in columns[2:])]
    return "| " + " | ".join(map(str, cells)) + " |"


def main():
    steps = {"sample": sample, "build": build, "reach": reach, "run": run, "report": report}
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("steps", nargs="+", choices=steps)
    parser.add_argument("--work", type=pathlib.Path, default=pathlib.Path("/tmp/mutants"))
    parser.add_argument("--target", type=pathlib.Path, help="cargo's target folder; the tree's own by default: its dependencies are built")
    parser.add_argument("--cargo-mutants", default="cargo-mutants")
    parser.add_argument("--wanted", type=int, default=320)
    parser.add_argument("--seed", type=int, default=13)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--longest", type=float, default=60, help="reach: CPU seconds of a test at most")
    parser.add_argument("--again", action="store_true", help="run: survivors once more")
    parser.add_argument("--fresh", action="store_true", help="reach: all tests once more")
    options = parser.parse_args()
    options.work = options.work.resolve()
    options.target = (options.target or ROOT / "target").resolve()
    options.work.mkdir(parents=True, exist_ok=True)
    for step in options.steps:
        steps[step](options)


if __name__ == "__main__":
    main()
