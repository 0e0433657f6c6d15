"""The Kubernetes manifests without a cluster: valid by the schema and by the rules between fields, and their commands, index by index,
build the corpus that one process builds.

Usage:  python scripts/scale_out/check_kubernetes.py MARSYARD [--json FILE]     (pip install kubernetes-validate PyYAML)

What a cluster adds (pods, retries, secrets) is not run here.
"""

import argparse
import copy
import importlib.metadata
import json
import pathlib
import re
import subprocess
import sys
import tempfile

import kubernetes_validate
import yaml
import yard
from yard import SHARDS, check, corpus_id

JOB, FINALIZE = yard.ROOT / "scripts/kubernetes_job.yaml", yard.ROOT / "scripts/kubernetes_finalize.yaml"
#: The oldest that has retries by index as a stable feature, and the newest that the schemas cover.
VERSIONS = ("1.33", str(kubernetes_validate.latest_version()))
PLACE = "s3://bucket/corpus"


def refused(manifest, version):
    try:
        kubernetes_validate.validate(manifest, version, strict=True)
    except kubernetes_validate.ValidationError as error:
        return str(error)
    return None


def check_schema(name, manifest):
    for version in VERSIONS:
        why = refused(manifest, version)
        check(why is None, f"{name} is valid for Kubernetes {version}", why)
        misspelt = copy.deepcopy(manifest)
        misspelt["spec"]["podFailurePolicies"] = misspelt["spec"].pop("podFailurePolicy")
        check(refused(misspelt, version) is not None, f"a misspelt key would be refused ({version})")


def exit_codes(spec, action):
    rules = [rule["onExitCodes"] for rule in spec["podFailurePolicy"]["rules"] if rule["action"] == action]
    return {code for rule in rules if rule["operator"] == "In" for code in rule["values"]}


def check_rules(job, finalize):
    """What the API server checks beyond the schema, and what exit codes mean to marsyard."""
    for manifest in (job, finalize):
        pod = manifest["spec"]["template"]["spec"]
        names = {container["name"] for container in pod["containers"]}
        rules = [rule["onExitCodes"] for rule in manifest["spec"]["podFailurePolicy"]["rules"] if "onExitCodes" in rule]
        named = {rule["containerName"] for rule in rules}
        check(pod["restartPolicy"] == "Never", "a podFailurePolicy needs restartPolicy Never")
        check(named <= names, "the policy names containers that are there")
    spec = job["spec"]
    check(spec["completionMode"] == "Indexed" and "backoffLimitPerIndex" in spec, "FailIndex and retries by index need Indexed")
    check(0 <= spec["maxFailedIndexes"] <= spec["completions"], "maxFailedIndexes lies within completions")
    check(exit_codes(spec, "FailIndex") == {1, 2}, "exit 1 and 2 are not tried again, 75 is")
    check(exit_codes(finalize["spec"], "FailJob") == {1, 2}, "nor is a finalize that was refused")


def command_of(manifest, place, environment):
    """The container's words as the kubelet expands them; the place is another one here."""
    container = manifest["spec"]["template"]["spec"]["containers"][0]
    words = [str(word) for word in container["command"] + container["args"]]
    words = [re.sub(r"\$\((\w+)\)", lambda match: environment[match[1]], word) for word in words]
    if words[0] != "marsyard" or words.count(PLACE) != 1:
        sys.exit(f"FAILED: {' '.join(words)} is no command of marsyard on {PLACE}")
    return [str(place) if word == PLACE else word for word in words[1:]]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("marsyard", type=lambda path: str(pathlib.Path(path).resolve()))
    parser.add_argument("--json", type=pathlib.Path)
    args = parser.parse_args()
    job, finalize = yaml.safe_load(JOB.read_text()), yaml.safe_load(FINALIZE.read_text())
    check_schema(JOB.name, job)
    check_schema(FINALIZE.name, finalize)
    check_rules(job, finalize)
    with tempfile.TemporaryDirectory() as scratch:
        scratch = pathlib.Path(scratch)
        expected, place = yard.one_process(args.marsyard, scratch / "one-process"), scratch / "indexed"
        plan = ["generate", yard.CONFIG, "--out", place, "--plan-only", *yard.SETS]
        subprocess.run([args.marsyard, *plan], check=True)
        # Pods start in no particular order.
        for index in sorted(range(job["spec"]["completions"]), key=lambda index: index * 7 % 16):
            words = command_of(job, place, {"JOB_COMPLETION_INDEX": str(index)})
            subprocess.run([args.marsyard, *words], check=True, capture_output=True)
        done = subprocess.run([args.marsyard, *command_of(finalize, place, {})], capture_output=True, text=True)
        check(done.returncode == 0 and corpus_id(done.stderr) == expected, "corpus_id is that of one process", done.stderr)
    if args.json:
        version = importlib.metadata.version("kubernetes-validate")
        engine = f"Kubernetes {' and '.join(VERSIONS)}, by kubernetes-validate {version}; no cluster"
        what = f"manifests valid; the commands of {job['spec']['completions']} indexes, run one by one"
        facts = {"engine": engine, "corpus_id": expected, "shards": SHARDS, "cases": [{"what": what, "corpus_id": expected}]}
        args.json.write_text(json.dumps(facts, indent=1) + "\n")


if __name__ == "__main__":
    main()
