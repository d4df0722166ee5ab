#!/usr/bin/env bash
# Sizes of all-pairs plans compared with another generator's; docs/measurements.md has the table.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
if ! /usr/bin/python3 -c 'import allpairspy' 2> /dev/null; then
  echo "bench/plan/plan.sh: the generator to compare with is missing: scripts/setup.sh test" >&2
  exit 2
fi
"$THERMOCOMP_BENCH_BUILD/bin/bench_plan" | /usr/bin/python3 "$here/plan.py"
