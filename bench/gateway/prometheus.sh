#!/bin/sh
# A real Prometheus scrapes the gateway for ten minutes with the shipped alert rules, while a module is
# switched off and on again, and the daemon is killed and started: failed scrapes, warnings of promtool,
# alerts that fired and ended, and their delays. SECONDS_ALL (600) changes the duration.
set -eu
export THERMOCOMP_BIN="$THERMOCOMP_BENCH_BUILD/bin"
exec /usr/bin/python3 "$(dirname "$0")/prometheus.py" --seconds "${SECONDS_ALL:-600}"
