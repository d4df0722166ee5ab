#!/bin/bash
# Runs every fuzz target once on its seeds; each judges the promises of what it reads.
#   tests/fuzz/run_seeds.sh BIN WORK
set -euo pipefail
bin=$1 work=$2
cd -- "$(dirname -- "${BASH_SOURCE[0]}")"
"$bin/make_history_seed" "$work/history.db"
/usr/bin/python3 -B make_seeds.py "$work" "$work/history.db"
broken=0
for source in *.cpp; do
  target=$(basename "$source" .cpp)
  folders=("$work/seeds/$target")
  if [[ -d seeds/$target ]]; then folders+=("seeds/$target"); fi
  if text=$("$bin/fuzz_seeds" "$target" "${folders[@]}" 2>&1); then
    echo "$target: $(tail -n 1 <<<"$text")"
  else
    echo "$target: BROKEN"
    tail -n 5 <<<"$text"
    broken=1
  fi
done
exit "$broken"
