#!/bin/sh
# Fifty uplinks into a private PostgreSQL: rows per second and core, bytes per row; then one uplink beside a
# daemon at 100 Hz: its share of a core, its memory, and the ratio of the cycle's lateness with and without
# it, in turns (the daemon alone, with the uplink, alone again). ROUNDS and SECONDS_EACH in the environment
# change their number and length. Needs SCHED_FIFO (root).
set -eu
export THERMOCOMP_BIN="$THERMOCOMP_BENCH_BUILD/bin"
exec /usr/bin/python3 "$(dirname "$0")/fleet.py"
