#!/bin/sh
# Ki, Kc by beam formulas and by finite elements, and what running correction leaves in three oil
# conditions: docs/identification.md explains the tables.
set -eu
exec "$THERMOCOMP_BENCH_BUILD/bin/bench_gate_machine"
