#!/bin/sh
# Probing when due, compared with hourly probing, and predicted warm-up times, compared with the true ones.
set -eu
exec /usr/bin/python3 "$(dirname "$0")/when_to_probe.py" "$THERMOCOMP_BENCH_BUILD/bin"
