#!/usr/bin/env bash
#SBATCH --job-name=playbot-train
#SBATCH --nodes=4
#SBATCH --ntasks-per-node=1
#SBATCH --cpus-per-task=16
#SBATCH --time=04:00:00
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output=playbot-train-%j.log
#
# Trains on all nodes of a Slurm job: Ray runs on each, the first node learns, and each processor plays.
#
#   GAME=coinrun RUN=runs/many TRAIN="--algorithm ppo --set arenas=512" sbatch slurm-train.sh
#
# Program, Python with `playbot[ray]`, and RUN lie in folders that all nodes see under the same paths. A job that is preempted is queued
# again and goes on from its last checkpoint, as the same call does after a time limit.
set -euo pipefail

PLAYBOT=${PLAYBOT:-playbot}
PYTHON=${PLAYBOT_PYTHON:-python3}
GAME=${GAME:-coinrun}
RUN=${RUN:-runs/many}
# All else that `playbot train` understands. Words are split at blanks.
TRAIN=${TRAIN:---algorithm ppo}
PORT=${PORT:-6379}
export PLAYBOT_PYTHON=$PYTHON RAY_USAGE_STATS_ENABLED=0
# Others on these nodes cannot reach the cluster without it.
RAY_AUTH_MODE=token
RAY_AUTH_TOKEN=${RAY_AUTH_TOKEN:-$("$PYTHON" -c 'import secrets; print(secrets.token_hex(32))')}
export RAY_AUTH_MODE RAY_AUTH_TOKEN

on=(srun --nodes=1 --ntasks=1)

mapfile -t nodes < <(scontrol show hostnames "$SLURM_JOB_NODELIST")
head=$("${on[@]}" --nodelist="${nodes[0]}" hostname --ip-address)
# Some nodes have several addresses.
head=${head%% *}
trap 'kill $(jobs -p) 2>/dev/null; wait' EXIT

cpus=${SLURM_CPUS_PER_TASK:-1}
start=("$PYTHON" -m ray.scripts.scripts start --block --num-cpus="$cpus")
"${on[@]}" --nodelist="${nodes[0]}" "${start[@]}" --head --node-ip-address="$head" --port="$PORT" --include-dashboard=false &
for node in "${nodes[@]:1}"; do
    "${on[@]}" --nodelist="$node" "${start[@]}" --address="$head:$PORT" &
done

workers=$((cpus * ${#nodes[@]}))
ready="import ray, sys; ray.init(address='$head:$PORT', log_to_driver=False, logging_level='ERROR')
sys.exit(ray.cluster_resources().get('CPU', 0) < $workers)"
for ((try = 0; try < 60; try++)); do
    if "$PYTHON" -c "$ready" 2>/dev/null; then break; fi
    sleep 2
done

words=(--run "$RUN" --cluster "$head:$PORT" --workers "$workers")
if [ -e "$RUN/run.json" ]; then
    "$PLAYBOT" train "${words[@]}" --resume
else
    # shellcheck disable=SC2086
    "$PLAYBOT" train "$GAME" $TRAIN "${words[@]}"
fi
