#!/bin/sh
# The offset's error when sensors are lost, estimated and held; docs/measurements.md has the
# table.
set -eu
exec "$THERMOCOMP_BENCH_BUILD/bin/bench_lost_sensors" "$THERMOCOMP_DATA/spindle_46h"
