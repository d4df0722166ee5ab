#!/bin/sh
# Two hundred machine-nights as a Slurm job array on a slurmctld, two slurmd and a PostgreSQL of their own: whole;
# with tasks cancelled and a node killed, until all is done; and by `thermocomp-fleet night -j 2`. Every night must be
# written once, and with the same result. Needs root: a node is a namespace of processes, so that it can die at once.
set -eu
if ! command -v slurmctld slurmd sbatch munged unshare >/dev/null || [ "$(id -u)" -ne 0 ]; then
  echo "fleet_slurm: skipped: needs root and the packages slurm-wlm and munge" >&2
  exit 77
fi
export THERMOCOMP_BIN="$THERMOCOMP_BENCH_BUILD/bin"
exec /usr/bin/python3 "$(dirname "$0")/fleet_slurm.py"
