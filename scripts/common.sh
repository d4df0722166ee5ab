# shellcheck shell=bash
# Small things that the scripts at the top share. Sourced, with set -euo pipefail.

# The interpreter that Debian's Python packages belong to; another python3 may be first on PATH.
# shellcheck disable=SC2034
python=/usr/bin/python3

# At most one compiler a CPU, and one a GiB of memory: the sanitizer builds are large.
build_jobs() {
  local cpus memory_GiB
  cpus=$(nproc)
  memory_GiB=$(awk '/^MemAvailable/ { print int($2 / 1048576) }' /proc/meminfo)
  if ((memory_GiB < 1)); then memory_GiB=1; fi
  if ((memory_GiB < cpus)); then echo "$memory_GiB"; else echo "$cpus"; fi
}

# stage "what" command...: says what begins, and how long it took or that it failed.
stage() {
  local title=$1 began=$SECONDS status=0
  shift
  echo "== $title"
  "$@" || status=$?
  if ((status == 0)); then
    echo "== $title: done in $((SECONDS - began)) s"
  else
    echo "== $title: FAILED after $((SECONDS - began)) s (status $status)" >&2
  fi
  return "$status"
}

# With many bits of address randomisation GCC 12's thread sanitizer cannot map its shadow memory;
# programs then start without randomisation.
run_as_sanitizers_need() {
  if setarch --addr-no-randomize true 2>/dev/null; then
    setarch --addr-no-randomize "$@"
  else
    "$@"
  fi
}

# junit_counts FILE: "PASSED FAILED SKIPPED" of the tests in a file of `ctest --output-junit`; zeros
# where there is none.
junit_counts() {
  local total failures skipped
  if [[ ! -s $1 ]]; then
    echo "0 0 0"
    return
  fi
  total=$(junit_count "$1" tests) failures=$(junit_count "$1" failures)
  skipped=$(junit_count "$1" skipped)
  echo "$((total - failures - skipped)) $failures $skipped"
}

# The attribute of the file's first element that has it: the test suite's.
junit_count() {
  local count
  count=$(grep -o -m 1 "[[:space:]]$2=\"[0-9]*\"" "$1" | head -n 1 | tr -dc '0-9')
  echo "${count:-0}"
}
