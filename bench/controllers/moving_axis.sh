#!/usr/bin/env bash
# A moving axis: a number each 20 ms, a line, a table. What is measured: bench/controllers/moving_axis.cpp.
set -euo pipefail
exec "$THERMOCOMP_BENCH_BUILD/bin/bench_moving_axis"
