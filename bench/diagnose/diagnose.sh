#!/bin/sh
# Processor time of `thermocomp diagnose` (one thread): a day of 64 channels and, if the data exist, 32
# hours of a measured spindle with 16 temperatures and 5 outputs, each with its limit. Medians of five runs.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
exec /usr/bin/python3 "$here/time.py" "$THERMOCOMP_BENCH_BUILD/bin/thermocomp-modelling"
