#!/bin/bash
# run_test.sh FILE.py: runs the test, or exits with status 77 and the reason why it cannot run.
set -euo pipefail
skip() {
  echo "skipped: $1"
  exit 77
}
command -v linuxcnc >/dev/null || skip "LinuxCNC (linuxcnc-uspace) is not installed"
[[ $(id -u) == 0 ]] || skip "LinuxCNC is run in namespaces of its own, which needs root"
unshare --fork --pid --mount-proc --ipc --net --mount true 2>/dev/null ||
  skip "this computer does not allow namespaces of processes, memory, network and mounts"
exec /usr/bin/python3 -m pytest -q -s -x -p no:cacheprovider "$1"
