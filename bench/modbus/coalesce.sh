#!/bin/sh
# 20 float values of one Modbus unit, neighbouring registers in one request and one by one: half a
# minute. What is compared with what: the head of bench/modbus/coalesce.cpp.
set -eu
exec "$THERMOCOMP_BENCH_BUILD/bin/bench_coalesce" "$@"
