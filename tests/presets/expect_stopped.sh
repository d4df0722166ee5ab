#!/bin/bash
# expect_stopped.sh MESSAGE PROGRAM ARGUMENT...: passes when the program ends with another status than
# 0 and 2 (bad use) and says MESSAGE, an extended regular expression.
set -uo pipefail
# The report is to be seen here, not among those of the tests.
unset ASAN_OPTIONS UBSAN_OPTIONS LSAN_OPTIONS TSAN_OPTIONS
message=$1
shift
output=$("$@" 2>&1)
status=$?
echo "$output"
if ((status == 0 || status == 2)); then
  echo "expected this to be stopped: $*; exit status $status" >&2
  exit 1
fi
grep -qE -- "$message" <<<"$output" || { echo "stopped, but not with $message" >&2; exit 1; }
