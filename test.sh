#!/bin/bash
# Builds everything and runs the tests of one build. .ci/run adds the sanitizers' builds, format and
# static checks.
#   ./test.sh [--quick | --all | --build-only] [--preset PRESET] [-- CTEST_OPTION...]
#   --quick: for daily work: only test programs, without packages, processes, guests or campaigns
#   --all: also tests that plant bugs in copies of the sources and check that they are found
#   --build-only: no tests
#   --preset: debug, release (default), asan-ubsan, asan-ubsan-all (with the modelling), tsan, coverage
set -euo pipefail
cd -- "$(dirname -- "${BASH_SOURCE[0]}")"
source scripts/common.sh
exec </dev/null

usage() {
  sed -n 's/^# \{0,1\}//; 4,8p' "${BASH_SOURCE[0]}"
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
    --quick | --all | --build-only)
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

# Results of the tests and of the repeated ones (counted by .ci/run).
results=$PWD/build/$preset/results.xml
repeated=$PWD/build/$preset/results_repeated.xml
failed_names=build/$preset/Testing/Temporary/LastTestsFailed.log  # written by ctest

# Skipped tests with their reasons, so that they do not look passed.
say_what_was_skipped() {
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
  local status=0
  [[ -s $failed_names ]] || return 1
  echo "== repeating alone what failed"
  "$@" ctest --preset "$preset" --no-tests=error --rerun-failed -j 1 --output-junit "$repeated" ||
    status=$?
  sed -n 's/.*<testcase name="\([^"]*\)".* status="run".*/passed only when repeated alone: \1/p' \
    "$repeated"
  return "$status"
}

run_tests() {
  local runner=() status=0
  export PYTEST_ADDOPTS=-rs  # pytest names what it skips
  if [[ $preset == tsan || $preset == asan-ubsan* ]]; then
    runner=(run_as_sanitizers_need)
    collect_sanitizer_reports
  fi
  if [[ $preset == coverage ]]; then find "build/$preset" -name '*.gcda' -delete; fi
  # Two places per CPU: a test that computes takes both (cmake/ThermocompTargets.cmake).
  "${runner[@]}" ctest --preset "$preset" --no-tests=error -j "$((2 * $(nproc)))" \
    "${ctest_options[@]}" --output-junit "$results" || status=$?
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

build_options=()
case $extent in
  quick)
    ctest_options=(--label-regex '^quick$' "${ctest_options[@]}")
    build_options=(--target quick_tests)
    ;;
  usual | build-only) ctest_options=(--label-exclude '^planted$' "${ctest_options[@]}") ;;
  all) build_options=(--target all planted_tests) ;;
esac
stage "packages" scripts/setup.sh test
stage "configure $preset" cmake --preset "$preset"
stage "build $preset" cmake --build --preset "$preset" -j "$(build_jobs)" "${build_options[@]}"
if [[ $extent == build-only ]]; then exit 0; fi
# The guest for sanitizer builds. Without it the tests on CAN fail with a message; all others run.
if [[ $extent != quick && ($preset == asan-ubsan* || $preset == tsan) ]]; then
  stage "kernel of the guest" scripts/guest-kernel.sh || true
fi
rm -f "$results" "$repeated" "$failed_names"
status=0
stage "tests $preset" run_tests || status=$?
say_what_was_skipped
if [[ $preset == coverage ]]; then stage "coverage" coverage_report; fi
exit "$status"
