#!/usr/bin/env bash
# Ki, Kc by beam formulas and by finite elements, and what running correction leaves in three oil
# conditions: docs/identification.md explains the tables.
set -euo pipefail
bin=$THERMOCOMP_BENCH_BUILD/bin
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
"$bin/bench_gate_machine" coefficients
"$bin/bench_gate_machine" run "$out/condition_1.csv"
"$bin/thermocomp-modelling" fit "$out/condition_1.csv" --outputs x_um --terms 3 --lags \
  -o "$out/model.toml" > "$out/said"
"$bin/bench_gate_machine" corrections "$out/model.toml"
