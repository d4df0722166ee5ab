#!/bin/bash
# in_private_namespaces.sh FOLDER INI PROGRAMS: runs LinuxCNC in FOLDER as user nobody with private
# networks, processes, shared memory and /tmp, isolated from any other LinuxCNC, and leaves nothing behind.
# LinuxCNC refuses root, and its server would listen on all networks. FOLDER and PROGRAMS may be below the
# hidden /tmp; PROGRAMS keeps its path.
set -euo pipefail
export FOLDER=$1 INI=$2 PROGRAMS=$3
# shellcheck disable=SC2016  # expanded inside
exec unshare --fork --kill-child --pid --mount-proc --ipc --net --mount bash -c '
  set -euo pipefail
  ip link set lo up
  cd "$FOLDER"
  mount --bind "$FOLDER" /mnt
  mount --bind "$PROGRAMS" /media
  mount -t tmpfs -o mode=1777 tmpfs /tmp
  mkdir -p "$PROGRAMS"
  mount --bind /media "$PROGRAMS"
  cd /mnt
  export HOME=/mnt/home
  exec setpriv --reuid nobody --regid nogroup --clear-groups --no-new-privs \
    linuxcnc -r "/mnt/$INI"' </dev/null
