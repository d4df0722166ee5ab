#!/bin/sh
# A million nodes by PETSc on one and on two MPI ranks: time and memory. Needs 24 GB of memory, 3 GB in
# TMPDIR, the packages of `scripts/setup.sh petsc`, and two idle processors (MPI's ranks wait actively).
# Also 50,000 nodes compared with the factorisation.
set -eu
program=$THERMOCOMP_BENCH_BUILD/bin/bench_structure
if [ ! -x "$THERMOCOMP_BENCH_BUILD/bin/thermocomp-petsc" ]; then
  echo "bench/structure/structure_large.sh: thermocomp-petsc was not built; scripts/setup.sh petsc" >&2
  exit 2
fi
"$program" tet10 20 20 65 petsc1 petsc2
"$program" tet10 10 10 14 petsc1 petsc2 petsc_alone
