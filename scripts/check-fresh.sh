#!/bin/bash
# Runs a command of this checkout (its last commit) in a new minimal Debian 12, as root: what the command
# installs by itself must suffice. Needs root, mmdebstrap, git and the network; 4 GB below /var/tmp.
#   scripts/check-fresh.sh [COMMAND...]     default: ./demo.sh
set -euo pipefail
cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.."
source scripts/common.sh
if (($# == 0)); then set -- ./demo.sh; fi
if ((EUID != 0)); then echo "check-fresh.sh: needs root" >&2; exit 77; fi

root=$(mktemp -d /var/tmp/fresh-debian.XXXXXX)
clean_up() {
  local below
  for below in dev/pts dev sys proc; do umount "$root/$below" 2>/dev/null || true; done
  if mountpoint -q "$root/proc" || mountpoint -q "$root/dev"; then
    echo "check-fresh.sh: $root is left behind, since something is still mounted there" >&2
  else
    rm -rf --one-file-system "$root"
  fi
}
trap clean_up EXIT

stage "a minimal Debian 12" mmdebstrap --quiet --mode=root --variant=minbase \
  --include=ca-certificates,git bookworm "$root"
git clone --quiet . "$root/root/thermocomp"
cp /etc/resolv.conf "$root/etc/resolv.conf"
mount -t proc proc "$root/proc"
mount -t sysfs sys "$root/sys"
mount --bind /dev "$root/dev"
mount -t devpts devpts "$root/dev/pts"
stage "$* there" env -i HOME=/root PATH=/usr/sbin:/usr/bin:/sbin:/bin \
  chroot "$root" sh -c 'cd /root/thermocomp && exec "$@"' sh "$@"
