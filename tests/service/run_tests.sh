#!/bin/bash
# run_tests.sh nspawn|uml FOLDER PLANTED_HANG [PYTEST_OPTION...]
#
# Runs the tests of guest/ in a booted systemd, with the packages of build_packages.sh in FOLDER/packages
# and the root file system of build_rootfs.sh in FOLDER. Exit status 77, with the reason, if this machine
# cannot do it.
set -euo pipefail
kind=${1:?nspawn or uml} folder=$(cd -- "${2:?a folder}" && pwd) planted_hang=${3:?planted_hang.so}
shift 3
here=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")" && pwd)
skip() {
  echo "run_tests.sh: skipped: $*"
  exit 77
}
[[ $(id -u) -eq 0 ]] || skip "systemd is booted as root only"
[[ -e $folder/rootfs.stamp ]] || skip "there is no root file system (the test packages makes it)"
case $kind in
  nspawn)
    command -v systemd-nspawn >/dev/null || skip "systemd-container is not installed"
    tests=(test_1_install_and_start.py test_2_survive.py test_3_sandbox.py
      test_4_upgrade_and_remove.py test_5_gateway.py test_6_fleet.py)
    ;;
  uml)
    command -v linux.uml >/dev/null || skip "user-mode-linux is not installed"
    tests=(test_can.py)
    ;;
esac

files=$(mktemp -d)
trap 'rm -rf "$files"' EXIT
chmod 755 "$files"  # the service must read the planted hang
mkdir "$files/packages" "$files/guest"
cp "$folder"/packages/*.deb "$files/packages/"
rm -f "$files"/packages/*-dbgsym_*
cp "$here"/guest/*.py "$here"/../integration/daemon/{lab,modbus_server,plain_devices}.py "$files/guest/"
cp "$here/../../systemd/site.conf" "$files/"
cp "$planted_hang" "$files/planted_hang.so"
"$here/run_in_systemd.sh" "$kind" "$folder/rootfs" "$files" \
  /usr/bin/python3 -m pytest -v -rA -p no:cacheprovider --tb=short "$@" "${tests[@]/#/guest/}"
