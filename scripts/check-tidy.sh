#!/bin/bash
# clang-tidy over the files, with the commands of the preset debug.
#   scripts/check-tidy.sh [FOLDER|FILE...]   default: every folder with code, about 13 minutes on 2 CPUs
set -euo pipefail
cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.."
source scripts/common.sh

[[ -f build/debug/compile_commands.json ]] || cmake --preset debug >/dev/null

build=build/tidy
mkdir -p "$build"
sed 's/ --param [^ ]*//' build/debug/compile_commands.json >"$build/compile_commands.json"

folders=("$@")
if ((${#folders[@]} == 0)); then
  folders=(estimator drivers config status report daemon simulator cli gateway fleet linuxcnc modelling
    docs bench tests)
fi
pattern="$PWD/($(IFS='|' && echo "${folders[*]%/}"))(/.*\.cpp)?$"

# Even with -quiet the commands and counts of suppressed warnings are printed; omit them.
run-clang-tidy -quiet -p "$build" -j "$(build_jobs)" "$pattern" 2>/dev/null |
  sed -e 's/\x1b\[[0-9;]*m//g' |
  { grep -v -E '^(clang-tidy|[0-9]+ warnings? (generated|treated))|^$' || true; }
