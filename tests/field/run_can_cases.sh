#!/bin/bash
# run_can_cases.sh BIN: all cases with a CAN bus, four at a time, each on its own interface.
here=$(cd "$(dirname "$0")" && pwd)
bin=$(realpath "$1")
if [ $# -eq 1 ]; then
  cd "$here" && grep -lE '^can ' ./*/device.txt | xargs -n1 dirname | xargs -P4 -I{} "$here/run_can_cases.sh" "$bin" {}
  exit
fi
export THERMOCOMP_BIN=$bin
THERMOCOMP_CAN=v$(cksum <<< "$2" | cut -d' ' -f1)
export THERMOCOMP_CAN
ip link add dev "$THERMOCOMP_CAN" type vcan && ip link set "$THERMOCOMP_CAN" up || exit 1
failed=0
said=$(/usr/bin/python3 "$here/run_field.py" "$here/$2" 2>&1) || failed=1
[ $failed = 0 ] || echo "FAILED $2"
printf '==== %s\n%s\n' "$2" "$said"
exit $failed
