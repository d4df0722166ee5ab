#!/usr/bin/env bash
# A new machine with 1, 3 and 10 probed hours: its own fit, the mean of its type, and both, on simulated
# machines and measured unrelated ones; and machines that depart, with false alarms.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
tool=$THERMOCOMP_BENCH_BUILD/bin/thermocomp
/usr/bin/python3 "$here/departures.py" "$tool"
/usr/bin/python3 "$here/series.py" "$tool" --data "$THERMOCOMP_DATA"
