#!/bin/sh
# The offset's error with lost sensors, estimated or held; docs/measurements.md has the table.
set -eu
exec "$THERMOCOMP_BENCH_BUILD/bin/bench_lost_sensors" "$THERMOCOMP_DATA/spindle_46h"
