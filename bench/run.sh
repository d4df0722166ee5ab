#!/bin/sh
# The benchmarks. Without an argument: their names, one per line. With one: runs it; the last lines of its
# output are "NAME VALUE UNIT". Measured data: $THERMOCOMP_DATA, else shared/data beside the source. Exit
# status 0 if it could measure, 2 for an unknown name, 77 without the required data. All other output
# (building, progress, explanations) goes to stderr.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
source_dir=$(dirname "$here")

list() {
  for script in "$here"/*/*.sh; do
    basename "$script" .sh
  done | LC_ALL=C sort
}

if [ $# -eq 0 ]; then
  list
  exit 0
fi
if [ $# -ne 1 ] || ! list | grep -qxF -- "$1"; then
  echo "bench/run.sh: no benchmark of that name; there are: $(list | tr '\n' ' ')" >&2
  exit 2
fi

script=$(echo "$here"/*/"$1.sh")
export THERMOCOMP_DATA="${THERMOCOMP_DATA:-$(dirname "$source_dir")/shared/data}"
if grep -q THERMOCOMP_DATA "$script" && [ ! -d "$THERMOCOMP_DATA/spindle_46h" ]; then
  echo "bench/run.sh: skipped: $1 needs data that are not in $THERMOCOMP_DATA (THERMOCOMP_DATA)" >&2
  exit 77
fi

# Folder of the programs; THERMOCOMP_BENCH_BUILD selects another, already built one.
if [ -z "${THERMOCOMP_BENCH_BUILD:-}" ]; then
  THERMOCOMP_BENCH_BUILD=$source_dir/build/release
  if [ ! -f "$THERMOCOMP_BENCH_BUILD/build.ninja" ]; then
    (cd "$source_dir" && cmake --preset release) >&2
  fi
  (cd "$source_dir" && cmake --build --preset release --target benchmarks) >&2
fi
export THERMOCOMP_BENCH_BUILD
exec "$script"
