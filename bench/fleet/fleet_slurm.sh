#!/bin/sh
# Two hundred machine-nights as a Slurm job array on a slurmctld, two slurmd and a PostgreSQL of their own; by
# `thermocomp-fleet night -j 2`; and as an array whose tasks are cancelled and whose node dies. Every night must be
# written once, and with the same result. Needs root: a node is a namespace of processes, so that it can die at once.
set -eu
for program in slurmctld slurmd sbatch munged; do
  if ! command -v "$program" >/dev/null || [ "$(id -u)" -ne 0 ]; then
    echo "fleet_slurm: skipped: needs root and the packages slurm-wlm and munge" >&2
    exit 77
  fi
done
export THERMOCOMP_BIN="$THERMOCOMP_BENCH_BUILD/bin"
exec /usr/bin/python3 "$(dirname "$0")/fleet_slurm.py"
