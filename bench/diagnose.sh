#!/bin/sh
# Searching a day of 64 channels for everything that a model may lack: `thermocomp diagnose` (one
# thread; files, test rows and JSON included) beside the same searches batched in numpy (one thread,
# the same included). `numpy` is the plain way: matrices of the columns of many subjects and grid
# points, recursions as a loop over rows. `numpy_tuned` cuts recursions into stretches of evenly
# spaced rows that advance together, whitens by products with matrices and makes the first search
# with and without errors of the coefficients at once. It fails where the three do not come to the
# same numbers. Medians of processor time of five runs, taken in turn.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
exec /usr/bin/python3 "$here/diagnose.py" "$THERMOCOMP_BENCH_BUILD/bin/thermocomp-modelling"
