#!/bin/sh
# Wake-up latency of the daemon's cycle at 1 kHz with and without a gateway and 50 open pages. Each round is
# the daemon alone, with the pages, and alone again, in alternating order; ratios are taken within a round,
# and their median is reported. The ratio of the two runs alone shows the uncertainty. The pages are read at
# the lowest priority, since real browsers are elsewhere. About 10 minutes; ROUNDS and SECONDS_EACH in the
# environment change that. Needs SCHED_FIFO (root).
set -eu
export THERMOCOMP_BIN="$THERMOCOMP_BENCH_BUILD/bin"
exec /usr/bin/python3 "$(dirname "$0")/gateway_cycle.py" --rounds "${ROUNDS:-9}" --seconds "${SECONDS_EACH:-20}"
