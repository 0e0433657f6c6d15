"""Every condition under which a corpus must come out the same: its files, and the f64 results of every stage."""

import random
import shutil
import time

from lab import KILL, digest, files_of, stage_hashes, stop

HIDDEN = {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX512F"}
PLAIN = {"MARSYARD_KERNELS": "plain"}
POLYNOMIAL = ("scene.ground.roughness=null", "scene.ground.features=[]")


def conditions(lab, seed, short):
    """Yields (condition, times, hash of files, hash of f64 results, what was compared)."""
    rng = random.Random(seed)

    def whole(name, times=1, **how):
        """A whole corpus, `times` times; the hashes must be one and the same."""
        found = set()
        for _ in range(times):
            place = lab.fresh("same")
            lab.build("same", *how.get("extra", ()), environment=how.get("environment"))
            found.add((digest(files_of(place)), digest(stage_hashes(f"{place}.hashes"))))
        return judged(name, times, found, (digest(lab.reference), digest(lab.stages)))

    for threads in (1, 2, 3, 7):
        yield whole(f"{threads} threads" if threads > 1 else "1 thread", extra=("--threads", str(threads)))
    yield whole("fresh processes", 3 if short else 20)
    yield apart(lab, rng)
    yield killed(lab, rng)
    yield whole("AVX2 and FMA hidden from the C library", environment=HIDDEN)
    for kernels in ("avx2", "plain"):
        yield whole(f"kernels: {kernels}", environment={"MARSYARD_KERNELS": kernels})
    yield whole("kernels: plain, without the FMA instruction", environment={**PLAIN, **HIDDEN})
    yield polynomial(lab)
    yield emulated(lab, ())
    if not short:
        yield emulated(lab, POLYNOMIAL)


def judged(name, times, found, expected, what="corpus"):
    if found != {expected}:
        raise SystemExit(f"{name}: {sorted(found)} instead of {expected}")
    return {"condition": name, "times": times, "files": expected[0], "f64": expected[1], "compared": what}


def apart(lab, rng):
    """Each shard by a process of its own, in random order, then merged."""
    place = lab.fresh("same")
    code, out, _ = lab.run(["status", str(lab.folder / "reference")])
    shards = list(range(int(out.split("shards")[0].split(":")[-1])))
    rng.shuffle(shards)
    for shard in shards:
        lab.build("same", "--shards", str(shard))
    code, _, err = lab.run(["finalize", str(place)])
    assert code == 0, err
    found = {(digest(files_of(place)), digest(stage_hashes(f"{place}.hashes")))}
    return judged("shards in random order, a process each, finalized", len(shards), found,
                  (digest(lab.reference), digest(lab.stages)))


def killed(lab, rng):
    """Killed at random moments until a run gets through."""
    place, kills = lab.fresh("same"), 0
    while True:
        child = lab.start(lab.arguments("same", "--threads", "2", "--stage-hashes", f"{place}.hashes"))
        time.sleep(rng.uniform(0.02, 0.6 * lab.seconds))
        stop(child, KILL if kills < 20 else 0)
        child.communicate()
        if child.returncode == 0:
            break
        kills += 1
    found = {(digest(files_of(place)), digest(stage_hashes(f"{place}.hashes")))}
    return judged("killed and resumed", kills, found, (digest(lab.reference), digest(lab.stages)))


def polynomial(lab):
    """The other kind of ground, whose kernels are others."""
    found = set()
    for environment in ({}, PLAIN, {**PLAIN, **HIDDEN}, {"MARSYARD_KERNELS": "avx2"}):
        place = lab.fresh("same")
        lab.build("same", sets=POLYNOMIAL, environment=environment)
        found.add((digest(files_of(place)), digest(stage_hashes(f"{place}.hashes"))))
    return judged("polynomial ground: widest, avx2, plain, plain without FMA", 4, found, min(found))


def emulated(lab, sets):
    """One scene of each on this processor and on an emulated one without FMA."""
    name = f"emulated Nehalem (qemu), {'polynomial' if sets else 'raster'} ground"
    if shutil.which("qemu-x86_64") is None:
        return {"condition": name, "times": 0, "files": "", "f64": "", "compared": "not run: no qemu-x86_64 here"}
    sets = ("scenes_per_shard=1", "scenes=1", *sets)
    found = []
    for prefix in ((), ("qemu-x86_64", "-cpu", "Nehalem")):
        place = lab.fresh("same")
        lab.build("same", sets=sets, prefix=prefix)
        # The receipt says which file the binary is; under emulation its path cannot always be read.
        found.append((digest(files_of(place)), digest(stage_hashes(f"{place}.hashes"))))
    return judged(name, 1, set(found[1:]), found[0], "one scene")
