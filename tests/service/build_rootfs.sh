#!/bin/bash
# build_rootfs.sh FOLDER DEPENDENCY... [-- ASKED... [-- ALSO...]]
#
# Makes FOLDER/rootfs, a small Debian 12 with systemd as its init, by mmdebstrap, unless it is there
# and as this script and the dependencies want it. DEPENDENCY: the packages that the ones under test
# depend on. What they add to a minimal Debian with systemd is noted in FOLDER/dependencies: lines
# "PACKAGE KIB". ASKED: packages that are not installed; FOLDER/asked has apt's lines about how much
# they and what they need would add to those. ALSO: packages that are installed and counted nowhere. Needs
# root and a Debian mirror.
set -euo pipefail
mkdir -p "${1:?a folder}"
folder=$(cd -- "$1" && pwd)
shift

wanted=$({ cat "${BASH_SOURCE[0]}"; printf '%s\n' "$@"; } | sha256sum)
if [[ -e $folder/rootfs.stamp && $(cat "$folder/rootfs.stamp") == "$wanted" ]]; then
  echo "rootfs: there"
  exit 0
fi
dependencies=()
while (($#)) && [[ $1 != -- ]]; do
  dependencies+=("$1")
  shift
done
asked=() also=()
if (($#)); then shift; fi
while (($#)) && [[ $1 != -- ]]; do
  asked+=("$1")
  shift
done
also=("${@:2}")
rm -rf "$folder/rootfs" "$folder/rootfs.stamp" "$folder/asked"
began=$SECONDS

# What boots; then what is under test needs; then what the tests themselves need.
base=systemd,systemd-sysv,dbus
tools=(kmod iproute2 procps python3 python3-pytest "${also[@]}")
list_packages() { printf "chroot \"\$1\" dpkg-query -W -f '\${Package} \${Installed-Size}\\\\n' | sort > %q" "$1"; }
apt_install="chroot \"\$1\" env DEBIAN_FRONTEND=noninteractive apt-get -q -y --no-install-recommends install"
# --assume-no: says what it would do, and ends with status 1.
ask="chroot \"\$1\" env LC_ALL=C apt-get -q --assume-no --no-install-recommends install"

# The hooks are for mmdebstrap's shell.
# shellcheck disable=SC2016
# No man pages are left out: the packages under test are looked at as they are.
if ! mmdebstrap --mode=root --variant=minbase --include="$base" \
  --aptopt='Acquire::Languages "none"' --skip=cleanup/apt/lists \
  --customize-hook="$(list_packages "$folder/packages.base")" \
  --customize-hook="$apt_install ${dependencies[*]}" \
  --customize-hook="$(list_packages "$folder/packages.dependencies")" \
  --customize-hook="$ask ${asked[*]} | grep -E 'newly installed|archives|disk space' \
                    > $(printf %q "$folder/asked") || true" \
  --customize-hook="$apt_install ${tools[*]}" \
  --customize-hook='rm -rf "$1"/var/lib/apt/lists/* "$1"/var/cache/apt/*' \
  --customize-hook='echo guest > "$1/etc/hostname"; : > "$1/etc/resolv.conf"' \
  bookworm "$folder/rootfs" > "$folder/rootfs.log" 2>&1; then
  tail -n 40 "$folder/rootfs.log" >&2
  exit 1
fi
comm -13 "$folder/packages.base" "$folder/packages.dependencies" > "$folder/dependencies"

# Nothing to be done on a first boot, and no unit that a guest has no use for. PostgreSQL's server is started by the
# test that needs it.
rootfs=$folder/rootfs
echo 0123456789abcdef0123456789abcdef > "$rootfs/etc/machine-id"
touch "$rootfs/etc/.updated" "$rootfs/var/.updated"
for unit in apt-daily.timer apt-daily-upgrade.timer dpkg-db-backup.timer e2scrub_all.timer \
  e2scrub_reap.service fstrim.timer getty.target getty@tty1.service kmod-static-nodes.service postgresql.service \
  modprobe@configfs.service modprobe@dm_mod.service modprobe@drm.service modprobe@fuse.service \
  modprobe@loop.service systemd-journal-flush.service systemd-logind.service \
  systemd-pstore.service systemd-random-seed.service systemd-timesyncd.service \
  systemd-tmpfiles-clean.timer systemd-update-utmp.service systemd-udev-trigger.service \
  systemd-udevd.service systemd-udevd-control.socket systemd-udevd-kernel.socket; do
  ln -sf /dev/null "$rootfs/etc/systemd/system/$unit"
done
echo "$wanted" > "$folder/rootfs.stamp"
echo "rootfs: made in $((SECONDS - began)) s, $(du -sm "$rootfs" | cut -f 1) MB"
