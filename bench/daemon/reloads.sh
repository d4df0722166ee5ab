#!/bin/sh
# 1,000 reloads at each of 1 Hz, 100 Hz and 1 kHz, beside clients that ask and switch: longest answer,
# longest pause of the watchdog, and what was answered or left wrong. At 1 Hz a reload takes a
# second: about 20 minutes in all; ROUNDS and RATES in the environment change that. Fails when
# anything is wrong.
set -eu
export THERMOCOMP_BIN="$THERMOCOMP_BENCH_BUILD/bin"
exec /usr/bin/python3 "$(dirname "$0")/../../tests/integration/daemon/reload_rounds.py" \
  --rounds "${ROUNDS:-1000}" --rates "${RATES:-1,100,1000}"
