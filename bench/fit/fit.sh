#!/usr/bin/env bash
# Every combination of up to 6 of 22 places, nine tests left out in turn, compared with numpy solving the
# same normal equations in batches; one thread each, one after the other.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
"$THERMOCOMP_BENCH_BUILD/bin/bench_fit" "$out/rows" > "$out/answers"
export OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1
/usr/bin/python3 "$here/fit.py" "$out/rows" "$out/answers"
