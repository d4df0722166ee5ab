#!/bin/sh
# Receives and decodes a full CAN bus with our source and with candump: on this kernel if it has CAN, else
# in a guest (User Mode Linux, with processor times in ticks of 10 ms). A minute and a half. The comparison
# is described in bench/can/can_ingest.cpp.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
exec "$here/../../tests/vm/run_with_can.sh" --timeout 900 \
  "$THERMOCOMP_BENCH_BUILD/bin/bench_can_ingest" "$@"
