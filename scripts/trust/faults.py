"""Faults, each injected at a random moment of a build or into a random place of a corpus.

Every function injects one fault, and then demands: what lies there is whole, the same command completes, `verify` finds
nothing, and every byte is that of an undisturbed build. It returns a word for what the fault met, and raises `Lost` otherwise.
"""

import json
import pathlib
import resource
import shutil
import signal
import subprocess
import time

from lab import KILL, TRY_AGAIN, Lost, files_of, stop


def signalled(lab, rng, signal_number):
    """A signal at a random moment, from the start of the process to after its end."""
    place = lab.fresh("fault")
    child = lab.start(lab.arguments("fault", "--threads", str(rng.choice((1, 2, 3)))))
    time.sleep(rng.uniform(0, 1.1 * lab.seconds))
    stop(child, signal_number)
    _, err = child.communicate()
    expected = {0, -signal_number} if signal_number == KILL else {0, TRY_AGAIN, -signal_number}
    if child.returncode not in expected:
        raise Lost(f"exit {child.returncode}: {err[-300:]}")
    # Without its own handler the process dies of the signal: so only before it has begun.
    if child.returncode == -signal_number != -KILL and (place / "receipts").exists():
        raise Lost("the signal killed a build that had begun")
    if child.returncode == TRY_AGAIN and "the same command again goes on" not in err:
        raise Lost(f"no word of how to go on: {err[-300:]}")
    lab.sound(place)
    lab.completes(place)
    return {0: "over before", TRY_AGAIN: "stopped, exit 75"}.get(child.returncode, "killed")


def kill_9(lab, rng):
    return signalled(lab, rng, signal.SIGKILL)


def sigint(lab, rng):
    return signalled(lab, rng, signal.SIGINT)


def sigterm(lab, rng):
    return signalled(lab, rng, signal.SIGTERM)


def several_kills(lab, rng):
    """Killed again and again; each run goes on where the last one died."""
    place, kills = lab.fresh("fault"), rng.randint(2, 6)
    for _ in range(kills):
        child = lab.start(lab.arguments("fault"))
        time.sleep(rng.uniform(0, 0.7 * lab.seconds))
        stop(child, KILL)
        child.communicate()
        lab.sound(place)
    lab.completes(place)
    return f"{kills} kills"


def file_size_limit(lab, rng):
    """`ulimit -f`, from nothing to the size of the largest table."""
    place = lab.fresh("fault")
    limit = rng.randint(0, int(1.1 * largest(lab)))
    code, _, err = lab.run(lab.arguments("fault"), limits=[(resource.RLIMIT_FSIZE, limit)])
    if code not in (0, TRY_AGAIN) or code == TRY_AGAIN and "ulimit -f" not in err:
        raise Lost(f"exit {code}: {err[-300:]}")
    lab.sound(place)
    lab.completes(place)
    return "fits" if code == 0 else "refused, exit 75"


def address_space_limit(lab, rng):
    """`ulimit -v`, from enough for little more than the program itself to enough for all."""
    place = lab.fresh("fault")
    limit = rng.randint(30 << 20, 120 << 20)
    code, _, err = lab.run(lab.arguments("fault", "--threads", "2"), limits=[(resource.RLIMIT_AS, limit)])
    words = ("memory", "allocate", "unavailable", "cannot map", "failed to map")
    if code != 0 and not any(word in err for word in words):
        raise Lost(f"{limit >> 20} MB: exit {code}, without a clear word: {err[-300:]!r}")
    lab.sound(place)
    lab.completes(place)
    return "enough" if code == 0 else "out of memory"


class Tmpfs:
    """A small file system of one's own; needs the right to mount."""

    def __init__(self, lab, options):
        self.path = lab.folder / "disk"
        self.path.mkdir(exist_ok=True)
        self.mount(options)

    def mount(self, options):
        subprocess.run(["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(self.path)], check=True, capture_output=True)

    def remount(self, options):
        subprocess.run(["mount", "-o", f"remount,{options}", str(self.path)], check=True, capture_output=True)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        subprocess.run(["umount", "-l", str(self.path)], check=True)


def corpus_bytes(lab):
    return sum(path.stat().st_size for path in (lab.folder / "reference").rglob("*") if path.is_file())


def largest(lab):
    return max(path.stat().st_size for path in (lab.folder / "reference").rglob("*") if path.is_file())


def full_disk(lab, rng):
    """A disk that is too small by chance; half the time another program fills it meanwhile."""
    size = rng.randint(64 << 10, int(1.3 * corpus_bytes(lab)))
    with Tmpfs(lab, f"size={size}") as disk:
        place = disk.path / "corpus"
        child = lab.start(lab.arguments(place, "--keep-free-mb", "0"))
        if rng.random() < 0.5:
            time.sleep(rng.uniform(0, lab.seconds))
            fill(disk.path / "filler")
        _, err = child.communicate()
        if child.returncode not in (0, TRY_AGAIN) or child.returncode and "free some space" not in err:
            raise Lost(f"exit {child.returncode}: {err[-300:]}")
        (disk.path / "filler").unlink(missing_ok=True)
        disk.remount("size=1g")
        lab.sound(place)
        lab.completes(place)
        return "fits" if child.returncode == 0 else "stopped, exit 75"


def fill(path):
    try:
        with open(path, "wb") as file:
            while True:
                file.write(b"x" * 65536)
                file.flush()
    except OSError:
        pass


def no_inodes(lab, rng):
    """A disk with bytes to spare and no room for another file: free space cannot tell that."""
    with Tmpfs(lab, f"size=1g,nr_inodes={rng.randint(3, 60)}") as disk:
        place = disk.path / "corpus"
        code, _, err = lab.run(lab.arguments(place))
        if code not in (0, TRY_AGAIN) or code and "free some space" not in err:
            raise Lost(f"exit {code}: {err[-300:]}")
        disk.remount("size=1g,nr_inodes=100000")
        lab.sound(place)
        lab.completes(place)
        return "fits" if code == 0 else "stopped, exit 75"


def read_only(lab, rng):
    """A disk that turns read-only, as disks with errors do."""
    with Tmpfs(lab, "size=1g") as disk:
        place = disk.path / "corpus"
        child = lab.start(lab.arguments(place))
        time.sleep(rng.uniform(0, 0.6 * lab.seconds))
        for _ in range(1000):
            try:
                disk.remount("ro")
                break
            except subprocess.CalledProcessError:
                time.sleep(0.001)  # A file is being written this moment.
        _, err = child.communicate()
        if child.returncode not in (0, 1) or child.returncode and "Read-only" not in err:
            raise Lost(f"exit {child.returncode}: {err[-300:]}")
        disk.remount("rw")
        lab.sound(place)
        lab.completes(place)
        return "over before" if child.returncode == 0 else "stopped, exit 1"


def vanishing_folder(lab, rng):
    """The folder goes away (unmounted, renamed) and comes back."""
    place, away = lab.fresh("fault"), lab.fresh("away")
    child = lab.start(lab.arguments("fault"))
    while not place.exists() and child.poll() is None:
        time.sleep(0.001)
    time.sleep(rng.uniform(0, 0.6 * lab.seconds))
    moved = place.exists()
    if moved:
        place.rename(away)
    _, err = child.communicate()
    if child.returncode not in (0, 1, TRY_AGAIN):
        raise Lost(f"exit {child.returncode}: {err[-300:]}")
    if moved:
        shutil.rmtree(place, ignore_errors=True)
        away.rename(place)
        lab.sound(place)
    lab.completes(place)
    return {0: "over before", TRY_AGAIN: "stopped, exit 75"}.get(child.returncode, "stopped, exit 1")


# Files whose every bit counts. The card and the Croissant file are for readers to edit.
COUNTED = ("data/", "receipts/", "manifest.json", "shards.jsonl")


def one_file(lab, rng, place):
    names = [name for name in files_of(place) if name.startswith(COUNTED)]
    return place / rng.choice(names)


def repaired(lab, place, what):
    """`verify` finds the damage, `verify --repair` replaces it."""
    code, out, err = lab.run(["verify", str(place)])
    if code != 1:
        raise Lost(f"{what}: verify ends with {code}: {(out + err)[-300:]}")
    code, out, err = lab.run(["verify", str(place), "--repair"])
    if code != 0:
        raise Lost(f"{what}: the repair ends with {code}: {(out + err)[-300:]}")
    lab.same(place)


def bit_flip(lab, rng):
    place = lab.fresh("fault", whole=True)
    path = one_file(lab, rng, place)
    content = bytearray(path.read_bytes())
    bit = rng.randrange(8 * len(content))
    content[bit // 8] ^= 1 << bit % 8
    path.write_bytes(content)
    name = path.relative_to(place)
    code, out, err = lab.run(["verify", str(place)])
    if "written in format" in out + err:
        # The one number that cannot be told from another program's: nothing is touched, a person decides.
        path.unlink()
        lab.completes(place)
        return "told as another format"
    repaired(lab, place, f"bit {bit} of {name}")
    return f"found in {name.parts[0]}"


def truncation(lab, rng):
    place = lab.fresh("fault", whole=True)
    path = one_file(lab, rng, place)
    content = path.read_bytes()
    path.write_bytes(content[:rng.randrange(len(content))])
    if rng.random() < 0.5 and path.parts[-2] in ("receipts", "cells", "scenes", "poses", "points"):
        lab.completes(place)  # Another size shows without reading: generate itself builds the shard anew.
        return "rebuilt by generate"
    repaired(lab, place, f"truncated {path.name}")
    return "repaired"


def foreign_file(lab, rng):
    """A shard or receipt of the same name from another corpus: a receipt is written anew, a shard may be somebody's only one and is
    refused until it is moved away."""
    other = lab.folder / "other"
    if not other.exists():
        code, _, err = lab.run(lab.arguments("other", sets=("seed=1",)))
        assert code == 0, err
    place = lab.fresh("fault", whole=True)
    path = one_file(lab, rng, place)
    shutil.copy(other / path.relative_to(place), path)
    if path.suffix == ".parquet":
        code, out, err = lab.run(["verify", str(place), "--repair"])
        if code != 2 or "move the file away" not in err or path.read_bytes() != (other / path.relative_to(place)).read_bytes():
            raise Lost(f"foreign {path.name}: the repair ends with {code}: {(out + err)[-300:]}")
        path.unlink()
    repaired(lab, place, f"foreign {path.name}")
    return "repaired"


def damaged_plan(lab, rng):
    """A bit of plan.yaml: refused or harmless, and the original config puts it right."""
    place = lab.fresh("fault", whole=True)
    path = place / "plan.yaml"
    content = bytearray(path.read_bytes())
    head = content.index(b"\n")
    bit = rng.randrange(8 * (head + 1), 8 * len(content))
    content[bit // 8] ^= 1 << bit % 8
    path.write_bytes(content)
    before = {name: sha for name, sha in files_of(place).items() if name != "plan.yaml"}
    lab.run(["verify", str(place), "--repair"])
    after = {name: sha for name, sha in files_of(place).items() if name in before and name.startswith(("data/", "receipts/"))}
    if any(before[name] != sha for name, sha in after.items()) or len(after) < sum(
            name.startswith(("data/", "receipts/")) for name in before):
        raise Lost(f"a repair by a damaged plan.yaml (bit {bit}) changed shards")
    lab.completes(place)
    return "told, and written anew"


def several_builds(lab, rng):
    """Two to four builds of one corpus at once; some are killed, finalize and status look in between."""
    place = lab.fresh("fault")
    children = []
    for _ in range(rng.randint(2, 4)):
        children.append(lab.start(lab.arguments("fault", "--threads", str(rng.choice((1, 2))))))
        time.sleep(rng.uniform(0, 0.3 * lab.seconds))
    doomed = rng.sample(children, rng.randint(0, len(children) - 1))
    while any(child.poll() is None for child in children):
        time.sleep(rng.uniform(0, 0.2 * lab.seconds))
        lab.run([rng.choice(("status", "finalize")), str(place)])
        for child in doomed[:1]:
            stop(child, rng.choice((KILL, signal.SIGTERM)))
            doomed.remove(child)
    for child in children:
        _, err = child.communicate()
        if child.returncode not in (0, TRY_AGAIN, -KILL, -signal.SIGTERM):
            raise Lost(f"exit {child.returncode}: {err[-300:]}")
    lab.completes(place)
    return f"{len(children)} builds"


def killed_repair(lab, rng):
    """A repair that is killed is gone on with by the same command."""
    place = lab.fresh("fault", whole=True)
    for _ in range(rng.randint(1, 3)):
        one_file(lab, rng, place).unlink(missing_ok=True)
    child = lab.start(["verify", str(place), "--repair"])
    time.sleep(rng.uniform(0, lab.seconds))
    stop(child, KILL)
    child.communicate()
    code, out, err = lab.run(["verify", str(place), "--repair"])
    if code != 0:
        raise Lost(f"exit {code}: {(out + err)[-300:]}")
    lab.same(place)
    return "over before" if child.returncode == 0 else "killed"


def changed_config(lab, rng):
    """Another config in the same place: refused with the difference, at any moment of the build."""
    place = lab.fresh("fault")
    child = lab.start(lab.arguments("fault"))
    time.sleep(rng.uniform(0.2, 0.8) * lab.seconds)
    stop(child, KILL)
    child.communicate()
    before = files_of(place)
    change, key = rng.choice((("seed=7", "seed"), ("scene.extent_m=13", "extent_m"), ("sweep.effects.dropout.rate=0.02", "rate")))
    if "plan.yaml" in before:
        code, _, err = lab.run(lab.arguments("fault", sets=(change,)))
        if code != 2 or key not in err or files_of(place) != before:
            raise Lost(f"--set {change}: exit {code}: {err[-300:]}")
    lab.completes(place)
    return "refused, exit 2" if before else "nothing there yet"


def failing_scenes(lab, rng):
    """Scenes that always fail, and kills between: the same failures, the same bytes."""
    sets = ("scene.ground.max_slope_deg=5", "max_failed_share=1")
    steep = lab.folder / "steep"
    if not steep.exists():
        lab.build("steep", sets=sets)
    place = lab.fresh("fault")
    child = lab.start(lab.arguments("fault", sets=sets))
    time.sleep(rng.uniform(0, lab.seconds))
    stop(child, KILL)
    child.communicate()
    lab.build("fault", sets=sets)
    if files_of(place) != files_of(steep):
        raise Lost("other files than the undisturbed build with failing scenes")
    failed = len(json.loads((steep / "manifest.json").read_text())["failed"])
    if failed == 0:
        raise Lost("no scene failed: the fault was not injected")
    return f"{failed} scenes failed alike"


def growth(lab, rng):
    """`scenes` raised in random steps, with a kill on the way: shards are only added."""
    place = lab.fresh("fault")
    steps = sorted(rng.sample(range(2, lab.scenes, 2), min(2, lab.scenes // 2 - 1)))
    held = {}
    for scenes in steps:
        child = lab.start(lab.arguments("fault", sets=(f"scenes={scenes}",)))
        if rng.random() < 0.3:
            time.sleep(rng.uniform(0, lab.seconds))
            stop(child, KILL)
        child.communicate()
        now = {name: sha for name, sha in files_of(place).items() if name.startswith(("data/", "receipts/"))}
        changed = [name for name in held if now.get(name) != held[name]]
        if changed:
            raise Lost(f"raising scenes to {scenes} changed {changed[:3]}")
        held = now
    lab.completes(place)
    return "grown"


def another_program(lab, rng):
    """Begun by a binary that says it was made of other sources, killed, gone on with by this one: told, and merged."""
    twin = lab.folder / "another-marsyard"
    if not twin.exists():
        manifest = json.loads((lab.folder / "reference" / "manifest.json").read_text())
        sources = manifest["build"]["sources_sha256"].encode()
        whole = pathlib.Path(lab.binary).read_bytes()
        if sources not in whole:
            raise Lost("the binary does not hold the hash of its sources in one piece")
        twin.write_bytes(whole.replace(sources, sources[::-1]))
        twin.chmod(0o755)
    place = lab.fresh("fault")
    child = subprocess.Popen([str(twin), *lab.arguments("fault")], cwd=lab.folder, stdout=subprocess.PIPE,
                             stderr=subprocess.PIPE, text=True)
    time.sleep(rng.uniform(0, lab.seconds))
    stop(child, KILL)
    child.communicate()
    theirs = len(list((place / "receipts").glob("*.json"))) if (place / "receipts").exists() else 0
    code, _, err = lab.run(lab.arguments("fault"))
    if code != 0:
        raise Lost(f"exit {code}: {err[-300:]}")
    shards = len([name for name in lab.reference if name.startswith("receipts/")])
    if 0 < theirs < shards and f"{theirs} of the shards there were written by another marsyard" not in err:
        raise Lost(f"not told: {err[-300:]}")
    data = {name: sha for name, sha in files_of(place).items() if name.startswith("data/")}
    if data != {name: sha for name, sha in lab.reference.items() if name.startswith("data/")}:
        raise Lost("other data than the reference")
    manifest = json.loads((place / "manifest.json").read_text())
    if manifest["corpus_id"] != lab.corpus_id or (0 < theirs < shards) != bool(manifest.get("other_builds")):
        raise Lost(f"the manifest does not tell the programs: {manifest.get('other_builds')}")
    code, out, _ = lab.run(["verify", str(place)])
    if code != 0:
        raise Lost(out[-300:])
    return "two programs" if 0 < theirs < shards else "one program"


def can_mount(lab):
    try:
        with Tmpfs(lab, "size=64k"):
            return True
    except (subprocess.CalledProcessError, FileNotFoundError):
        return False


# (fault, what it is, needs the right to mount)
ALL = [
    (kill_9, "kill -9", False),
    (several_kills, "kill -9, two to six times a build", False),
    (sigint, "SIGINT", False),
    (sigterm, "SIGTERM", False),
    (file_size_limit, "file-size limit (ulimit -f)", False),
    (address_space_limit, "out of memory (ulimit -v)", False),
    (full_disk, "full disk", True),
    (no_inodes, "no inodes left", True),
    (read_only, "disk turns read-only", True),
    (vanishing_folder, "folder goes away", False),
    (bit_flip, "bit flipped in a shard, receipt or manifest", False),
    (truncation, "shard, receipt or manifest truncated", False),
    (foreign_file, "shard, receipt or manifest of another corpus", False),
    (damaged_plan, "bit flipped in plan.yaml", False),
    (several_builds, "several builds of one corpus at once", False),
    (killed_repair, "kill -9 during verify --repair", False),
    (changed_config, "resume with a changed config", False),
    (failing_scenes, "scenes that fail, and kill -9", False),
    (another_program, "begun by another binary, kill -9", False),
    (growth, "scenes raised, and kill -9", False),
]
