#!/bin/bash
# expect_counted.sh PROGRAM FOLDER: passes if running PROGRAM leaves line counts under FOLDER.
set -euo pipefail
find "$2" -name '*.gcda' -delete
"$1" none
find "$2" -name 'planted_fault*.gcda' | grep .
