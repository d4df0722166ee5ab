#!/bin/bash
# Checks that each fuzz target and the readers of foreign tables and of histories compile with clang: syntax
# only, about a minute. scripts/fuzz.sh runs them.
set -euo pipefail
cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.."
source scripts/common.sh

targets=(tests/fuzz/*.cpp)
mapfile -t readers < <(find config/run_forms config/runs daemon/history -name '*.cpp')
printf '%s\0' "${targets[@]}" "${readers[@]}" | xargs -0 -n 1 -P "$(build_jobs)" \
  clang++ -std=c++20 -fsyntax-only -I. -Itests/fuzz -isystem /usr/include/eigen3
echo "${#targets[@]} fuzz targets and ${#readers[@]} readers compile"
