#!/bin/sh
# Fifty uplinks into a PostgreSQL of its own: rows a second of one core, bytes a row; then one uplink beside a
# daemon at 100 Hz: its share of a core, its memory, and the cycle's lateness with it over that without it, in turns
# (the daemon alone, with the uplink, alone again). ROUNDS and SECONDS_EACH in the environment change their number
# and length. Needs SCHED_FIFO (root).
set -eu
export THERMOCOMP_BIN="$THERMOCOMP_BENCH_BUILD/bin"
exec /usr/bin/python3 "$(dirname "$0")/fleet.py"
