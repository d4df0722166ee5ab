#!/bin/bash
# run_linuxcnc.sh ATTACK [OPTION...]: the attacks on the real LinuxCNC, or exit status 77 and why
# it cannot be run here.
set -euo pipefail
skip() {
  echo "skipped: $1"
  exit 77
}
command -v linuxcnc >/dev/null || skip "LinuxCNC (linuxcnc-uspace) is not installed"
[[ $(id -u) == 0 ]] || skip "LinuxCNC is run in namespaces of its own, which needs root"
unshare --fork --pid --mount-proc --ipc --net --mount true 2>/dev/null ||
  skip "this computer does not allow namespaces of processes, memory, network and mounts"
exec "$@" --links linuxcnc --jobs 1
