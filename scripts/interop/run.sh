#!/usr/bin/env bash
# Outside readers against a finished corpus, and against a small one with the points table.
#
#   scripts/interop/run.sh PYTHON MARSYARD CORPUS
#
# PYTHON has scripts/interop/requirements.txt installed.
set -euo pipefail
python=$1 marsyard=$2 corpus=$3
here=$(dirname "$0")
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

"$python" "$here/check_corpus.py" "$corpus" --croissant
"$marsyard" generate "$here/points.yaml" --out "$scratch/points"
"$python" "$here/check_corpus.py" "$scratch/points" --datasets --croissant
"$python" "$here/../read_corpus.py" "$corpus" > /dev/null
