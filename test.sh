#!/bin/bash
# Builds everything and runs the tests of one build. .ci/run adds the sanitizers' builds, format and
# static checks.
#   ./test.sh [--quick | --packages | --all | --build-only] [--preset PRESET] [-- CTEST_OPTION...]
#   --quick: for daily work: only test programs, without processes, guests or campaigns
#   --packages: also tests that take minutes or need a browser or PostgreSQL, and the Debian packages in booted systems
#   --all: also the tests of the night, and those that plant bugs in copies of the sources
#   --build-only: no tests
#   --preset: debug, release (default), asan-ubsan, asan-ubsan-all (with the modelling), tsan, coverage
set -euo pipefail
cd -- "$(dirname -- "${BASH_SOURCE[0]}")"
source scripts/common.sh
exec </dev/null

usage() {
  sed -n 's/^# \{0,1\}//; 4,9p' "${BASH_SOURCE[0]}"
}

preset=release
extent=usual
ctest_options=()
while (($#)); do
  case $1 in
    --preset)
      (($# >= 2)) || { usage >&2; exit 2; }
      preset=$2
      shift 2
      ;;
    --quick | --packages | --all | --build-only)
      extent=${1#--}
      shift
      ;;
    --)
      shift
      ctest_options=("$@")
      break
      ;;
    -h | --help)
      usage
      exit 0
      ;;
    *)
      usage >&2
      exit 2
      ;;
  esac
done
case $preset in
  debug | release | asan-ubsan | asan-ubsan-all | tsan | coverage) ;;
  *)
    echo "test.sh: no preset called $preset" >&2
    usage >&2
    exit 2
    ;;
esac

# Results of each part of the tests: results_PART.xml, of the repeated ones repeated_PART.xml (counted by
# .ci/run).
folder=$PWD/build/$preset
failed_names=build/$preset/Testing/Temporary/LastTestsFailed.log  # written by ctest

# Skipped tests with their reasons, so that they do not look passed.
list_skipped() {
  local log=build/$preset/Testing/Temporary/LastTest.log
  [[ -f $log ]] || return 0
  grep -E '^SKIPPED |: skipped: ' "$log" | sort -u | sed 's/^/left out: /' || true
}

# Sanitizer reports of programs that a test starts and kills would be lost: they go to files; any report is
# a failure.
collect_sanitizer_reports() {
  reports=$PWD/build/$preset/sanitizer_reports
  rm -rf "$reports"
  mkdir "$reports"
  export ASAN_OPTIONS=log_path=$reports/asan
  export UBSAN_OPTIONS=log_path=$reports/ubsan:print_stacktrace=1
  export LSAN_OPTIONS=log_path=$reports/lsan TSAN_OPTIONS=log_path=$reports/tsan
}

show_sanitizer_reports() {
  local report status=0
  for report in "$reports"/*; do
    [[ -e $report ]] || continue
    echo "== $report"
    head -n 60 "$report"
    status=1
  done
  return "$status"
}

# Failed tests run once more, alone: other load must not decide. Those that then pass are named, since a
# test that fails by chance is a defect too.
repeat_failed() {
  local status=0 repeated=$folder/repeated_$part.xml
  [[ -s $failed_names ]] || return 1
  echo "== repeating alone what failed"
  "$@" ctest --preset "$preset" --no-tests=error --rerun-failed -j 1 --output-junit "$repeated" ||
    status=$?
  sed -n 's/.*<testcase name="\([^"]*\)".* status="run".*/passed only when repeated alone: \1/p' \
    "$repeated"
  return "$status"
}

# run_tests PART CTEST_OPTION...
run_tests() {
  local part=$1 runner=() status=0
  shift
  export PYTEST_ADDOPTS=-rs  # pytest names what it skips
  if [[ $preset == tsan || $preset == asan-ubsan* ]]; then
    runner=(run_as_sanitizers_need)
    collect_sanitizer_reports
  fi
  # Two places per CPU: a test that waits for devices takes one, one that computes two
  # (cmake/ThermocompTargets.cmake). With three, tests wait for each other, and take longer in all.
  "${runner[@]}" ctest --preset "$preset" --no-tests=error -j "$((2 * $(nproc)))" \
    "$@" --output-junit "$folder/results_$part.xml" || status=$?
  if ((status != 0)); then
    status=0
    repeat_failed "${runner[@]}" || status=$?
  fi
  if [[ $preset == tsan || $preset == asan-ubsan* ]]; then show_sanitizer_reports || status=1; fi
  return "$status"
}

coverage_report() {
  gcovr --root . --object-directory "build/$preset" --exclude 'build/' --exclude 'tests/' \
    --html-details "build/$preset/coverage.html" --json "build/$preset/coverage.json" \
    "build/$preset" &&
    "$python" scripts/coverage_by_folder.py "build/$preset/coverage.json" &&
    echo "line by line: build/$preset/coverage.html"
}

# build TARGET...
build() {
  cmake --build --preset "$preset" -j "$(build_jobs)" --target "$@"
}

# test_part PART CTEST_OPTION...: notes whether one failed.
test_part() {
  local part=$1
  stage "tests $preset $part" run_tests "$@" || failed=1
  list_skipped
}

# Tests of processes wait for devices half of their time: what only the others need is built behind them.
test_processes_while_building() {
  local labels='^(attack|integration|linuxcnc|real_time|service|vm)$' behind
  stage "build $preset, programs" build process_tests
  nice -n 19 ninja -C "$folder" -j "$(build_jobs)" "${targets[@]}" >"$folder/behind.log" 2>&1 &
  behind=$!
  trap 'kill "$behind" 2>/dev/null || true' EXIT
  test_part processes --label-regex "$labels" "${left_out[@]}"
  stage "build $preset, the rest" wait "$behind" || true  # what failed is built again, where it is seen
  trap - EXIT
  left_out=(--label-exclude "${labels%)\$}|${left_out_labels})\$")
}

targets=(all) left_out_labels='long|nightly|planted|service' together=ON needed=test
case $extent in
  quick) targets=(quick_tests) ;;
  packages) left_out_labels='nightly|planted' needed=checks ;;
  # Planted bugs replace single files.
  all) targets=(all planted_tests) left_out_labels=none together=OFF needed=checks ;;
esac
if [[ $preset != release ]]; then needed=checks; fi
left_out=(--label-exclude "^($left_out_labels)\$")
stage "packages" scripts/setup.sh "$needed"
stage "configure $preset" cmake --preset "$preset" -D THERMOCOMP_TOGETHER="$together"
if [[ $extent == build-only ]]; then
  stage "build $preset" build "${targets[@]}"
  exit 0
fi
# The guest for sanitizer builds. Without it the tests on CAN fail with a message; all others run.
if [[ $extent != quick && ($preset == asan-ubsan* || $preset == tsan) ]]; then
  stage "kernel of the guest" scripts/guest-kernel.sh || true
fi
rm -f "$folder"/results_*.xml "$folder"/repeated_*.xml "$failed_names"
if [[ $preset == coverage ]]; then find "$folder" -name '*.gcda' -delete; fi
failed=0
if [[ $extent != quick && ${#ctest_options[@]} -eq 0 ]]; then test_processes_while_building; fi
stage "build $preset" build "${targets[@]}"
case $extent in
  quick) test_part quick --label-regex '^quick$' "${ctest_options[@]}" ;;
  *) test_part others "${left_out[@]}" "${ctest_options[@]}" ;;
esac
if [[ $preset == coverage ]]; then stage "coverage" coverage_report; fi
exit "$failed"
