#!/bin/sh
# Frames per second of the page of a body, in software rendering.
set -eu
exec /usr/bin/python3 "$(dirname "$0")/body_frames.py" "$THERMOCOMP_BENCH_BUILD/bin"
