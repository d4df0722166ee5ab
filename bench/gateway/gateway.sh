#!/bin/sh
# Cost of the gateway next to a running daemon, with five pages open: memory, processor, bytes of the page,
# its first paint if chromium is installed, and the time for a month of history at 900 points.
set -eu
export THERMOCOMP_BIN="$THERMOCOMP_BENCH_BUILD/bin"
exec /usr/bin/python3 "$(dirname "$0")/gateway.py" --seconds "${SECONDS_EACH:-30}"
