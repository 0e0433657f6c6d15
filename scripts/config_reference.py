#!/usr/bin/env python3
"""The JSON Schemas of the configs -> docs/configs.md: every key, its values, its default, what it means.

    python scripts/config_reference.py            write docs/configs.md anew
    python scripts/config_reference.py --check    exit 1 where it is not what the schemas say

In: schemas/corpus.schema.json and schemas/train.schema.json, which are themselves held to the program's types by a test.
"""

import json
import pathlib
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "configs.md"
SECTIONS = ["scene", "drive", "sweep", "slam", "cells"]

HEAD = """\
# Configs, key by key

One YAML file is one corpus; another, optional one says how a network is trained. This page is written from the schemas of both
(`python scripts/config_reference.py`); editors complete the same keys where a file's first line is
`# yaml-language-server: $schema=../schemas/corpus.schema.json`. `configs/` holds examples that explain themselves.

- Unknown keys, wrong types and values outside their range are refused, with file, line, rule and cure, before anything is written.
- **What a config does not name is not modelled**, costs nothing and leaves no column. `marsyard plan CONFIG` lists the parts that it names, and those that are left out.
- *number or law*: a constant, as in `0.3`, or a law, as in `{uniform: [0.1, 0.8]}`, that is drawn anew for each scene (for each object
  where the key says so). [Laws](#laws) lists them. All that a law may draw must lie in the key's range.
- *absent* as a default: the thing is not there. A key in bold must be given.
- `--set scene.rocks.count=5` overrides a key from the command line. A family overrides any key of the five sections.
- A dotted key ending in a name such as `slam.fastslam` is one choice among several: give one of them.
"""


LAWS = """\
A value is drawn at an address of its own: seed, scene, key, and the object where the key is drawn per object. Another law at one key, or
other parameters of it, moves no other value. Laws that a sampler draws by rejection (gamma, beta, PERT, Poisson) take as many random
numbers as they need from a stream that belongs to that address alone. The same config gives the same bits on every machine.

Laws with an unbounded tail (normal, gamma, Weibull) name the window that they are cut to, `min` and `max`; Poisson may. A draw is then
one of the whole law, given that it lies in the window: nothing heaps up at the ends, and the mean moves with what is cut off. The window
of a gamma, Weibull or Poisson law must hold a thousandth of it, that of a normal law reach to 8 sd from its mean. Where a key wants a
whole number, draws are rounded; a uniform law gives each whole number between its bounds the same chance.
"""

WHICH = """\
Which law for what:

- **Nothing but a range is known**: `uniform`; `log_uniform` where it spans a decade or more, as sizes do.
- **Low, likely and high value from an expert**: `pert`; `triangular` where the ends should be met more often, or the mode is an end.
- **Sizes of rocks, whose large ones thin out**: `weibull`, after Rosin and Rammler's law of fragments: shape 1 to 2, scale near the size of
  most. Mars by its own counts: `scene.rocks.golombek`.
- **Positive values with a long tail** (extinctions of bushes and crowns, standard deviations of instruments and noise): `gamma`, of mean
  shape x scale and relative spread 1 / sqrt(shape).
- **Shares between two known ends** (reflectances, rates of dropout, abundances): `beta`, with alpha / (alpha + beta) as the mean's place
  between the ends; larger alpha + beta, less spread.
- **How many things stand in a yard, each placed by itself**: `poisson` with the mean number; `uniform` where the number itself should
  vary from scene to scene more than chance would have it, as for training.
- **An error around a known value**: `normal`. **One of a few**: `choice`, `weighted`.
"""


class Reference:
    """The rows of one schema."""

    def __init__(self, name):
        self.schema = json.loads((ROOT / "schemas" / name).read_text())
        self.defs = self.schema.get("$defs", {})

    def target(self, node):
        """The node behind references and an optional `null`, with whether it may be absent."""
        optional = False
        while True:
            if "$ref" in node:
                node = self.defs[node["$ref"].rsplit("/", 1)[1]]
            elif "anyOf" in node and any(part.get("type") == "null" for part in node["anyOf"]):
                optional = True
                (node,) = [part for part in node["anyOf"] if part.get("type") != "null"]
            else:
                return node, optional

    def is_law(self, node):
        return any(part.get("$ref", "").endswith("/Law") for part in node.get("anyOf", []))

    def kind(self, node):
        """The values that a node takes, in words."""
        node, _ = self.target(node)
        if self.is_law(node):
            return "number or law"
        if "const" in node:
            return f"`{node['const']}`"
        if "enum" in node:
            return ", ".join(f"`{value}`" for value in node["enum"])
        if "oneOf" in node or "anyOf" in node:
            parts = node.get("oneOf") or node.get("anyOf")
            return ", ".join(dict.fromkeys(filter(None, map(self.choice, parts))))
        if node.get("type") == "array":
            return "list of " + (self.kind(node["items"]) if isinstance(node.get("items"), dict) else "values")
        if "properties" in node:
            return "section"
        kind = node.get("type", "value")
        if isinstance(kind, list):
            kind = next(each for each in kind if each != "null")
        return {"integer": "whole number", "boolean": "true, false", "string": "text"}.get(kind, str(kind))

    def choice(self, part):
        """One of several forms of a value."""
        node, _ = self.target(part)
        if "enum" in node or "const" in node:
            return self.kind(node)
        if node.get("type") == "object" and len(node.get("required", [])) == 1 and len(node.get("properties", {})) == 1:
            (key,) = node["required"]
            return f"`{{{key}: ...}}`"
        return "section" if "properties" in node else self.kind(node)

    def rows(self, node, path=""):
        """(key, values, default, range, meaning) of a section's keys, depth first."""
        node, _ = self.target(node)
        required = node.get("required", [])
        for key, child in node.get("properties", {}).items():
            name = f"{path}.{key}" if path else key
            target, optional = self.target(child)
            yield name, self.kind(child), self.default(child, optional), self.range(child, target), key in required, words(child, target)
            if not self.is_law(target):
                yield from self.below(target, name)

    def below(self, node, path):
        """The keys inside a value: of a section, of each choice, of a list's entries."""
        if "properties" in node:
            yield from self.rows(node, path)
        elif node.get("type") == "array" and isinstance(node.get("items"), dict):
            inner, _ = self.target(node["items"])
            if not self.is_law(inner):
                yield from self.below(inner, path + "[]")
        for part in node.get("oneOf", []) + node.get("anyOf", []):
            inner, _ = self.target(part)
            if "properties" in inner:
                # The one key of a choice means what is said of the choice.
                said = {"description": inner.get("description", "")} if len(inner["properties"]) == 1 else {}
                keys = {key: said | child for key, child in inner["properties"].items()}
                yield from self.rows({"properties": keys}, path)

    def default(self, node, optional):
        if "default" not in node or node["default"] is None:
            return "absent" if optional or ("default" in node and node["default"] is None) else ""
        text = json.dumps(node["default"]).replace('"', "")
        return f"`{text}`" if len(text) < 80 else "see below"

    def range(self, *nodes):
        for node in nodes:
            if "minimum" in node or "maximum" in node:
                low, high = node.get("minimum"), node.get("maximum")
                return f"{number(low)} to {number(high)}" if high is not None else f"{number(low)} or more"
        return ""

    def laws(self):
        """(law, its parameters, meaning) in the order of the schema."""
        for part in self.defs["Law"]["oneOf"]:
            ((name, content),) = part["properties"].items()
            if content["type"] == "object":
                required = content["required"]
                form = "{" + name + ": {" + ", ".join(f"{key}: ..." for key in required) + "}}"
                yield form, "; ".join(filter(None, (self.parameter(key, node, key in required) for key, node in content["properties"].items()))), words(part)
            else:
                entry = {"uniform": "[low, high]", "log_uniform": "[low, high]", "choice": "[a, b, ...]", "weighted": "[[weight, a], ...]"}[name]
                yield "{" + name + ": " + entry + "}", "", words(part)

    def parameter(self, key, node, required):
        """What there is to say of a law's parameter: its range, and its default."""
        said = [self.range(node)] if self.range(node) else []
        if not required:
            said.append("default " + self.default(node, True).strip("`"))
        return f"{key} {', '.join(said)}" if said else ""


def number(value):
    return "-" if value is None else f"{value:.15g}"


def words(child, target=None):
    """What a key means; for a law, which is described once, only what is its own."""
    inner = {} if target is None or any(part.get("$ref", "").endswith("/Law") for part in target.get("anyOf", [])) else target
    text = child.get("description") or inner.get("description", "")
    return " ".join(text.split()).replace("|", "\\|")


def table(rows):
    yield "| key | values | range | default | meaning |"
    yield "|---|---|---|---|---|"
    for name, kind, default, bounds, required, meaning in rows:
        key = f"**`{name}`**" if required else f"`{name}`"
        yield f"| {key} | {kind} | {bounds} | {default} | {meaning} |"


def page():
    corpus, train = Reference("corpus.schema.json"), Reference("train.schema.json")
    top = {key: node for key, node in corpus.schema["properties"].items() if key not in [*SECTIONS, "families"]}
    lines = [HEAD, "## The corpus", ""]
    head = {"properties": top, "required": corpus.schema.get("required", [])}
    lines += table(corpus.rows(head))
    lines += ["", "`families`, a list, mixes kinds of yard, rover and sensor: each scene is of one of them, drawn by weight. There are at most 1000. A family has `name`, `weight`, `hold_out` and any key of the sections below, which it overrides."]
    lines += ["", "## Laws", "", LAWS, "| law | parameters | draws |", "|---|---|---|"]
    lines += [f"| `{form}` | {limits} | {meaning} |" for form, limits, meaning in corpus.laws()]
    lines += ["", WHICH.rstrip()]
    for section in SECTIONS:
        node, _ = corpus.target(corpus.schema["properties"][section])
        lines += ["", f"## `{section}`", "", words(node), ""]
        presets = ("sweep.sensor.", "drive.rover.")
        lines += table(row for row in corpus.below(node, section) if not row[0].startswith(presets))
    for title, name, example in (("A sensor", "Sensor", "sensors"), ("A rover", "Rover", "rovers")):
        node = corpus.defs[name]
        lines += ["", f"## {title}: a file like those in `configs/{example}`", "", words(node), "", *table(corpus.rows(node))]
    lines += ["", "## Training: `marsyard train --config FILE`", "", words(train.schema), "", *table(train.rows(train.schema))]
    return "\n".join(lines) + "\n"


def main():
    text = page()
    if sys.argv[1:] == ["--check"]:
        if not PAGE.is_file() or PAGE.read_text() != text:
            sys.exit(f"{PAGE.relative_to(ROOT)} is not what the schemas say: python scripts/config_reference.py writes it anew")
        print(f"{PAGE.relative_to(ROOT)} is what the schemas say")
    elif sys.argv[1:]:
        sys.exit(__doc__)
    else:
        PAGE.write_text(text)


if __name__ == "__main__":
    main()
