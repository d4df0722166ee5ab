#!/bin/sh
# Reactions of libmodbus and of our connection to late answers on Modbus TCP. Five seconds. Described in
# bench/modbus/libmodbus_tcp.cpp.
set -eu
exec "$THERMOCOMP_BENCH_BUILD/bin/bench_libmodbus_tcp" "$@"
