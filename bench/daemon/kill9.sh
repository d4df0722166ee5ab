#!/bin/sh
# kill -9 of the daemon at 200 random moments (running, starting, committing, reloading, answering a
# command) beside a machine that keeps moving: committed rows that are gone, and the step of the
# offset that the controller sees over each restart beside slew rate x period of its link. About 5
# minutes; ROUNDS and SEED in the environment change that. Fails when a row is lost.
set -eu
export THERMOCOMP_BIN="$THERMOCOMP_BENCH_BUILD/bin"
exec /usr/bin/python3 "$(dirname "$0")/../../tests/integration/daemon/kill_rounds.py" \
  --rounds "${ROUNDS:-200}" --seed "${SEED:-1}"
