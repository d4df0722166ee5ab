#!/bin/sh
# A real Prometheus scrapes the gateway for ten minutes and goes by the alert rules that are shipped, while a
# module is switched off and on again, and the daemon is killed and started: scrapes that failed, warnings of
# promtool, alerts that fired and ended, and how long after. SECONDS_ALL (600) changes how long.
set -eu
export THERMOCOMP_BIN="$THERMOCOMP_BENCH_BUILD/bin"
exec /usr/bin/python3 "$(dirname "$0")/prometheus.py" --seconds "${SECONDS_ALL:-600}"
