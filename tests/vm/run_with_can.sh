#!/bin/bash
# run_with_can.sh [--emulated] [--timeout S] COMMAND [ARGUMENT...]
#
# Runs COMMAND with working AF_CAN and vcan0 and vcan1 up: on the host, in a network namespace, if kernel
# and permissions allow; else in a guest (run_in_vm.sh, which explains --emulated). Exit status: COMMAND's
# or run_in_vm.sh's.
set -u

here=$(cd "$(dirname "$0")" && pwd)
options=()
while [ $# -gt 0 ]; do
  case $1 in
    --emulated) options+=(--emulated); shift ;;
    --timeout) options+=(--timeout "${2:?--timeout needs seconds}"); shift 2 ;;
    *) break ;;
  esac
done
[ $# -gt 0 ] || { sed -n 2p "$0" | cut -c3- >&2; exit 125; }
PATH=$PATH:/usr/local/sbin:/usr/sbin:/sbin

# shellcheck disable=SC2016
make_interfaces='ip link set lo up && for i in vcan0 vcan1; do
  ip link add dev $i type vcan && ip link set $i up || exit 1; done'
if unshare --net sh -c "($make_interfaces) && cansend vcan0 001#" > /dev/null 2>&1; then
  echo "run_with_can.sh: this kernel has CAN; running on the host" >&2
  exec unshare --net sh -c "($make_interfaces) && exec \"\$@\"" sh "$@"
fi
exec "$here/run_in_vm.sh" --times "${options[@]}" "$@"
