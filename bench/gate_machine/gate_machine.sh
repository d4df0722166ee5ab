#!/usr/bin/env bash
# Ki, Kc by beam formulas and by finite elements, and the residual of running correction in three oil
# conditions of that machine; then the published experiment from real bytes to the tool of a machine that
# moves like the published one (five minutes): docs/measurements.md has the tables.
set -euo pipefail
bin=$THERMOCOMP_BENCH_BUILD/bin
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
"$bin/bench_gate_machine" coefficients
"$bin/bench_gate_machine" run "$out/condition_1.csv"
"$bin/thermocomp-modelling" fit "$out/condition_1.csv" --outputs x_um --terms 3 --lags \
  -o "$out/model.toml" > "$out/said"
"$bin/bench_gate_machine" corrections "$out/model.toml"
"$bin/bench_gate_machine" record
here=$(cd "$(dirname "$0")" && pwd)
/usr/bin/python3 "$here/gate_experiment.py" "$bin" "$here/../../config/gate_machine" "$out/experiment"
if [ -f "$out/experiment/courses.png" ]; then
  cp "$out/experiment/courses.png" "$THERMOCOMP_BENCH_BUILD/gate_machine_courses.png"
  echo "the courses as a picture: $THERMOCOMP_BENCH_BUILD/gate_machine_courses.png"
fi
