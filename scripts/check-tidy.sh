#!/bin/bash
# clang-tidy over the translation units of the release build.
#   scripts/check-tidy.sh [FOLDER|FILE...]   default: every folder with code, about 13 minutes on 2 CPUs
set -euo pipefail
cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.."
source scripts/common.sh

[[ -f build/release/compile_commands.json ]] || cmake --preset release >/dev/null

# Clang cannot read GCC's precompiled headers; without them each file must include all that it uses.
build=build/tidy
mkdir -p "$build"
sed -e 's/ -Winvalid-pch//; s/ -fpch-preprocess//; s/ --param [^ ]*//; s/ -include [^ ]*cmake_pch\.hxx//' \
  -e 's/ -flto//; s/ -ffat-lto-objects//; s/ -fno-lto//' \
  build/release/compile_commands.json >"$build/compile_commands.json"

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
