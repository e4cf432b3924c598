#!/usr/bin/env bash
#SBATCH --job-name=playbot
#SBATCH --cpus-per-task=4
#SBATCH --mem=4G
#SBATCH --time=02:00:00
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output=playbot-%A_%a.log
#
# Tests levels as an array of Slurm jobs, a shard each, and joins them in a job that waits for all:
#
#   GAME=coinrun LEVELS=hard:0..99999 TEST="--bot search" SHARDS=16 OUT=runs/test bash slurm.sh
#
# Call it on the login node, without sbatch, in a folder that all nodes see. It calls sbatch twice with itself: for the shards,
# and for the job that joins them, whose exit code is that of `playbot report merge`: 1 if there are findings. A task that is
# preempted or whose node fails is queued again and goes on with the levels that are not finished; after a time limit, the same
# call goes on, too.
set -euo pipefail

PLAYBOT=${PLAYBOT:-playbot}
GAME=${GAME:-coinrun}
LEVELS=${LEVELS:-hard:0..9999}
# The testers, and all else that `playbot test` understands. Words are split at blanks.
TEST=${TEST:---bot search}
SHARDS=${SHARDS:-16}
OUT=${OUT:-runs/test}
# Earlier results to compare with, if any.
AGAINST=${AGAINST:-}
export PLAYBOT GAME LEVELS TEST SHARDS OUT AGAINST

if [ -n "${SLURM_ARRAY_TASK_ID:-}" ]; then
    # A shard.
    code=0
    # shellcheck disable=SC2086
    "$PLAYBOT" test "$GAME" --levels "$LEVELS" $TEST --shard "$SLURM_ARRAY_TASK_ID/$SHARDS" \
        --threads "${SLURM_CPUS_PER_TASK:-1}" --resume --out "$OUT/shards/$SLURM_ARRAY_TASK_ID" >/dev/null || code=$?
    # Findings are no failure of a shard: the job that joins them reports all.
    if [ "$code" -eq 1 ]; then exit 0; fi
    exit "$code"
elif [ -n "${SLURM_JOB_ID:-}" ]; then
    shards=()
    for ((index = 0; index < SHARDS; index++)); do shards+=("$OUT/shards/$index"); done
    "$PLAYBOT" report merge --force "${shards[@]}" ${AGAINST:+--against "$AGAINST"} --out "$OUT"
else
    if [ -e "$OUT/results.json" ] && ! [ -e "$OUT/shards" ]; then
        echo "$OUT has results of another test: choose another OUT" >&2
        exit 3
    fi
    mkdir -p "$OUT"
    array=$(sbatch --parsable --array="0-$((SHARDS - 1))" "$0")
    # With several clusters, the answer is `job;cluster`.
    merge=$(sbatch --parsable --dependency="afterok:${array%%;*}" --kill-on-invalid-dep=yes --output=playbot-%j.log "$0")
    echo "shards: job ${array%%;*}, joined in $OUT by job ${merge%%;*}"
fi
