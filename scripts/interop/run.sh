#!/usr/bin/env bash
# Outside programs against a finished corpus, against a small one with the points table, against a model trained on the first
# (ONNX), against classified clouds, and against an object store (a server on loopback) with faults; the Kubernetes manifests
# against their schema.
#
#   scripts/interop/run.sh PYTHON MARSYARD CORPUS STORES
#
# PYTHON has scripts/interop/requirements.txt installed; STORES is a marsyard built with --features object-stores.
set -euo pipefail
python=$1 marsyard=$2 corpus=$3 stores=$4
here=$(dirname "$0")
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

"$python" "$here/check_corpus.py" "$corpus" --croissant
"$marsyard" generate "$here/points.yaml" --out "$scratch/points"
"$python" "$here/check_corpus.py" "$scratch/points" --datasets --croissant
"$python" "$here/../read_corpus.py" "$corpus" > /dev/null
"$python" "$here/check_readme.py" "$here/../../README.md" "$here/../../docs/columns.md" "$corpus"

"$marsyard" train "$corpus" --set epochs=1 --out "$scratch/run" > /dev/null
"$marsyard" export "$scratch/run" --onnx "$scratch/model.onnx" --json "$scratch/model.json"
"$python" "$here/../check_onnx.py" "$scratch/model.onnx" "$scratch/model.json" --tolerance 1e-6
"$marsyard" train "$corpus" --set epochs=1 --set network.activation=both --set filter.kronecker.loss=squared --out "$scratch/squared" > /dev/null
"$marsyard" export "$scratch/squared" --onnx "$scratch/squared.onnx" --json "$scratch/squared.json"
"$python" "$here/../check_onnx.py" "$scratch/squared.onnx" "$scratch/squared.json" --tolerance 1e-6
"$python" "$here/check_clouds.py" "$marsyard" "$scratch/run/model.safetensors"
"$python" "$here/../scale_out/check_kubernetes.py" "$marsyard"
"$python" "$here/../store/check_store.py" "$stores"
