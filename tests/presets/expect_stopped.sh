#!/bin/bash
# expect_stopped.sh PROGRAM FAULT MESSAGE: passes when PROGRAM FAULT is stopped with MESSAGE.
set -uo pipefail
# The report is to be seen here, not among those of the tests.
unset ASAN_OPTIONS UBSAN_OPTIONS LSAN_OPTIONS TSAN_OPTIONS
output=$("$1" "$2" 2>&1)
status=$?
echo "$output"
if ((status == 0 || status == 2)); then
  echo "expected the instrumented build to stop $2; exit status $status" >&2
  exit 1
fi
grep -q "$3" <<<"$output" || { echo "stopped, but not with $3" >&2; exit 1; }
