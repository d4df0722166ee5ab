#!/bin/sh
# The pages for a machine's owner: the report of a week from its history, and tests of thermal behaviour
# (environment, spindle before and after, axis, and from the history's probings). How long they take and how
# large they are; where chromium is, also that each is drawn without an error. REPORT_PAGES names a folder
# that keeps pages and pictures.
set -eu
export THERMOCOMP_BIN="$THERMOCOMP_BENCH_BUILD/bin"
exec /usr/bin/python3 "$(dirname "$0")/report.py" ${REPORT_PAGES:+--keep "$REPORT_PAGES"}
