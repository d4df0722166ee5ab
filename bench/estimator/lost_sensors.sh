#!/bin/sh
# The offset's error when sensors are lost, estimated and held; docs/measurements.md has the
# table. The data: $THERMOCOMP_DATA, else shared/data beside the source.
set -eu
source_dir=$(cd "$(dirname "$0")/../.." && pwd)
exec "$THERMOCOMP_BENCH_BUILD/bin/bench_lost_sensors" \
  "${THERMOCOMP_DATA:-$source_dir/../shared/data}/spindle_46h"
