#!/bin/sh
# Searching a day of 64 channels for everything that a model may lack: `thermocomp diagnose` (one
# thread; files, test rows and JSON included) beside the same searches batched in numpy (one thread,
# the same included). It fails where they do not come to the same numbers. Medians of processor time
# of five runs, taken in turn.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
exec /usr/bin/python3 "$here/diagnose.py" "$THERMOCOMP_BENCH_BUILD/bin/thermocomp-modelling"
