#!/bin/sh
# How late the daemon's cycle wakes up at 1 kHz with a gateway and 50 pages open beside neither: each round is
# the daemon alone, with the pages, and alone again, in turns that change; ratios are taken within a round and
# their median counts. Alone beside alone shows what a ratio is worth here. The pages are read at the lowest
# priority, as who reads them is elsewhere. About 10 minutes; ROUNDS and SECONDS_EACH in the environment change
# that. Needs SCHED_FIFO (root).
set -eu
export THERMOCOMP_BIN="$THERMOCOMP_BENCH_BUILD/bin"
exec /usr/bin/python3 "$(dirname "$0")/gateway_cycle.py" --rounds "${ROUNDS:-9}" --seconds "${SECONDS_EACH:-20}"
