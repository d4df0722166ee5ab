#!/bin/bash
# install_and_purge.sh PACKAGE FOLDER
#
# Installs PACKAGE of FOLDER/packages (check_packages.sh) with dpkg on a copy of this machine's root in
# memory, runs its program on a small task, and purges it. The machine is not changed. Nothing may be left.
# Exit status 77, with the reason, if this machine cannot do it or lacks the package's dependencies.
set -euo pipefail
here=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")" && pwd)
name=${1:?a package} folder=${2:?a folder}
skip() {
  echo "install_and_purge.sh: skipped: $*"
  exit 77
}
fail() {
  echo "install_and_purge.sh: $name: $*" >&2
  exit 1
}
[[ $(id -u) -eq 0 ]] || skip "packages are installed as root only"
package=$(compgen -G "$folder/packages/${name}_*.deb") ||
  skip "there is no package (the test packages makes it)"
if dpkg-query -W "$name" >/dev/null 2>&1; then skip "$name is installed on this machine"; fi

# Later mounts are gone when this script ends.
if [[ -z ${OWN_MOUNTS:-} ]]; then
  unshare --mount true || skip "nothing can be mounted here"
  OWN_MOUNTS=yes exec unshare --mount "${BASH_SOURCE[0]}" "$name" "$folder"
fi
copy=$(mktemp -d)
trap 'umount --recursive --lazy "$copy" 2>/dev/null || true; rmdir "$copy"' EXIT
mount -t tmpfs -o mode=755 none "$copy" || skip "nothing can be mounted here"
mkdir "$copy/changed" "$copy/work" "$copy/root"
mount -t overlay -o "lowerdir=/,upperdir=$copy/changed,workdir=$copy/work" none "$copy/root" ||
  skip "there is no overlayfs here"
mount -t proc none "$copy/root/proc"
mount --bind /dev "$copy/root/dev"
in_copy() { chroot "$copy/root" env LC_ALL=C DEBIAN_FRONTEND=noninteractive "$@"; }

# use_modelling, use_linuxcnc: a small task that also needs the libraries.
use_modelling() {
  cp "$here/../../config/examples/structure.toml" "$copy/root/tried.toml"
  in_copy thermocomp-modelling structure /tried.toml -o /tried.model >/dev/null &&
    grep -q '^matrix_um_per_K' "$copy/root/tried.model" || return
  # Loads the module that reads meshes.
  cp "$here/../integration/cli/cube/cube.msh" "$copy/root/tried.msh"
  sed 's/cube\.msh/tried.msh/' "$here/../integration/cli/cube/cube.toml" > "$copy/root/tried.toml"
  in_copy thermocomp-modelling structure /tried.toml -o /tried.model >/dev/null &&
    grep -qF '[1.1' "$copy/root/tried.model"
}
use_linuxcnc() {
  in_copy thermocomp-linuxcnc hal --way joint --axes x=0,z=2 > "$copy/root/tried.hal" &&
    grep -q 'loadusr.* thermocomp-linuxcnc' "$copy/root/tried.hal"
}

cp "$package" "$copy/root/tried.deb"
if ! in_copy dpkg -i /tried.deb > "$copy/log" 2>&1; then
  missing=$(grep -oE 'Package [^ ]+ is not installed' "$copy/log" | cut -d ' ' -f 2 | xargs || true)
  [[ -z $missing ]] || skip "$name needs packages that are not installed here: $missing"
  cat "$copy/log"
  fail "cannot be installed"
fi
in_copy "$name" --help | grep 'Usage: ' > /dev/null || fail "does not show its help"
"use_${name#thermocomp-}" || fail "does not do its work"
in_copy dpkg -P "$name" > "$copy/log" 2>&1 || { cat "$copy/log" && fail "cannot be purged"; }

rm -f "$copy"/root/tried.*
left=$(cd "$copy/changed" && find . -mindepth 1 | while read -r path; do
  case $path in
    ./var/lib/dpkg/* | ./var/log/* | ./var/cache/*) ;;  # of dpkg itself and its triggers
    ./etc/fltk* | ./root/.fltk*) ;;  # written by FLTK when Gmsh reads its options
    *) [[ -d $path && -d /$path ]] || echo "$path" ;;
  esac
done)
[[ -z $left ]] || fail "left behind: $left"
echo "$name: installed, used, purged; nothing is left"
