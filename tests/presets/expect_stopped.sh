#!/bin/bash
# expect_stopped.sh MESSAGE PROGRAM ARGUMENT...: passes if the program ends with a status other than 0 and 2
# (usage error) and prints MESSAGE, an extended regular expression.
set -uo pipefail
# Keep the report on stderr, out of the tests' report files.
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
