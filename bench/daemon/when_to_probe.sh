#!/bin/sh
# When to probe beside hourly probing over a simulated month, and when a machine is warm beside the truth.
set -eu
exec /usr/bin/python3 "$(dirname "$0")/when_to_probe.py" "$THERMOCOMP_BENCH_BUILD/bin"
