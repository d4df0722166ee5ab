#!/bin/sh
# Faults of readings planted into measured recordings: findings of `thermocomp inspect`, false findings,
# findings on unchanged recordings, and duration. Needs THERMOCOMP_DATA.
set -eu
exec python3 "$(dirname "$0")/inspect_runs.py" "$@"
