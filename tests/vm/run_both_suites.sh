#!/bin/bash
# run_both_suites.sh BIN: the tests of the CAN drivers and those of the daemon on CAN, with the
# programs in the folder BIN. The second runs also where the first failed.
# Exit status: 0 all passed; 77 (ctest: skipped) there are no such programs.
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
# The measured spindle run is for the fast builds: here it would only show how slow this guest is.
# So are the simulated nodes, whose tests take many minutes here.
"$here/daemon/run_tests.sh" "$bin" \
  -k "not model_of_every_row and not field_nodes and not can_presets" || status=1
echo "run_both_suites.sh: daemon $((SECONDS - began)) s" >&2
exit "$status"
