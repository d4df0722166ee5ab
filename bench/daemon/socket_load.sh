#!/bin/sh
# What a thousand clients of the status socket do to the cycle: lateness at 1 kHz with nobody
# connected and with 1000 clients (subscribers, pollers, readers that never read, half requests) and
# a storm of connections, a fresh daemon for each, one after the other; the median over the pairs
# counts. Also the answer time of a polite client beside them and the daemon's memory. About 3
# minutes; PAIRS and SECONDS_EACH in the environment change that. Needs SCHED_FIFO (root).
set -eu
exec /usr/bin/python3 "$(dirname "$0")/socket_load.py" \
  --bin "$THERMOCOMP_BENCH_BUILD/bin" --pairs "${PAIRS:-7}" --seconds "${SECONDS_EACH:-10}"
