#!/bin/sh
# Effect of a thousand clients of the status socket on the cycle: lateness at 1 kHz without clients and with
# 1000 clients (subscribers, pollers, readers that never read, half requests) and a storm of connections,
# each with a new daemon, one after the other; the median over the pairs. Also the answer time of another
# client and the daemon's memory. About 3 minutes; PAIRS and SECONDS_EACH in the environment change that.
# Needs SCHED_FIFO (root).
set -eu
exec /usr/bin/python3 "$(dirname "$0")/socket_load.py" \
  --bin "$THERMOCOMP_BENCH_BUILD/bin" --pairs "${PAIRS:-7}" --seconds "${SECONDS_EACH:-10}"
