#!/bin/sh
# Wake-up latency of the daemon's cycle at 1 kHz, compared with cyclictest of the same priority. Each pair
# consists of the daemon, cyclictest, and cyclictest again; ratios are taken within a pair, and the median
# over the pairs is reported. The ratio of the two cyclictests shows the uncertainty. About 15 minutes;
# PAIRS and SECONDS in the environment change that. Needs SCHED_FIFO (root).
set -eu
exec /usr/bin/python3 "$(dirname "$0")/jitter.py" \
  --bin "$THERMOCOMP_BENCH_BUILD/bin" --pairs "${PAIRS:-10}" --seconds "${SECONDS_EACH:-30}"
