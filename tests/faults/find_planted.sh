#!/bin/bash
# Every planted bug must break an invariant, and without one none may be broken.
#   find_planted.sh PROGRAM
set -euo pipefail
program=$1
lives=(--hours 4 --history-every 4)

missed=0
if ! "$program" --seeds 0:16 "${lives[@]}" >/dev/null 2>&1; then
  echo "an invariant is broken although no bug is planted"
  missed=1
fi
printf '%-34s %-30s %5s %14s\n' "planted bug" "broken invariant" "seed" "machine hours"
while read -r _ bug; do
  out=$("$program" --planted "$bug" --expect-found --seeds 0:400 "${lives[@]}" 2>/dev/null) || true
  if ! read -r _ invariant seed hours < <(grep '^FOUND' <<<"$out"); then
    printf '%-34s NOT FOUND\n' "$bug"
    missed=1
    continue
  fi
  printf '%-34s %-30s %5s %14s\n' "$bug" "$invariant" "$seed" "$hours"
done < <("$program" --list | grep '^planted ')
exit "$missed"
