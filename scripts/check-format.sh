#!/bin/bash
# Checks every C++ file of the project with clang-format. With --fix: rewrites them.
set -euo pipefail
cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.."

mapfile -d '' files < <(
  find . -path ./build -prune -o -type f \( -name '*.cpp' -o -name '*.hpp' \) -print0)
if [[ ${1:-} == --fix ]]; then
  clang-format -i "${files[@]}"
else
  clang-format --dry-run --Werror "${files[@]}"
fi
echo "${#files[@]} files in form"
