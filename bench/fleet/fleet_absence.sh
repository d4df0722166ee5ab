#!/bin/sh
# An uplink absent for three months (DAYS in the environment) sends a history of one cycle per second into a
# private PostgreSQL: rows lost, doubled, or different from `thermocomp export`; time and memory.
set -eu
export THERMOCOMP_BIN="$THERMOCOMP_BENCH_BUILD/bin"
exec /usr/bin/python3 "$(dirname "$0")/fleet_absence.py"
