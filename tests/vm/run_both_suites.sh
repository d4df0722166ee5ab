#!/bin/bash
# run_both_suites.sh BIN: the CAN driver tests and the daemon's tests on CAN, with the programs in BIN. The
# second suite runs even if the first fails.
# Exit status: 0 all passed; 77 (ctest: skipped) the programs do not exist.
set -u
here=$(cd "$(dirname "$0")" && pwd)
bin=${1:?run_both_suites.sh needs the folder of the programs}
if ! [ -x "$bin/can_vm_tests" ]; then
  echo "run_both_suites.sh: skipped: there is no $bin/can_vm_tests (./test.sh builds it)"
  exit 77
fi
status=0
"$bin/can_vm_tests" --durations yes || status=1
echo "run_both_suites.sh: drivers $SECONDS s" >&2
began=$SECONDS
# Fast builds only: the replayed spindle run, which would show the guest's slowness, and the simulated
# nodes, which take many minutes here.
"$here/daemon/run_tests.sh" "$bin" "$here/daemon" \
  -k "not model_of_every_row and not field_nodes and not can_presets" || status=1
echo "run_both_suites.sh: daemon $((SECONDS - began)) s" >&2
exit "$status"
