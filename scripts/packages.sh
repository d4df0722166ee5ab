# shellcheck shell=bash disable=SC2034
# The Debian 12 packages by purpose. Sourced by setup.sh; packages are named only here.

# To build and run the daemon, its command and the simulated machine.
packages_machine=(
  cmake ninja-build g++ pkg-config
  libeigen3-dev libmodbus-dev libspdlog-dev libtomlplusplus-dev nlohmann-json3-dev
  libsqlite3-dev libsystemd-dev libssl-dev libcrypt-dev libcli11-dev
)

# All programs that run on the machine's computer.
packages_build=(
  "${packages_machine[@]}" ccache
  # thermocomp-gateway; the last is for the charts of its page.
  libmicrohttpd-dev libmosquitto-dev zlib1g-dev libjs-dygraphs
  # thermocomp-fleet and thermocomp-uplink.
  libpqxx-dev
)

# Additionally for thermocomp-modelling. OpenBLAS: a factorisation takes several times as long with the
# reference BLAS.
packages_modelling=("${packages_build[@]}" libsuitesparse-dev libopenblas-dev libgmsh-dev
  libjs-three)

# Additionally for meshes too large for a factorisation in memory: thermocomp-petsc. Too large to be
# required; tests include it if installed.
packages_petsc=("${packages_modelling[@]}" libpetsc-real-dev)

# The demo builds its programs and draws a plot.
packages_demo=("${packages_machine[@]}" gnuplot-nox)

# ./demo.sh fleet: the store, its server, and the simulated machines of bench/series.
packages_demo_fleet=("${packages_demo[@]}" libpqxx-dev postgresql postgresql-client openssl python3-numpy)

# Other projects' software used by the tests.
packages_test=(
  "${packages_demo[@]}" "${packages_modelling[@]}" catch2
  # Reference for the finite elements; reference for test plans.
  calculix-ccx python3-allpairspy
  mbpoll can-utils python3-pymodbus python3-serial-asyncio python3-can python3-canmatrix
  python3-numpy python3-pytest python3-meshio
  # Clients of the gateway's metrics and messages.
  prometheus mosquitto mosquitto-clients openssl
  sqlite3 socat user-mode-linux kmod iproute2 procps man-db groff-base
  # The real controller of tests/linuxcnc, and headers for its bridge.
  linuxcnc-uspace linuxcnc-uspace-dev
)

# Additionally for what runs before a merge: ./test.sh --packages, other builds than the release, static checks.
packages_checks=(
  "${packages_test[@]}"
  # Clients of the pages, the store of a series.
  chromium chromium-driver python3-selenium postgresql postgresql-client
  clang-tidy clang-tools clang-format gcovr
  # The fuzz targets: the compiler, libFuzzer and the sanitizers' runtime.
  clang libclang-rt-14-dev
  # Sanitizer builds on real CAN, with the kernel from guest-kernel.sh.
  qemu-system-x86 busybox-static
  # The Debian packages, and the booted systemd for their tests.
  debhelper lintian mmdebstrap systemd-container
)

# Peers and counters of bench/run.sh, and the cluster of fleet_slurm; too large for the tests.
packages_bench=("${packages_checks[@]}" valgrind rt-tests python3-sklearn python3-scipy slurm-wlm munge)
