#!/bin/sh
# Test RMS of `thermocomp diagnose`, of a static refit, ARX, LASSO with lags and sequential-threshold sparse
# regression, on the same machines with a hidden effect and the same splits. Takes some minutes.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
exec /usr/bin/python3 "$here/baselines.py" "$THERMOCOMP_BENCH_BUILD/bin/thermocomp-modelling"
