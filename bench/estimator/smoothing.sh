#!/bin/sh
# Effect of smoothing on spikes planted in measured temperatures; docs/measurements.md explains the table.
set -eu
exec "$THERMOCOMP_BENCH_BUILD/bin/bench_smoothing" "$THERMOCOMP_DATA/spindle_46h"
