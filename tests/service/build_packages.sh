#!/bin/bash
# build_packages.sh SOURCE FOLDER [JOBS]
#
# Builds the Debian packages of the tree SOURCE by dpkg-buildpackage, in FOLDER/source, so that SOURCE
# stays as it is; the packages are in FOLDER afterwards. A second run compiles what has changed.
# ccache is used where it is installed. Exit status: dpkg-buildpackage's.
set -euo pipefail
source_tree=$(cd -- "${1:?the source tree}" && pwd)
mkdir -p "${2:?a folder}"
folder=$(cd -- "$2" && pwd)
jobs=${3:-$(nproc)}

copy=$folder/source
mkdir -p "$copy"
# Objects stay, and with the files' own times they are still up to date.
find "$copy" -mindepth 1 -maxdepth 1 ! -name build -exec rm -rf {} +
tar -C "$source_tree" --exclude=./build --exclude=./.git --exclude=./demo_output -cf - . |
  tar -C "$copy" -xf -
rm -f "$folder"/*.deb "$folder"/*.changes "$folder"/*.buildinfo

# debhelper gives the build a home of its own, where ccache would find nothing.
export CCACHE_DIR=${CCACHE_DIR:-$HOME/.cache/ccache}
# Symbols for a debugger cost time and are in packages of their own, which no test installs; the
# programs are the same without.
export DEB_BUILD_OPTIONS="nocheck noautodbgsym parallel=$jobs"
cd -- "$copy"
dpkg-buildpackage -b -uc -us -nc
