# shellcheck shell=bash disable=SC2034
# The Debian 12 packages, by what they are for. Sourced by setup.sh; nothing else names a package.

# What the daemon, its command and the simulated machine are built from and need to run.
packages_machine=(
  cmake ninja-build g++ pkg-config
  libeigen3-dev libmodbus-dev libspdlog-dev libtomlplusplus-dev nlohmann-json3-dev
  libsqlite3-dev libsystemd-dev libssl-dev libcli11-dev
)

# All programs that run beside the machine.
packages_build=(
  "${packages_machine[@]}" ccache
  # Of thermocomp-gateway; its page takes its charts from the last.
  libmicrohttpd-dev libmosquitto-dev libcrypt-dev zlib1g-dev libjs-dygraphs
  # Of thermocomp-fleet and thermocomp-uplink.
  libpqxx-dev
)

# Besides, for thermocomp-modelling. OpenBLAS: with the reference BLAS a factorisation takes
# several times as long.
packages_modelling=("${packages_build[@]}" libsuitesparse-dev libopenblas-dev libgmsh-dev
  libjs-three)

# Besides, for meshes past the memory of a factorisation: thermocomp-petsc. Not part of the tests,
# being large; they include it where it is there.
packages_petsc=("${packages_modelling[@]}" libpetsc-real-dev)

# The demo builds what it runs, and draws a picture of itself.
packages_demo=("${packages_machine[@]}" gnuplot-nox)

# ./demo.sh fleet: the store, its server, and the simulated machines of bench/series.
packages_demo_fleet=("${packages_demo[@]}" libpqxx-dev postgresql postgresql-client openssl python3-numpy)

# Software that is not ours and that the tests talk to, and the tools of the checks.
packages_test=(
  "${packages_demo[@]}" "${packages_modelling[@]}" catch2
  # The finite elements are compared with it; test plans with the other.
  calculix-ccx python3-allpairspy
  mbpoll can-utils python3-pymodbus python3-serial-asyncio python3-can python3-canmatrix
  python3-numpy python3-pytest python3-meshio
  # What the gateway is read by: its page, metrics and messages.
  chromium chromium-driver python3-selenium prometheus mosquitto mosquitto-clients openssl
  # The store of a series.
  postgresql postgresql-client
  sqlite3 socat rt-tests user-mode-linux kmod iproute2 procps valgrind
  clang-tidy clang-tools clang-format gcovr
  # The fuzz targets: the compiler, libFuzzer and the sanitizers' runtime.
  clang libclang-rt-14-dev
  # Sanitizer builds on real CAN, with the kernel that guest-kernel.sh fetches.
  qemu-system-x86 busybox-static
  # The real controller of tests/linuxcnc, and what its bridge is built with.
  linuxcnc-uspace linuxcnc-uspace-dev
  # The Debian packages, and the booted systemd that they are tested in.
  debhelper lintian mmdebstrap systemd-container man-db groff-base
)

# Peers of bench/run.sh measured, and the cluster of fleet_slurm; not part of the tests, being large.
packages_bench=("${packages_test[@]}" python3-sklearn slurm-wlm munge)
