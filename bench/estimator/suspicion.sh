#!/bin/sh
# Plausible sensor errors: share found, delay, and false suspicions; docs/measurements.md has the table.
set -eu
exec "$THERMOCOMP_BENCH_BUILD/bin/bench_suspicion" "$THERMOCOMP_DATA"
