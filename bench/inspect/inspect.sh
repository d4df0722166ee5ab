#!/bin/sh
# Faults of readings planted into measured recordings: what `thermocomp inspect` finds of them, what
# it names besides, what it names on recordings that were left as they are, and how long it takes.
# Needs THERMOCOMP_DATA.
set -eu
exec python3 "$(dirname "$0")/inspect_runs.py" "$@"
