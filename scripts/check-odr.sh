#!/bin/bash
# Links every program with type information: a name with two definitions is an error.
#   scripts/check-odr.sh
set -euo pipefail
cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.."
source scripts/common.sh
cmake --preset odr && cmake --build --preset odr -j "$(build_jobs)"
