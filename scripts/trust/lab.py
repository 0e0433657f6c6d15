"""A scratch folder, the binary, and one corpus that every fault and condition is judged against."""

import hashlib
import json
import os
import pathlib
import resource
import shutil
import signal
import subprocess
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
EVERYTHING = ROOT / "tests/fixtures/everything.yaml"
TRY_AGAIN = 75
# Where memory is limited, the standard library's backtrace of a failed allocation may wait for itself for ever.
QUIET = {"RUST_BACKTRACE": "0"}


class Lost(Exception):
    """A fault cost something: bytes, a shard, or a clear end."""


class Lab:
    def __init__(self, binary, scenes):
        self.binary = str(pathlib.Path(binary).resolve())
        self.scenes = scenes
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="marsyard-trust-"))
        self.build("reference")
        # Moments are drawn within the time of an undisturbed build, the quickest of three.
        self.seconds = min(self.timed_build() for _ in range(3))
        self.reference = files_of(self.folder / "reference")
        self.corpus_id = corpus_id(self.folder / "reference")
        self.stages = stage_hashes(self.folder / "reference.hashes")

    def timed_build(self):
        self.fresh("timed")
        started = time.monotonic()
        self.build("timed")
        return time.monotonic() - started

    def close(self):
        shutil.rmtree(self.folder, ignore_errors=True)

    def arguments(self, out, *extra, sets=()):
        sets = [f"scenes={self.scenes}", *sets]
        return ["generate", str(EVERYTHING), "--out", str(out), *[word for s in sets for word in ("--set", s)], *extra]

    def start(self, arguments, environment=None, limits=(), prefix=()):
        """The binary as a child; `limits` are (resource, value) pairs."""
        def limit():
            for what, value in limits:
                resource.setrlimit(what, (value, value))

        return subprocess.Popen(
            [*prefix, self.binary, *arguments], cwd=self.folder, env={**os.environ, **QUIET, **(environment or {})},
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, preexec_fn=limit if limits else None)

    def run(self, arguments, **how):
        child = self.start(arguments, **how)
        out, err = child.communicate()
        return child.returncode, out, err

    def build(self, out, *extra, sets=(), **how):
        """Builds, which must succeed, and adds the stages' hashes to `<out>.hashes`."""
        hashes = f"{self.folder / out}.hashes"
        code, _, err = self.run(self.arguments(out, "--stage-hashes", hashes, *extra, sets=sets), **how)
        if code != 0:
            raise Lost(f"exit {code}: {err.strip()[-600:]}")

    def fresh(self, name, whole=False):
        """An empty place, or a copy of the reference."""
        place = self.folder / name
        shutil.rmtree(place, ignore_errors=True)
        pathlib.Path(f"{place}.hashes").unlink(missing_ok=True)
        if whole:
            shutil.copytree(self.folder / "reference", place)
        return place

    def sound(self, place):
        """What lies in an unfinished place must be whole: no shard may count as done and differ from the reference."""
        code, out, err = self.run(["status", str(place)])
        if code != 0:
            if (pathlib.Path(place) / "plan.yaml").exists():
                raise Lost(f"status: exit {code}: {err.strip()[-300:]}")
            return
        if "damaged        0" not in out:
            raise Lost(f"status after the fault: {out}")
        there = files_of(place)
        for name in there:
            if name.startswith("receipts/") and there[name] != self.reference.get(name):
                raise Lost(f"{name} is there and differs")
            shard = name.rsplit("-", 1)[-1].removesuffix(".parquet")
            if name.startswith("data/") and f"receipts/{shard}.json" in there and there[name] != self.reference.get(name):
                raise Lost(f"{name} counts as whole and differs")

    def completes(self, place):
        """The same command again ends well, `verify` finds nothing, and every byte is the reference's."""
        self.build(pathlib.Path(place).name if pathlib.Path(place).parent == self.folder else place)
        self.same(place)

    def same(self, place):
        code, out, err = self.run(["verify", str(place)])
        if code != 0:
            raise Lost(f"verify: exit {code}: {(out + err).strip()[-600:]}")
        there = files_of(place)
        if there != self.reference:
            differing = sorted(n for n in there.keys() | self.reference.keys() if there.get(n) != self.reference.get(n))
            raise Lost(f"other files than the reference: {differing[:5]}")
        if corpus_id(place) != self.corpus_id:
            raise Lost("another corpus_id")


def files_of(place):
    """Every file that belongs to a corpus's identity, with its sha256. Temporary files count: none may stay."""
    place = pathlib.Path(place)
    files = (path for path in sorted(place.rglob("*")) if path.is_file())
    names = ((str(path.relative_to(place)), path) for path in files)
    return {name: hashlib.sha256(path.read_bytes()).hexdigest() for name, path in names
            if name != "report.json" and "/.marsyard-tmp-" not in f"/{name}"}


def corpus_id(place):
    return json.loads((pathlib.Path(place) / "manifest.json").read_text())["corpus_id"]


def stage_hashes(path):
    """By scene, the hashes of its stages' f64 results; a scene that was built twice must have had the same."""
    scenes = {}
    for line in pathlib.Path(path).read_text().splitlines():
        line = json.loads(line)
        if scenes.setdefault(line["scene"], line) != line:
            raise Lost(f"scene {line['scene']}: built twice, with other f64 results")
    return scenes


def digest(value):
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()[:16]


def stop(child, signal_number):
    """Sends a signal, if there is still somebody to get it."""
    if child.poll() is None:
        child.send_signal(signal_number)


KILL = signal.SIGKILL
