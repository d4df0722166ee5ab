#!/bin/bash
# run_can_cases.sh BIN: every case that has a CAN bus, one after the other, on vcan0.
here=$(dirname "$0")
export THERMOCOMP_BIN=$1
failed=0
for folder in $(cd "$here" && grep -lE '^can ' ./*/device.txt | xargs -n1 dirname); do
  echo "==== $folder"
  /usr/bin/python3 "$here/run_field.py" "$here/$folder" || { echo "FAILED $folder"; failed=1; }
done
exit $failed
