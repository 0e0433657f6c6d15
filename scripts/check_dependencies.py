#!/usr/bin/env python3
"""Cargo.lock against deny.toml: the licence and the origin of every crate that is linked on x86-64 Linux; and whether builds with and without
object-stores ask for the same features of the crates that both have, so that these are compiled once.

    python scripts/check_dependencies.py

The quick part of `cargo deny check licenses bans sources`, which takes minutes to install; scripts/hostile.sh runs the whole. Python 3.11,
standard library only. Exit 1 with every crate that breaks a rule.
"""

import json
import pathlib
import re
import subprocess
import sys
import tomllib

ROOT = pathlib.Path(__file__).resolve().parent.parent


def satisfied(expression, allowed):
    """Whether the licences allowed satisfy an SPDX expression ('/' is an old way to write OR)."""
    words = re.findall(r"\(|\)|[^\s()/]+|/", expression)
    words = ["OR" if word == "/" else word for word in words]

    def either():
        value = both()
        while words and words[0] == "OR":
            words.pop(0)
            right = both()
            value = value or right
        return value

    def both():
        value = one()
        while words and words[0] == "AND":
            words.pop(0)
            right = one()
            value = value and right
        return value

    def one():
        word = words.pop(0)
        if word == "(":
            value = either()
            words.pop(0)
            return value
        if words and words[0] == "WITH":
            word = f"{word} {words.pop(0)} {words.pop(0)}"
        return word in allowed

    value = either()
    if words:
        raise ValueError(f"{expression!r} is no SPDX expression")
    return value


def check_itself():
    """The rules of SPDX, on expressions whose answer is plain."""
    for expression, answer in {
        "MIT": True, "GPL-3.0": False, "GPL-3.0 OR MIT": True, "GPL-3.0 AND MIT": False, "GPL-3.0/MIT": True,
        "(GPL-3.0 OR MIT) AND ISC": True, "ISC AND (GPL-3.0 OR LGPL-3.0)": False, "MIT AND ISC OR GPL-3.0": True,
        "Apache-2.0 WITH LLVM-exception": True, "Apache-2.0": False,
    }.items():
        assert satisfied(expression, {"MIT", "ISC", "Apache-2.0 WITH LLVM-exception"}) == answer, expression


def features(*more):
    """By crate, the features that a build asks for."""
    command = ["cargo", "tree", "--locked", "--edges", "normal,build", "--prefix", "none", "--format", "{p}|{f}", *more]
    lines = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout.splitlines()
    asked = {}
    for crate, of in (line.removesuffix(" (*)").split("|") for line in lines if line and not line.startswith("marsyard ")):
        # The same crate may stand there twice, for the program and for what runs at build time.
        asked.setdefault(crate, set()).add(of)
    return asked


def compiled_twice():
    plain, stores = features(), features("--features", "object-stores")
    return [f"{crate}: object-stores asks for {sorted(stores[crate])}, a plain build for {sorted(plain[crate])}; name the missing features in Cargo.toml"
            for crate in sorted(plain) if crate in stores and plain[crate] != stores[crate]]


def main():
    check_itself()
    rules = tomllib.loads((ROOT / "deny.toml").read_text())
    allowed = set(rules["licenses"]["allow"])
    command = ["cargo", "metadata", "--format-version", "1", "--locked", "--all-features"]
    command += ["--filter-platform", "x86_64-unknown-linux-gnu"]
    metadata = json.loads(subprocess.run(command, cwd=ROOT, check=True, capture_output=True).stdout)
    linked = {node["id"] for node in metadata["resolve"]["nodes"]}
    crates = [crate for crate in metadata["packages"] if crate["id"] in linked]
    faults = []
    for crate in crates:
        name, licence, source = f"{crate['name']} {crate['version']}", crate["license"], crate["source"]
        if not licence or not satisfied(licence, allowed):
            faults.append(f"{name}: its licence {licence!r} is not allowed; choose another crate, or allow it in deny.toml")
        if source is None and crate["name"] != "marsyard":
            faults.append(f"{name}: a crate by path; take it from the registry")
        if source and not source.startswith("registry+"):
            faults.append(f"{name}: from {source}; take it from the registry")
        faults += [f"{name}: needs any version of {d['name']}" for d in crate["dependencies"] if source is None and d["req"] == "*"]
    faults += compiled_twice()
    print("\n".join(faults) or f"ok  {len(crates)} crates")
    sys.exit(1 if faults else 0)


if __name__ == "__main__":
    main()
