#!/bin/sh
# How late the daemon's cycle wakes up at 1 kHz, beside cyclictest of the same priority: each pair
# is the daemon, cyclictest and cyclictest again, one after the other; ratios are taken within a
# pair and the median over the pairs counts. cyclictest against itself shows what a ratio is worth
# here. About 15 minutes; PAIRS and SECONDS in the environment change that. Needs SCHED_FIFO (root).
set -eu
exec /usr/bin/python3 "$(dirname "$0")/jitter.py" \
  --bin "$THERMOCOMP_BENCH_BUILD/bin" --pairs "${PAIRS:-10}" --seconds "${SECONDS_EACH:-30}"
