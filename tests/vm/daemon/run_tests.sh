#!/bin/sh
# run_tests.sh BIN FILE...: tests of this folder, with all files in memory, since the guest's view of the host's
# files supports neither sockets nor SQLite's shared memory.
set -eu
TMPDIR=$(mktemp -d /dev/shm/thermocomp.XXXXXX)
trap 'rm -rf "$TMPDIR"' EXIT
export TMPDIR THERMOCOMP_BIN="$1"
shift
/usr/bin/python3 -m pytest -q -s -p no:cacheprovider --basetemp="$TMPDIR/pytest" "$@"
