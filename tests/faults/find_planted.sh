#!/bin/bash
# Every planted bug must break an invariant; without a bug no invariant may break.
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
  # Bugs that need three simultaneous events are rare: search ten times as many lives.
  for seeds in 0:400 400:4000; do
    out=$("$program" --planted "$bug" --expect-found --seeds "$seeds" "${lives[@]}" 2>/dev/null) || true
    if grep -q '^FOUND' <<<"$out"; then break; fi
  done
  if ! read -r _ invariant seed hours < <(grep '^FOUND' <<<"$out"); then
    printf '%-34s NOT FOUND\n' "$bug"
    missed=1
    continue
  fi
  printf '%-34s %-30s %5s %14s\n' "$bug" "$invariant" "$seed" "$hours"
done < <("$program" --list | grep '^planted ')
# Each kind of false read-back alone must find a bug in the check against it.
while read -r fault bug; do
  out=$("$program" --planted "$bug" --only "$fault" --expect-found --seeds 0:200 "${lives[@]}" \
    2>/dev/null) || true
  if ! read -r _ invariant seed hours < <(grep '^FOUND' <<<"$out"); then
    printf '%-34s NOT FOUND by %s alone\n' "$bug" "$fault"
    missed=1
    continue
  fi
  printf '%-34s %-30s %5s %14s  %s alone\n' "$bug" "$invariant" "$seed" "$hours" "$fault"
done <<'END'
read_back_scaled read_back_is_a_command
read_back_negated read_back_is_a_command
read_back_shifted read_back_is_a_command
read_back_drifting read_back_is_a_command
read_back_jumped latch_ends_by_itself
read_back_frozen read_back_is_a_command
second_writer read_back_is_a_command
controller_ignoring read_back_is_a_command
controller_rejecting refused_offset_pent_up
controller_rejecting unwritten_compensates
writes_unanswered unwritten_compensates
unit_tenfold_too_low jump_widens_what_the_past_allows
END
exit "$missed"
