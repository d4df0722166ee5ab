#!/usr/bin/env bash
# One step of the estimator compared with the bare matrix-vector product, and its instructions. Described in
# bench/estimator/step.cpp.
set -euo pipefail
program=$THERMOCOMP_BENCH_BUILD/bin/bench_step

"$program"

if ! command -v valgrind > /dev/null; then
  echo "step: valgrind is not installed, instructions are not counted" >&2
  exit 1
fi
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
# The difference of two runs with different lengths excludes the start and the first steps.
count() {
  valgrind --tool=callgrind --callgrind-out-file="$out/$2" --collect-atstart=no \
    --toggle-collect='*Machine::step*' "$program" "$1" "$2" > /dev/null 2> "$out/$2.log"
  awk '/^(summary|totals):/ { print $2; exit }' "$out/$2"
}
few=$(count --count-all-due 200)
many=$(count --count-all-due 1200)
echo "instructions_per_step_all_due $(( (many - few) / 1000 )) instructions"
few=$(count --count 200)
many=$(count --count 1200)
echo "instructions_per_step $(( (many - few) / 1000 )) instructions"
few=$(count --count-beside 200)
many=$(count --count-beside 1200)
echo "instructions_per_step_beside $(( (many - few) / 1000 )) instructions"
