#!/bin/bash
# Reads all libraries of a release build together: a name with two definitions is an error. Nothing is compiled;
# the objects carry their types beside the machine code.
#   scripts/check-odr.sh [FOLDER]    default: build/release
set -euo pipefail
folder=${1:-build/release}
result=$(mktemp --suffix=.o)
trap 'rm -f "$result"' EXIT

mapfile -t libraries < <(find "$folder" -name 'lib*.a' -not -path '*/tests/*' -not -path '*/service/*')
if ((${#libraries[@]} == 0)); then
  echo "check-odr.sh: no library below $folder: build it first (./test.sh --build-only)" >&2
  exit 2
fi
for library in "${libraries[@]}"; do
  if [[ $(readelf -SW "$library" | grep -c gnu.lto_) -eq 0 ]]; then
    echo "check-odr.sh: $library carries no types: GCC makes them with -flto" >&2
    exit 2
  fi
done
g++ -flto="$(nproc)" -O0 -r -nostdlib -flinker-output=rel -Werror=odr -Werror=lto-type-mismatch \
  -Wl,--whole-archive "${libraries[@]}" -o "$result"
echo "${#libraries[@]} libraries: every name has one definition"
