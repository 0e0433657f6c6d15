#!/usr/bin/env bash
# The long form of the checks of hostile input; CI runs the short one (`cargo test --release --test hostile`).
#
#   scripts/hostile.sh [CASES]         default 20000 broken files a reader; results go to scripts/results/hostile.md
#
# Needs valgrind and, for the last step, cargo-deny (cargo install cargo-deny --locked) with a network for its advisories.
set -euo pipefail
cd "$(dirname "$0")/.."
cases=${1:-20000}
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
results=scripts/results/hostile.md
say() { printf '%s\n' "$*" | tee -a "$results"; }

: > "$results"
say "# Hostile input, the long form" ""
say "\`scripts/hostile.sh $cases\`, $(rustc --version), $(valgrind --version)." ""
say "| step | what | result |" "|---|---|---|"

step() { # name, what, command...: the command's last line is the result
    local name=$1 what=$2 started=$SECONDS
    shift 2
    if "$@" > "$scratch/log" 2>&1; then
        say "| $name | $what | $(grep -E "$wanted" "$scratch/log" | tail -n 1 | tr '|' '/') ($((SECONDS - started)) s) |"
    else
        say "| $name | $what | FAILED |"
        tail -n 40 "$scratch/log"
        exit 1
    fi
}

wanted="^test result"
step "broken files" "$cases a property test, memory counted" env PROPTEST_CASES="$cases" cargo test --release --locked --test hostile
step "broken configs" "$cases a property test" env PROPTEST_CASES="$cases" cargo test --release --locked --test config fuzz
step "broken models, checkpoints" "$cases a property test" env PROPTEST_CASES="$cases" cargo test --release --locked --lib -- train::model train::state cloud::lzf

# Memory errors of what is unsafe: a small corpus, a training, a classified scan. valgrind knows AVX2 and FMA, not AVX-512.
cargo build --release --locked
marsyard() {
    valgrind --quiet --suppressions=scripts/valgrind.supp --error-exitcode=99 --leak-check=no --log-file="$scratch/valgrind-%p" target/release/marsyard "$@" &&
        echo "no error"
}
wanted="no error"
config=tests/fixtures/training.yaml
step "valgrind, generate" "14 scenes, 2 threads" marsyard generate "$config" --out "$scratch/corpus" --threads 2
step "valgrind, train" "one epoch, 14 inputs, 6 neurons" marsyard train "$scratch/corpus" --set epochs=1 --set "network.hidden=[6]" --out "$scratch/run"
step "valgrind, preview" "one scene" marsyard preview "$scratch/corpus" --scene 0 --out "$scratch/preview"
cloud=$(find "$scratch/preview" -name '*.ply' | head -n 1)
step "valgrind, classify" "one scan" marsyard classify "$scratch/run/model.safetensors" "$cloud" --sensor-height 0.4 --out "$scratch/classified"

wanted="ok"
if cargo deny --version > "$scratch/deny" 2>&1; then
    step "cargo deny" "licences, bans, sources, advisories" cargo deny check
else
    step "dependencies" "licences and sources against deny.toml (cargo-deny is not installed)" python3 scripts/check_dependencies.py
fi
