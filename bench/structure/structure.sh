#!/bin/sh
# Structure to block matrix: time and memory compared with CalculiX on the same mesh and blocks (about
# 50,000 nodes; CalculiX solves the eight blocks as eight steps), the adjoint compared with solving block by
# block, and 200,000 nodes alone. Needs CalculiX (ccx); takes some minutes.
set -eu
program=$THERMOCOMP_BENCH_BUILD/bin/bench_structure
command -v ccx >/dev/null || { echo "bench/structure/structure.sh: CalculiX (ccx) is not installed" >&2; exit 2; }

# show PREFIX LINES: the figures, with the mesh's name.
show() { sed "s/^/$1_/"; }

small=$("$program" tet4 15 15 21 calculix direct)
quadratic=$("$program" tet10 20 20 90 calculix direct)
large=$("$program" tet10 20 20 19.9)
echo "$small" | show tet4_50k
echo "$large" | show tet10_200k
echo "$quadratic"
echo "$quadratic" | grep '^time_over_calculix'
