#!/bin/sh
# What libmodbus does on Modbus TCP where a module answers late, and what our connection does there.
# Five seconds. What is compared with what: the head of bench/modbus/libmodbus_tcp.cpp.
set -eu
exec "$THERMOCOMP_BENCH_BUILD/bin/bench_libmodbus_tcp" "$@"
