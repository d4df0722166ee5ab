#!/bin/bash
# Runs the fuzz targets of tests/fuzz (libFuzzer, address and undefined-behaviour sanitizers) and prints
# a table: inputs executed, coverage, and failures.
#   scripts/fuzz.sh [--minutes M | --seconds S] [--jobs N] [--no-build] [TARGET...]
#   scripts/fuzz.sh --list | --build
# Default: 10 minutes per target, one target per processor at a time. Inputs with new coverage are kept in
# build/fuzz/runs/TARGET/corpus for the next run; failing inputs are written to
# build/fuzz/runs/TARGET/artifacts.
# Exit status 0: no failure; 1: a failure; 2: usage error or no build; 77: clang is not installed.
set -euo pipefail
cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.."
source scripts/common.sh

usage() { sed -n 's/^# \{0,1\}//; 4,5p' "${BASH_SOURCE[0]}"; }

runs=build/fuzz/runs
readonly input_seconds_max=20    # longest time of one input on a busy machine
readonly structured_bytes_max=131072  # of an input built by a mutator
readonly memory_MB_max=2048      # of the process, including the sanitizer's
readonly allocation_MB_max=512   # of one allocation
mapfile -t known < <(basename -s .cpp -- tests/fuzz/*.cpp)

fail() {
  echo "fuzz.sh: $*" >&2
  exit 2
}

seconds=600 jobs=$(build_jobs) builds=yes only=
targets=()
while (($#)); do
  case $1 in
    --minutes | --seconds | --jobs)
      [[ ${2:-} =~ ^[1-9][0-9]*$ ]] || fail "$1 takes a whole number"
      case $1 in
        --minutes) seconds=$(($2 * 60)) ;;
        --seconds) seconds=$2 ;;
        --jobs) jobs=$2 ;;
      esac
      shift
      ;;
    --no-build) builds=no ;;
    --build) only=build ;;
    --list) only=list ;;
    -h | --help) usage && exit 0 ;;
    -*) usage >&2 && exit 2 ;;
    *)
      [[ " ${known[*]} " == *" $1 "* ]] || fail "no target called $1; there are: ${known[*]}"
      targets+=("$1")
      ;;
  esac
  shift
done
if ((${#targets[@]} == 0)); then targets=("${known[@]}"); fi
if [[ $only == list ]]; then
  printf '%s\n' "${targets[@]}"
  exit 0
fi
if ! command -v clang++ >/dev/null; then
  echo "fuzz: skipped: there is no clang++ (packages clang and libclang-rt-dev)"
  exit 77
fi

build() {
  local log=build/fuzz/build.log
  mkdir -p build/fuzz
  if cmake --preset fuzz >"$log" 2>&1 &&
    cmake --build --preset fuzz -j "$(build_jobs)" >>"$log" 2>&1; then
    return 0
  fi
  tail -n 60 "$log" >&2
  fail "the targets could not be built (all of it: $log)"
}

# run TARGET: the result is in its log; never fails.
run() {
  local target=$1 words=$runs/dictionaries/$1.dict found=() options=()
  mkdir -p "$runs/$target/corpus" "$runs/$target/artifacts"
  rm -f "$runs/$target/artifacts"/*
  if [[ -d tests/fuzz/seeds/$target ]]; then found=("tests/fuzz/seeds/$target"); fi
  if [[ -f $words ]]; then options=("-dict=$words"); fi
  # The target's own mutator makes deep and long inputs from the start.
  if grep -q "^fuzz_target($target SOURCES common/[a-z]*_mutator.cpp" tests/fuzz/CMakeLists.txt; then
    options+=(-max_len="$structured_bytes_max" -len_control=0)
  fi
  "build/fuzz/bin/fuzz_$target" -max_total_time="$seconds" -timeout="$input_seconds_max" \
    -rss_limit_mb="$memory_MB_max" -malloc_limit_mb="$allocation_MB_max" -print_final_stats=1 \
    "${options[@]}" -artifact_prefix="$runs/$target/artifacts/" \
    "$runs/$target/corpus" "$runs/seeds/$target" "${found[@]}" >"$runs/$target/log" 2>&1 || true
}

# of TARGET STATISTIC: a number from libFuzzer's closing lines.
statistic() { sed -n "s/^stat::$2: *//p" "$runs/$1/log" | tail -n 1; }

# A line of the table. @return 1 if the target failed
report() {
  local target=$1 log=$runs/$1/log status=0 coverage features broken
  broken=$(find "$runs/$target/artifacts" -type f | wc -l)
  # Without the closing line the program ended abnormally.
  if ! grep -q '^Done ' "$log" && ((broken == 0)); then broken=1; fi
  coverage=$(sed -n 's/.* cov: \([0-9]*\) .*/\1/p' "$log" | tail -n 1)
  features=$(sed -n 's/.* ft: \([0-9]*\) .*/\1/p' "$log" | tail -n 1)
  printf '%-18s %12s %8s %8s %9s %7s %8s\n' "$target" \
    "$(statistic "$target" number_of_executed_units)" \
    "$(statistic "$target" average_exec_per_sec)" "${coverage:--}" "${features:--}" \
    "$(find "$runs/$target/corpus" -type f | wc -l)" "$broken"
  if ((broken > 0)); then
    grep -E 'broken promise|runtime error|ERROR: |SUMMARY|aborts|terminat' "$log" | head -n 8 ||
      tail -n 20 "$log"
    find "$runs/$target/artifacts" -type f -printf \
      "  again: build/fuzz/bin/fuzz_$target %p\n"
    status=1
  fi
  return "$status"
}

if [[ $builds == yes ]]; then build; fi
if [[ $only == build ]]; then exit 0; fi

# Files in memory that a failing target could not remove.
above=/dev/shm
[[ -w $above ]] || above=${TMPDIR:-/tmp}
THERMOCOMP_FUZZ_SCRATCH=$(mktemp -d "$above/thermocomp-fuzz-XXXXXX")
export THERMOCOMP_FUZZ_SCRATCH
trap 'rm -rf "$THERMOCOMP_FUZZ_SCRATCH"; kill $(jobs -p) 2>/dev/null || true' EXIT

mkdir -p "$runs"
build/fuzz/bin/make_history_seed "$runs/history.db"
/usr/bin/python3 -B tests/fuzz/make_seeds.py "$runs" "$runs/history.db"

began=$SECONDS
for target in "${targets[@]}"; do
  while (($(jobs -rp | wc -l) >= jobs)); do wait -n || true; done
  run "$target" &
done
wait

printf '%-18s %12s %8s %8s %9s %7s %8s\n' target executed per_s edges features corpus broken
status=0 executed=0
for target in "${targets[@]}"; do
  report "$target" || status=1
  executed=$((executed + $(statistic "$target" number_of_executed_units || true) + 0))
done
echo "fuzz: ${#targets[@]} targets, $seconds s each, $executed inputs executed in" \
  "$(((SECONDS - began + 30) / 60)) min; $([[ $status == 0 ]] && echo "nothing broke" || echo "BROKEN")"
exit "$status"
