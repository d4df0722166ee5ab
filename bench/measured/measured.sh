#!/usr/bin/env bash
# Measured machines: test RMS of usual fits (ridge, LASSO, boosting, ARX) and of `thermocomp fit`, on the
# splits of bench/measured/measured_data.py. The peers need python3-sklearn.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
if ! /usr/bin/python3 -c 'import sklearn' 2> /dev/null; then
  echo "measured: python3-sklearn is missing (scripts/packages.sh, packages_bench)" >&2
  exit 77
fi
/usr/bin/python3 "$here/measured.py" "$THERMOCOMP_BENCH_BUILD/bin/thermocomp"
