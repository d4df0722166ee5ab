#!/usr/bin/env bash
# The spindle data: four sensors per channel, chosen and fitted on hours 0 to 24.1, compared with the static
# model of all 16 sensors, on the later hours.
set -euo pipefail
data=$THERMOCOMP_DATA/spindle_46h
run=$data/hours_00_32.csv
tool=$THERMOCOMP_BENCH_BUILD/bin/thermocomp
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
rms() {
  "$tool" predict --model "$1" "$run@86760:" -o "$out/p.csv" 2>&1 |
    awk -v c="$2" '$1 == c { print $2 }'
}
# Arguments: channel, name of the figure, options of fit.
fitted() {
  local channel=$1 name=$2
  shift 2
  "$tool" fit "$run@:86760" --outputs "$channel" --terms 4 "$@" -o "$out/m.toml" > "$out/said"
  echo "${name}_$channel $(rms "$out/m.toml" "$channel") um"
}
for channel in ch1_um ch2_um ch3_um ch4_um ch5_um; do
  echo "static_model_$channel $(rms "$data/static_model.toml" $channel) um"
  fitted $channel four_sensors
  fitted $channel four_sensors_lags --lags
  # Choice from the fitted hours alone.
  fitted $channel four_sensors_no_error --sensor-error-K 0
  fitted $channel four_sensors_lags_no_error --lags --sensor-error-K 0
done
