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

# A network of every form that a file may hold: the default, of both neurons by the squared error, one of rectified ones, on columns alone, and the Kalman filter's.
exported() {
  local name=$1
  shift
  "$marsyard" train "$corpus" "$@" --set epochs=1 --out "$scratch/$name" > /dev/null
  "$marsyard" export "$scratch/$name" --onnx "$scratch/$name.onnx" --json "$scratch/$name.json"
  "$python" "$here/../check_onnx.py" "$scratch/$name.onnx" "$scratch/$name.json" --tolerance 1e-6
}
exported run
exported squared --set network.activation=both --set filter.kronecker.loss=squared
exported rectified --set network.activation=relu --set network.members=1
exported columns --set network.normal_scores=false
exported kalman --config "$here/../../configs/train/ekf.yaml"
"$python" "$here/check_clouds.py" "$marsyard" "$scratch/run/model.safetensors"
"$python" "$here/../scale_out/check_kubernetes.py" "$marsyard"
"$python" "$here/../store/check_store.py" "$stores"
