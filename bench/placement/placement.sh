#!/bin/sh
# Placement of sensors, method by method, on three machines: the demonstration's, a portal milling machine
# and a lathe. RMS error of the estimated displacement over the load cases used for the placement, and over
# one left out; docs/measurements.md has the table.
set -eu
source_dir=$(cd "$(dirname "$0")/../.." && pwd)
exec /usr/bin/python3 "$source_dir/bench/placement/placement.py" "$THERMOCOMP_BENCH_BUILD/bin/thermocomp" \
  "demo=$source_dir/config/demo/structure.toml" \
  "portal=$source_dir/bench/placement/portal.toml" \
  "lathe=$source_dir/bench/placement/lathe.toml"
