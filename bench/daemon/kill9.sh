#!/bin/sh
# kill -9 of the daemon at 200 random times (running, starting, committing, reloading, answering a command)
# with a continually moving machine: lost committed rows, and the step of the offset at the controller
# across each restart relative to slew limit x period of its link. About 5 minutes; ROUNDS and SEED in the
# environment change that. Fails if a row is lost.
set -eu
export THERMOCOMP_BIN="$THERMOCOMP_BENCH_BUILD/bin"
exec /usr/bin/python3 "$(dirname "$0")/../../tests/integration/daemon/kill_rounds.py" \
  --rounds "${ROUNDS:-200}" --seed "${SEED:-1}"
