#!/bin/sh
# A full CAN bus received and decoded by our source beside candump: on this kernel where it has CAN,
# else in a guest (User Mode Linux, whose processor times count in ticks of 10 ms). A minute and a
# half. What is compared with what: the head of bench/can/can_ingest.cpp.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
exec "$here/../../tests/vm/run_with_can.sh" --timeout 900 \
  "$THERMOCOMP_BENCH_BUILD/bin/bench_can_ingest" "$@"
