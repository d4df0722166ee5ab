#!/bin/sh
# Sensors that lie plausibly: the share that is found, when, and what is suspected wrongly;
# docs/measurements.md has the table. The data: $THERMOCOMP_DATA, else shared/data beside the source.
set -eu
source_dir=$(cd "$(dirname "$0")/.." && pwd)
exec "$THERMOCOMP_BENCH_BUILD/bin/bench_suspicion" "${THERMOCOMP_DATA:-$source_dir/../shared/data}"
