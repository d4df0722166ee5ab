#!/bin/sh
# Searching a day of 64 channels for everything that a model may lack: `thermocomp diagnose` (one
# thread, files, report on left-out rows and test rows included) beside the same searches batched in
# numpy (one thread); where they do not come to the same numbers, that is said. Medians of five runs,
# taken in turn.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
exec /usr/bin/python3 "$here/diagnose.py" "$THERMOCOMP_BENCH_BUILD/bin/thermocomp-modelling"
