#!/bin/bash
# All checks, for some hours: .ci/run with all long tests, then the debug build, line coverage, and every
# benchmark. Each part runs even if another failed; parts impossible on this machine (exit status 77) are
# left out and named at the end.
#   scripts/nightly.sh       exit status 0: everything passed and could be measured
set -euo pipefail
cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.."
source scripts/common.sh
exec </dev/null

# Other kill times and other lives each night; the seed is printed.
export SEED=${SEED:-$RANDOM}
first_life=$((4000 + 2560 * SEED))

failed=() left_out=()
part() {
  local name=$1 status=0
  shift
  stage "$name" "$@" || status=$?
  case $status in
    0) ;;
    77) left_out+=("$name") ;;
    *) failed+=("$name") ;;
  esac
}

# Before configuration: thermocomp-petsc is built if PETSc is installed.
part "packages of PETSc" scripts/setup.sh petsc
for preset in release asan-ubsan-all tsan debug coverage; do
  part "$preset" ./test.sh --all --preset "$preset"
done
part "a new Debian" scripts/check-fresh.sh
part "one definition" scripts/check-odr.sh
part "includes" scripts/check_includes.py
part "format" scripts/check-format.sh
part "clang-tidy" scripts/check-tidy.sh
part "fuzz" scripts/fuzz.sh --minutes 10
# ./test.sh --all has compiled file by file, for the planted bugs: what follows concerns what is installed.
part "build as installed" ./test.sh --build-only
bin=build/release/bin
part "faults" "$bin/thermocomp_faults" --seeds "$first_life:$((first_life + 2560))" --hours 4 \
  --complete
part "faults at 100 Hz" \
  "$bin/thermocomp_faults" --seeds 0:192 --hours 1 --cycle-hz 100 --complete
part "attacks" "$python" tests/attack/attack.py --bin "$bin" --seed "$SEED" --jobs 4 --minutes 45
part "attacks on CAN" tests/vm/run_with_can.sh --timeout 1500 env TMPDIR=/dev/shm \
  "$python" tests/attack/attack.py --bin "$bin" --seed "$SEED" --links can,can_travel --minutes 15
for benchmark in $(bench/run.sh); do
  part "bench $benchmark" bench/run.sh "$benchmark"
done

echo
if ((${#left_out[@]} > 0)); then printf 'left out: %s\n' "${left_out[@]}"; fi
if ((${#failed[@]} > 0)); then
  printf 'failed: %s\n' "${failed[@]}"
  exit 1
fi
echo "everything passed in $((SECONDS / 60)) min"
