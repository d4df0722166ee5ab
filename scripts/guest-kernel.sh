#!/bin/bash
# Provides Debian's kernel with CAN modules for the tests under QEMU (tests/vm): unpacked into a folder and
# not installed, so that boot loaders ignore it.
#   scripts/guest-kernel.sh [FOLDER]      default: build/guest-kernel
# Downloads about 70 MB with apt-get, which checks the signature. Does nothing if the folder is complete.
# Exit status 0: FOLDER/vmlinux, FOLDER/lib/modules/VERSION and FOLDER/version exist.
set -euo pipefail
cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.."
folder=${1:-build/guest-kernel}

fail() {
  echo "guest-kernel: $*" >&2
  exit 1
}

# The package on which linux-image-amd64 depends; empty without package lists.
kernel_package() {
  apt-cache depends --no-recommends --no-suggests linux-image-amd64 2>/dev/null |
    sed -n 's/^ *Depends: \(linux-image-[0-9].*\)$/\1/p' | head -n 1
}

download() {
  local package
  package=$(kernel_package)
  [[ -n $package ]] || return 1
  (cd "$1" && apt-get -q -o APT::Sandbox::User= download "$package" >apt.log 2>&1)
}

as_root() {
  if [[ $(id -u) -eq 0 ]]; then "$@"; else sudo "$@"; fi
}

# The compressed ELF file within a bzImage; the offsets are those of the kernel's boot protocol.
unpack_kernel() {
  /usr/bin/python3 - "$1" "$2" <<'PYTHON'
import lzma, struct, sys

image = open(sys.argv[1], "rb").read()
if image[0x202:0x206] != b"HdrS":
    sys.exit("guest-kernel: not a bzImage")
setup_sectors = image[0x1F1] or 4
offset, length = struct.unpack_from("<II", image, 0x248)
begin = 512 * (setup_sectors + 1) + offset
# xz, then the length of what is packed.
elf = lzma.LZMADecompressor().decompress(image[begin:begin + length])
if elf[:4] != b"\x7fELF":
    sys.exit("guest-kernel: the payload is not an ELF file")
open(sys.argv[2], "wb").write(elf)
PYTHON
}

if [[ -s $folder/version && -s $folder/vmlinux ]]; then
  echo "guest-kernel: $(cat "$folder/version") is there"
  exit 0
fi
mkdir -p "$(dirname "$folder")"
work=$(mktemp -d "$folder.XXXXXX")
trap 'rm -rf "$work"' EXIT
chmod 755 "$work"
if ! download "$work"; then
  echo "guest-kernel: fetching the package lists (apt-get update)"
  { as_root apt-get -q update >"$work/apt.log" 2>&1 && download "$work"; } ||
    fail "linux-image-amd64 cannot be downloaded: $(tail -n 3 "$work/apt.log" 2>/dev/null)"
fi

modules='lib/modules/*/kernel'
dpkg-deb --fsys-tarfile "$work"/linux-image-*.deb | tar -x -C "$work" --wildcards \
  './boot/vmlinuz-*' './lib/modules/*/modules.*' "./$modules/net/can*" \
  "./$modules/drivers/net/can*" "./$modules/net/9p*" "./$modules/fs/9p*" "./$modules/fs/netfs*" \
  "./$modules/fs/fscache*" "./$modules/drivers/virtio*"
version=$(basename "$work"/lib/modules/*)
depmod -b "$work" "$version" || fail "depmod failed"
unpack_kernel "$work"/boot/vmlinuz-* "$work/vmlinux" || fail "the kernel could not be unpacked"
rm -rf "${work:?}"/*.deb "${work:?}/boot" "${work:?}/apt.log"
echo "$version" >"$work/version"
rm -rf "$folder"
mv "$work" "$folder"
echo "guest-kernel: $version ($(du -sm "$folder" | cut -f1) MB) in $folder"
