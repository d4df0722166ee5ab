#!/bin/sh
# Memory and processor time of the daemon at 100 Hz with 16 sensors read once a second over Modbus TCP,
# compared with a minimal libmodbus poller with a 100 Hz timer and the same registers, during the same 60
# seconds. Needs SCHED_FIFO and locked memory (root).
set -eu
exec /usr/bin/python3 "$(dirname "$0")/footprint.py" \
  --bin "$THERMOCOMP_BENCH_BUILD/bin" --seconds "${SECONDS_EACH:-60}"
