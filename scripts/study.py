"""What the studies share: driving the `marsyard` binary, reading its JSON, tables and statistics.

Whatever was built, trained or judged before lies in the work folder and is not made again: the same command gives the same bits, so a
study that was interrupted goes on where it stopped. Give another work folder after a change of the binary or of a config.
"""

import json
import pathlib
import platform
import resource
import statistics
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parents[1]
RESULTS = ROOT / "scripts" / "results"
#: The default's network by the squared error, which was the default before the logarithmic loss.
SQUARED = ["filter.kronecker.loss=squared"]
#: What configs/train/ekf.yaml sets: the Kalman filter and its network of 16-16 neurons.
KALMAN_FILTER = ["filter={ekf: {}}", "network.hidden=[16,16]", "patience=5"]


class Marsyard:
    """Runs verbs of the binary; a failure shows what the verb said and ends the study."""

    def __init__(self, binary, work, threads):
        self.binary, self.work, self.threads = str(binary), pathlib.Path(work), threads
        self.work.mkdir(parents=True, exist_ok=True)

    def run(self, *arguments):
        done = subprocess.run([self.binary, *map(str, arguments)], capture_output=True, text=True)
        if done.returncode:
            sys.exit(f"marsyard {' '.join(map(str, arguments))} failed:\n{done.stderr[-4000:]}")
        return done.stdout

    def cpu_s(self, *arguments):
        """CPU seconds of a verb."""
        before = cpu_s(resource.RUSAGE_CHILDREN)
        self.run(*arguments)
        return cpu_s(resource.RUSAGE_CHILDREN) - before

    def version(self):
        return self.run("--version").strip()

    def corpus(self, name, config, sets, scenes, per_shard):
        """A corpus of `config` with overrides; its folder."""
        place = self.work / "corpora" / name
        if not (place / "manifest.json").exists():
            sizes = [f"name={name}", f"scenes={scenes}", f"scenes_per_shard={per_shard}"]
            note(f"generate {name}: {scenes} scenes")
            self.run("generate", config, "--out", place, "--threads", self.threads, *overrides([*sizes, *sets]))
        return place

    def shipped(self, name, sets=()):
        """The corpus of a shipped config as it is, but for `sets`; its folder."""
        place = self.work / "corpora" / name
        if not (place / "manifest.json").exists():
            note(f"generate {name}")
            self.run("generate", ROOT / "configs" / f"{name}.yaml", "--out", place, "--threads", self.threads, *overrides(sets))
        return place

    def train(self, name, corpora, seed, sets=()):
        """A network; its run folder."""
        run = self.work / "runs" / f"{name}-{seed}"
        if not (run / "training.json").exists():
            note(f"train {name}, seed {seed}")
            resume = ["--resume"] if run.exists() else []
            self.run("train", *corpora, "--out", run, "--seed", seed, "--threads", self.threads, *resume, *overrides(sets))
        return run

    def evaluate(self, run, corpus, name, *options):
        """The report of a network on a corpus."""
        kept = pathlib.Path(run) / f"{name}.json"
        if not kept.exists():
            kept.write_text(self.run("evaluate", run, corpus, "--json", *options))
        return json.loads(kept.read_text())


def overrides(sets):
    """`key=value` each -> the options that set them."""
    return [part for key in sets for part in ("--set", key)]


def cpu_s(who):
    """CPU seconds so far, of this process or of those that it has waited for."""
    used = resource.getrusage(who)
    return used.ru_utime + used.ru_stime


def note(text):
    print(f"{time.strftime('%H:%M:%S')} {text}", file=sys.stderr, flush=True)


def add_arguments(parser, work):
    """The options that all studies have."""
    parser.add_argument("--marsyard", default=ROOT / "target" / "release" / "marsyard", type=pathlib.Path,
                        help="the binary (default: target/release/marsyard)")
    parser.add_argument("--work", default=ROOT / "target" / "studies" / work, type=pathlib.Path,
                        help="folder for corpora and runs; what lies there is not made again "
                             f"(default: target/studies/{work})")
    parser.add_argument("--threads", default=2, type=int, help="threads of marsyard; no result depends on it (default 2)")
    parser.add_argument("--out", default=RESULTS, type=pathlib.Path, help="folder of the results (default: scripts/results)")
    parser.add_argument("--quick", action="store_true", help="small corpora and one seed: whether it runs, not what is true")


def command(script, parser, options, keys):
    """The command that a page names: the script with those of the options that were given another value than their default."""
    words = ["python", f"scripts/{script}.py"]
    for key in keys:
        value = getattr(options, key.replace("-", "_"))
        if value != parser.get_default(key.replace("-", "_")):
            words += [f"--{key}"] if value is True else [f"--{key}", str(value)]
    return " ".join(words)


def versions(marsyard, *packages):
    found = {"python": platform.python_version(), "marsyard": marsyard.version()}
    found.update({package.__name__: package.__version__ for package in packages})
    return found


def mean_spread(values):
    """Mean and sample standard deviation over seeds; None where a rate does not exist."""
    values = [value for value in values if value is not None]
    if not values:
        return {"mean": None, "sd": None, "seeds": []}
    spread = statistics.stdev(values) if len(values) > 1 else None
    return {"mean": statistics.fmean(values), "sd": spread, "seeds": values}


def median_and_range(values, digits):
    """Median (least to most)."""
    return f"{statistics.median(values):.{digits}f} ({min(values):.{digits}f} to {max(values):.{digits}f})"


def percent(value, digits=2):
    return "-" if value is None else f"{100 * value:.{digits}f}"


def percent_spread(entry, digits=2):
    """{mean, sd} -> `5.28 ± 0.31`, in percent."""
    if entry["mean"] is None:
        return "-"
    spread = "" if entry["sd"] is None else f" ± {percent(entry['sd'], digits)}"
    return percent(entry["mean"], digits) + spread


def markdown(head, rows):
    """An aligned table; numbers to the right."""
    rows = [[str(value) for value in row] for row in rows]
    widths = [max(len(row[k]) for row in [head, *rows]) for k in range(len(head))]
    line = lambda row: "| " + " | ".join(
        text.ljust(width) if k == 0 else text.rjust(width) for k, (text, width) in enumerate(zip(row, widths))) + " |"
    rule = "|" + "|".join("-" * (width + 1) + ("-" if k == 0 else ":") for k, width in enumerate(widths)) + "|"
    return "\n".join([line(head), rule, *map(line, rows)])


def beside_former(made, former, names, key=None):
    """What was made now, and of the other names what stands in `former` (JSON, under `key` if one is given), in the order of the names."""
    kept = json.loads(former.read_text()) if len(made) < len(names) and former.exists() else {}
    kept = kept.get(key, {}) if key else kept
    return {name: made[name] if name in made else kept[name] for name in names if name in made or name in kept}


def write_results(folder, name, results, text):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{name}.json").write_text(json.dumps(results, indent=1) + "\n")
    (folder / f"{name}.md").write_text(text)
    print(text)
    note(f"results are in {folder / name}.json and .md")
