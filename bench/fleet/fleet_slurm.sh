#!/bin/sh
# Two hundred machine-nights as a Slurm job array on private slurmctld, two slurmd and PostgreSQL; by
# `thermocomp-fleet night -j 2`; and as an array with cancelled tasks and a dying node. Every night must be
# written once, with the same result. Needs root: a node is a process namespace that can be killed at once.
set -eu
for program in slurmctld slurmd sbatch munged; do
  if ! command -v "$program" >/dev/null || [ "$(id -u)" -ne 0 ]; then
    echo "fleet_slurm: skipped: needs root and the packages slurm-wlm and munge" >&2
    exit 77
  fi
done
export THERMOCOMP_BIN="$THERMOCOMP_BENCH_BUILD/bin"
exec /usr/bin/python3 "$(dirname "$0")/fleet_slurm.py"
