#!/bin/sh
# An uplink that was away for three months (DAYS in the environment) sends a history of one cycle a second into a
# PostgreSQL of its own: rows lost, there twice, or with other values than `thermocomp export` gives; time and memory.
set -eu
export THERMOCOMP_BIN="$THERMOCOMP_BENCH_BUILD/bin"
exec /usr/bin/python3 "$(dirname "$0")/fleet_absence.py"
