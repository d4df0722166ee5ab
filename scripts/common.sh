# shellcheck shell=bash
# Common functions of the scripts. Sourced, with set -euo pipefail.

# The interpreter of Debian's Python packages; another python3 may be first on PATH.
# shellcheck disable=SC2034
python=/usr/bin/python3

# At most one compiler per CPU and per GiB of memory: the sanitizer builds are large.
build_jobs() {
  local cpus memory_GiB
  cpus=$(nproc)
  memory_GiB=$(awk '/^MemAvailable/ { print int($2 / 1048576) }' /proc/meminfo)
  if ((memory_GiB < 1)); then memory_GiB=1; fi
  if ((memory_GiB < cpus)); then echo "$memory_GiB"; else echo "$cpus"; fi
}

# stage "what" command...: prints its beginning and its duration, omission (status 77) or failure.
stage() {
  local title=$1 began=$SECONDS status=0
  shift
  echo "== $title"
  "$@" || status=$?
  if ((status == 0)); then
    echo "== $title: done in $((SECONDS - began)) s"
  elif ((status == 77)); then
    echo "== $title: left out"
  else
    echo "== $title: FAILED after $((SECONDS - began)) s (status $status)" >&2
  fi
  return "$status"
}

# GCC 12's thread sanitizer cannot map its shadow memory with many bits of address randomisation; programs
# then start without it.
run_as_sanitizers_need() {
  if setarch --addr-no-randomize true 2>/dev/null; then
    setarch --addr-no-randomize "$@"
  else
    "$@"
  fi
}

# junit_counts FILE: "PASSED FAILED SKIPPED" of the tests in a file of `ctest --output-junit`; zeros if
# there is none. A test without its program is "skipped" there and counted as failed here.
junit_counts() {
  local passed=0 failed=0 skipped=0 missing=0
  if [[ -s $1 ]]; then
    passed=$(grep -c '<testcase .* status="run"' "$1" || true)
    failed=$(grep -c '<testcase .* status="fail"' "$1" || true)
    skipped=$(grep -c '<skipped message="SKIP_' "$1" || true)
    missing=$(grep '<skipped message=' "$1" | grep -vc 'message="SKIP_' || true)
  fi
  echo "$passed $((failed + missing)) $skipped"
}
