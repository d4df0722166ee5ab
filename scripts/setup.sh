#!/bin/bash
# Lists and installs the missing Debian packages.
#   scripts/setup.sh build|modelling|petsc|demo|demo_fleet|test|checks|bench
# Needs root or sudo only if packages are missing. Exit status 0: all are installed.
set -euo pipefail
here=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")" && pwd)
# shellcheck source=packages.sh
source "$here/packages.sh"

fail() {
  echo "setup: $*" >&2
  exit 1
}

# Packages that dpkg does not list as installed, one per line.
missing_packages() {
  # An unknown name is an error of dpkg-query, and missing.
  comm -13 <(dpkg-query -W -f '${db:Status-Status} ${Package}\n' "$@" 2>/dev/null | sed -n 's/^installed //p' | sort -u) \
    <(printf '%s\n' "$@" | sort -u)
}

# Runs a command as root: directly, or through sudo.
as_root() {
  if [[ $(id -u) -eq 0 ]]; then
    "$@"
  else
    sudo "$@"
  fi
}

apt_get() {
  as_root env DEBIAN_FRONTEND=noninteractive apt-get -q -o DPkg::Lock::Timeout=600 \
    -o Dpkg::Use-Pty=0 "$@"
}

# Package lists are updated only if the installation fails with the existing ones: a fresh system has none,
# an old one's name files that are gone.
install_packages() {
  # Simulated first, to avoid pages of "unable to locate".
  if apt_get install -y --no-install-recommends --simulate "$@" >/dev/null 2>&1 &&
    apt_get install -y --no-install-recommends "$@"; then
    return 0
  fi
  echo "setup: fetching the package lists (apt-get update)"
  apt_get update || return 1
  apt_get install -y --no-install-recommends "$@"
}

main() {
  local wanted
  case ${1:-} in
    build) wanted=("${packages_build[@]}") ;;
    modelling) wanted=("${packages_modelling[@]}") ;;
    petsc) wanted=("${packages_petsc[@]}") ;;
    demo) wanted=("${packages_demo[@]}") ;;
    demo_fleet) wanted=("${packages_demo_fleet[@]}") ;;
    test) wanted=("${packages_test[@]}") ;;
    checks) wanted=("${packages_checks[@]}") ;;
    bench) wanted=("${packages_bench[@]}") ;;
    *)
      echo "usage: setup.sh build|modelling|petsc|demo|demo_fleet|test|checks|bench" >&2
      exit 2
      ;;
  esac
  command -v dpkg-query >/dev/null ||
    fail "this is not a Debian system (no dpkg); the packages are listed in scripts/packages.sh"

  local missing
  mapfile -t missing < <(missing_packages "${wanted[@]}")
  if [[ ${#missing[@]} -eq 0 ]]; then
    echo "setup: all ${#wanted[@]} Debian packages are installed"
    return 0
  fi
  echo "setup: installing ${#missing[@]} Debian packages: ${missing[*]}"
  if [[ $(id -u) -ne 0 ]] && ! command -v sudo >/dev/null; then
    fail "not root and no sudo; as root run: apt-get install ${missing[*]}"
  fi
  install_packages "${missing[@]}" ||
    fail "apt-get could not install the packages (see above); by hand: apt-get install ${missing[*]}"

  mapfile -t missing < <(missing_packages "${wanted[@]}")
  [[ ${#missing[@]} -eq 0 ]] || fail "still missing: ${missing[*]}"
}

main "$@"
