#!/bin/bash
# check_packages.sh SOURCE FOLDER: builds the packages of SOURCE in FOLDER/packages (build_packages.sh) and
# the root file system for their tests (build_rootfs.sh, as root); lintian must report no error or warning.
# Prints the sizes. Exit status 77, with the reason, if this machine cannot do it.
set -euo pipefail
here=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")" && pwd)
source_tree=${1:?the source tree} folder=${2:?a folder}
for tool in dpkg-buildpackage dh lintian mmdebstrap; do
  if ! command -v "$tool" >/dev/null; then
    echo "check_packages.sh: skipped: $tool is missing (scripts/setup.sh checks)"
    exit 77
  fi
done
mkdir -p "$folder"
packages=$folder/packages

began=$SECONDS
if ! nice -n 10 "$here/build_packages.sh" "$source_tree" "$packages" > "$folder/packages.log" 2>&1; then
  tail -n 60 "$folder/packages.log"
  exit 1
fi
echo "packages built in $((SECONDS - began)) s"

lintian --allow-root --fail-on error,warning --tag-display-limit 0 "$packages"/*.changes
echo "lintian: no error, no warning"

# depends_of PACKAGE...: names of their dependencies outside this project.
depends_of() {
  local name
  for name in "$@"; do dpkg-deb -f "$packages/$name"_*.deb Depends; done |
    tr ',' '\n' | sed 's/|.*//; s/(.*//; s/ //g' | sort -u | grep -v '^thermocomp'
}
fail() {
  echo "check_packages.sh: $*" >&2
  exit 1
}

# The packages for the machine stay small, and no file is in two packages.
beside_machine=$(depends_of thermocomp thermocomp-simulator)
for library in gmsh cholmod blas occt linuxcnc; do
  [[ $beside_machine != *"$library"* ]] || fail "the daemon's packages depend on $library"
done
twice=$(for file in "$packages"/*.deb; do
  dpkg-deb --fsys-tarfile "$file" | tar -t | grep -v '/$'
done | sort | uniq -d)
[[ -z $twice ]] || fail "in more than one package: $twice"
# Gmsh and CHOLMOD are linked only by modules, but the package must depend on them.
for library in gmsh cholmod; do
  [[ $(depends_of thermocomp-modelling) == *"lib$library"* ]] ||
    fail "$library does not come with the package"
done

# Unpacked rather than installed, because of its large dependencies: it runs, and the command finds it.
unpacked=$folder/unpacked
rm -rf "$unpacked"
for name in thermocomp thermocomp-modelling; do
  dpkg-deb -x "$packages/$name"_*.deb "$unpacked"
done
for command in structure place diagnose; do
  "$unpacked/usr/bin/thermocomp" "$command" --help > "$folder/help" ||
    fail "thermocomp $command cannot be carried out"
  grep -q 'Usage: thermocomp-modelling ' "$folder/help" || fail "no help of $command"
  if grep -q 'not in this build' "$folder/help"; then fail "$command was left out"; fi
done
if objdump -p "$unpacked/usr/bin/thermocomp-modelling" | grep -E 'NEEDED .*(gmsh|cholmod|blas)'; then
  fail "thermocomp-modelling loads at every start what few commands need"
fi
echo "thermocomp-modelling: structure, place, diagnose"

if [[ $(id -u) -eq 0 ]]; then
  # shellcheck disable=SC2046,SC2086
  "$here/build_rootfs.sh" "$folder" $beside_machine -- $(depends_of thermocomp-modelling) \
    -- $(depends_of thermocomp-gateway thermocomp-uplink thermocomp-fleet) postgresql
fi

for file in "$packages"/*.deb; do
  printf '%-28s %8d kB to fetch %8d KiB installed\n' "$(dpkg-deb -f "$file" Package)" \
    "$(($(stat -c %s "$file") / 1000))" "$(dpkg-deb -f "$file" Installed-Size)"
done
if [[ -s $folder/dependencies ]]; then
  own=$(dpkg-deb -f "$packages"/thermocomp_*.deb Installed-Size)
  awk -v own="$own" '{ text = text " " $1; sum += $2 } END {
    printf "on a minimal Debian with systemd thermocomp needs besides:%s, %d KiB; together %.1f MB\n",
      text, sum, (sum + own) * 1.024 / 1000 }' "$folder/dependencies"
fi
if [[ -s $folder/asked ]]; then
  echo "beside thermocomp's, thermocomp-modelling needs:"
  cat "$folder/asked"
fi
