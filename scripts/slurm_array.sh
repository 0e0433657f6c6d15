#!/usr/bin/env bash
# Builds one corpus as a Slurm job array; the same bytes as one process makes.
#
#   bash scripts/slurm_array.sh CONFIG PLACE PARTS [OPTIONS OF SBATCH ...]
#   bash scripts/slurm_array.sh configs/mixed.yaml /shared/corpora/mixed 64 --time=04:00:00 --cpus-per-task=4 --partition=cpu
#
# Run it on a login node. It lays the plan down in PLACE (a folder that all nodes see, or an object store's URL), submits an array
# of PARTS tasks, each of which builds every PARTS-th shard on the processors it is given, and a job that finalizes when all have ended.
# The same command again goes on: a task whose shards are there ends at once.
#
#   a node is lost, preemption      Slurm requeues the task (--requeue)
#   exit 75 (storage), time limit   the task requeues itself, RETRIES times (20); Slurm then waits some 2 minutes
#   exit 2 (config), exit 1         the task fails and stays failed; `finalize` then refuses the gap and names its shards
#
# MARSYARD is the program (default: the one on the PATH); it must lie at the same path on all nodes. Environment variables go along
# (sbatch --export=ALL), so credentials of an object store are best left in its standard files. PARTS beyond the site's MaxArraySize
# (often 1000) are refused by Slurm: give a task more shards.
set -euo pipefail

marsyard=${MARSYARD:-marsyard}

if [[ -z ${SLURM_ARRAY_TASK_ID:-} ]]; then
    if (($# < 3)); then
        sed -n '2,/^set /s/^# \{0,1\}//p' "$0" >&2
        exit 2
    fi
    config=$1 place=$2 parts=$3
    shift 3
    # A bad config ends here, before anything is submitted.
    "$marsyard" generate "$config" --out "$place" --plan-only
    # A minute before the time limit the batch shell is told, so that shards in hand are finished or discarded.
    array=$(sbatch --parsable --job-name=marsyard --requeue --signal=B:TERM@60 --open-mode=append "$@" \
        --array="0-$((parts - 1))" "$0" "$place" "$parts")
    # afterany, not afterok: where a task has failed, `finalize` says which shards are missing.
    final=$(sbatch --parsable --job-name=marsyard-finalize --dependency="afterany:${array%%;*}" "$@" \
        --wrap="'$marsyard' finalize '$place'")
    echo "array ${array%%;*}: $parts parts; job ${final%%;*} finalizes; how far it is: $marsyard status $place"
    exit 0
fi

place=$1 parts=$2
"$marsyard" generate "$place" --shards "$SLURM_ARRAY_TASK_ID/$parts" --threads "${SLURM_CPUS_PER_TASK:-1}" &
build=$!
# bash runs a trap only between commands, and `wait` is one that a signal ends.
trap 'kill -TERM "$build" 2>/dev/null' TERM
code=0
wait "$build" || code=$?
while kill -0 "$build" 2>/dev/null; do
    code=0
    wait "$build" || code=$?
done

# 143: told to end before it listened.
if (((code == 75 || code == 143) && ${SLURM_RESTART_COUNT:-0} < ${RETRIES:-20})); then
    echo "exit $code: requeued (${SLURM_RESTART_COUNT:-0} times before)" >&2
    scontrol requeue "${SLURM_ARRAY_JOB_ID}_${SLURM_ARRAY_TASK_ID}"
    # Slurm ends this script in a moment; it must not end by itself before, which would be a failure of the task.
    sleep 60
fi
exit "$code"
