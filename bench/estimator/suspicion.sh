#!/bin/sh
# Sensors that lie plausibly: the share that is found, when, and what is suspected wrongly;
# docs/measurements.md has the table.
set -eu
exec "$THERMOCOMP_BENCH_BUILD/bin/bench_suspicion" "$THERMOCOMP_DATA"
