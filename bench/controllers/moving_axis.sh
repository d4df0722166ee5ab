#!/usr/bin/env bash
# A moving axis: an offset every 20 ms, a line, a table. Described in bench/controllers/moving_axis.cpp.
set -euo pipefail
exec "$THERMOCOMP_BENCH_BUILD/bin/bench_moving_axis"
