#!/bin/bash
# in_private_namespaces.sh FOLDER INI PROGRAMS: LinuxCNC in FOLDER as the user nobody, with networks,
# processes, shared memory and /tmp of its own: nothing of it meets another LinuxCNC, and nothing
# is left when it ends. It refuses root, and its own server would listen on every network.
# FOLDER and the folder PROGRAMS may be below the /tmp that this hides; PROGRAMS keeps its path.
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
