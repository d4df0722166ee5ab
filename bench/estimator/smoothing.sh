#!/bin/sh
# What smoothing does to spikes planted in measured temperatures; docs/smoothing.md explains the
# table. The data: $THERMOCOMP_DATA, else shared/data beside the source.
set -eu
source_dir=$(cd "$(dirname "$0")/../.." && pwd)
exec "$THERMOCOMP_BENCH_BUILD/bin/bench_smoothing" \
  "${THERMOCOMP_DATA:-$source_dir/../shared/data}/spindle_46h"
