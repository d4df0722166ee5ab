#!/bin/bash
# Every planted bug must break an invariant, and none may be broken without one.
#   find_planted.sh PROGRAM
set -euo pipefail
program=$1

missed=0
printf '%-34s %-30s %s\n' "planted bug" "broken invariant" "seed"
if ! "$program" --seeds 1:17 --hours 2 >/dev/null 2>&1; then
  echo "an invariant is broken although no bug is planted"
  missed=1
fi
while read -r _ bug; do
  out=$("$program" --planted "$bug" --expect-found --seeds 0:800 --hours 4 --history-every 4 \
    2>/dev/null) || true
  found=$(grep -m 1 '^BROKEN' <<<"$out" || true)
  if [[ -z $found ]]; then
    printf '%-34s NOT FOUND\n' "$bug"
    missed=1
    continue
  fi
  read -r _ invariant _ _ seed _ <<<"$found"
  printf '%-34s %-30s %s\n' "$bug" "$invariant" "$seed"
done < <("$program" --list | grep '^planted ')
exit "$missed"
