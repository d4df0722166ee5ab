#!/bin/bash
# build_packages.sh SOURCE FOLDER [JOBS]
#
# Builds the Debian packages of the tree SOURCE with dpkg-buildpackage in FOLDER/source, without changing
# SOURCE; the packages are then in FOLDER. A second run compiles only changes. Uses ccache if installed.
# Exit status: dpkg-buildpackage's.
set -euo pipefail
source_tree=$(cd -- "${1:?the source tree}" && pwd)
mkdir -p "${2:?a folder}"
folder=$(cd -- "$2" && pwd)
jobs=${3:-$(nproc)}

copy=$folder/source
mkdir -p "$copy"
# Objects stay; with the original time stamps they remain up to date.
find "$copy" -mindepth 1 -maxdepth 1 ! -name build -exec rm -rf {} +
tar -C "$source_tree" --exclude=./build --exclude=./.git --exclude=./demo_output -cf - . |
  tar -C "$copy" -xf -
rm -f "$folder"/*.deb "$folder"/*.changes "$folder"/*.buildinfo

# debhelper sets another home folder, in which ccache would find nothing.
export CCACHE_DIR=${CCACHE_DIR:-$HOME/.cache/ccache}
# Separate packages of debug symbols take time, and no test installs them.
export DEB_BUILD_OPTIONS="nocheck noautodbgsym parallel=$jobs"
cd -- "$copy"
dpkg-buildpackage -b -uc -us -nc
