#!/bin/sh
# Sizes of all-pairs plans; docs/experiments.md has what other generators need.
set -eu
exec "$THERMOCOMP_BENCH_BUILD/bin/bench_plan"
