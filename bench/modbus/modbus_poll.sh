#!/bin/sh
# Modbus polling: our source compared with a bare libmodbus loop, and working units next to dead ones. About
# two minutes and a quarter. Described in bench/modbus/modbus_poll.cpp.
set -eu
exec "$THERMOCOMP_BENCH_BUILD/bin/bench_modbus_poll" "$@"
