#!/usr/bin/env bash
# Runs the files of docs/how-to/many-machines on this machine: the steps of the workflow, the containers of the Jobs and the array
# of Slurm, and tests and trainings on real workers of Ray, some of which are killed half-way. All results are compared with
# those of one process. Takes about four minutes.
# Called with the program `playbot` and a folder for Python packages that stays between calls:
#   tests/many_machines/run.sh target/release/playbot target/python
set -euo pipefail
# Nothing is written beside the scripts.
export PYTHONDONTWRITEBYTECODE=1
playbot=$(realpath "$1")
mkdir -p "$2"
packages="$(realpath "$2")/ray"
cd "$(dirname "$0")/../.."
# It brings a reader of YAML along.
version=2.60.0

if ! [ -e "$packages/complete-client-$version" ]; then
    rm -rf "$packages"
    python3 -m venv "$packages"
    if ! "$packages/bin/pip" install --quiet --disable-pip-version-check "ray[client]==$version"; then
        echo "!! FAILED: ray $version cannot be installed from PyPI, so nothing was tested" >&2
        exit 1
    fi
    touch "$packages/complete-client-$version"
fi
"$packages/bin/python" tests/many_machines/files_run.py "$playbot"
# Workers of this machine alone need no messages and no secret.
export RAY_USAGE_STATS_ENABLED=0 RAY_AUTH_MODE=disabled
"$packages/bin/python" tests/many_machines/ray_run.py "$playbot"
"$packages/bin/python" tests/many_machines/train_run.py "$playbot"
