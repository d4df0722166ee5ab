#!/bin/sh
# What a user waits for `thermocomp diagnose` (one thread): a day of 64 channels and, where the data
# are, 32 hours of a measured spindle with 16 temperatures and 5 outputs, each beside the time that
# it may take. Medians of processor time of five runs.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
exec /usr/bin/python3 "$here/time.py" "$THERMOCOMP_BENCH_BUILD/bin/thermocomp-modelling"
