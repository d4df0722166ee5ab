#!/bin/bash
# run_in_systemd.sh nspawn|uml ROOTFS FILES COMMAND...
#
# Boots systemd on a temporary overlay of ROOTFS and runs COMMAND in it as root, last in the boot, with the
# folder FILES as /opt/service-test and working directory. nspawn: a container with the host's kernel. uml:
# User Mode Linux, a kernel with CAN; its modules are loaded and the interface vcan0 is up. COMMAND's output
# is printed at its end.
#
# Exit status: COMMAND's; 124 after SERVICE_TEST_S seconds (default 300); 125 if systemd did not come up.
# Needs root.
# shellcheck disable=SC2015,SC2317  # fail never returns; functions are called by name
set -u
kind=${1:?nspawn or uml}
rootfs=$(realpath -- "${2:?the root file system}")
files=$(realpath -- "${3:?the folder of files}")
shift 3
limit_s=${SERVICE_TEST_S:-300}
vm=$(dirname -- "$(realpath -- "${BASH_SOURCE[0]}")")/../vm
fail() {
  echo "run_in_systemd.sh: $*" >&2
  exit 125
}

if [[ ${SERVICE_TEST_NAMESPACE:-} != own ]]; then
  # Own namespace: mounts and cgroups of nspawn end with this script.
  export SERVICE_TEST_NAMESPACE=own
  exec unshare --mount --propagation private -- "$0" "$kind" "$rootfs" "$files" "$@"
fi

work=$(mktemp -d "${TMPDIR:-/tmp}/thermocomp-service.XXXXXX") || fail "no temporary folder"
cgroup=
clean_up() {
  umount -q "$work/memory/root" "$work/memory" 2>/dev/null
  rm -rf "$work"
  if [[ -n $cgroup ]]; then
    echo $$ > /sys/fs/cgroup/cgroup.procs
    find "$cgroup" -depth -type d -exec rmdir {} + 2>/dev/null
  fi
}
trap clean_up EXIT
trap 'exit 125' HUP INT TERM
mkdir "$work/memory" && mount -t tmpfs -o size=768M tmpfs "$work/memory" || fail "no tmpfs"
root=$work/memory/root
mkdir "$work/memory/upper" "$work/memory/work" "$root"
mount -t overlay overlay -o "lowerdir=$rootfs,upperdir=$work/memory/upper,workdir=$work/memory/work" \
  "$root" || fail "no overlay"

place=$root/opt/service-test
mkdir -p "$place" && cp -a "$files/." "$place/" || fail "the files cannot be copied"
{
  echo '#!/bin/bash'
  echo 'cd /opt/service-test'
  if [[ $kind == uml ]]; then
    # shellcheck disable=SC2016
    echo 'for module in can can-raw can-bcm can-dev vcan; do
      insmod "/opt/service-test/modules/$module.ko"
    done
    sysctl -q kernel.sched_rt_runtime_us=-1
    # On hostfs every new file belongs to root.
    mount -t tmpfs tmpfs /mnt && cp -a /var/lib/. /mnt/ && mount --bind /mnt /var/lib
    ip link add dev vcan0 type vcan && ip link set vcan0 up'
  fi
  printf '%q ' "$@"
  echo '> output 2>&1'
  echo 'echo $? > status'
} > "$place/run"
chmod 755 "$place/run"
cat > "$root/etc/systemd/system/service-test.service" <<'UNIT'
[Unit]
Description=Service test
After=multi-user.target
SuccessAction=poweroff-force
FailureAction=poweroff-force

[Service]
Type=oneshot
ExecStart=/opt/service-test/run
TimeoutStartSec=infinity
UNIT
mkdir -p "$root/etc/systemd/system/multi-user.target.wants"
ln -s ../service-test.service "$root/etc/systemd/system/multi-user.target.wants/"

boot_nspawn() {
  # A cgroup tree for the guest, independent of the host's.
  umount -R /sys/fs/cgroup 2>/dev/null
  mount -t cgroup2 cgroup2 /sys/fs/cgroup || fail "no cgroup2"
  cgroup=/sys/fs/cgroup/thermocomp-service-$$
  mkdir "$cgroup" && echo $$ > "$cgroup/cgroup.procs" || fail "no cgroup"
  # SCHED_FIFO and locked memory need capabilities that containers lack by default.
  timeout --foreground -k 5 "$limit_s" systemd-nspawn --quiet --register=no --keep-unit \
    --machine="service-test-$$" --directory="$root" --private-network \
    --capability=CAP_IPC_LOCK,CAP_SYS_NICE --boot systemd.show_status=0 \
    < /dev/null > "$work/console" 2>&1
}

boot_uml() {
  local memory_place=/dev/shm
  mkdir "$place/modules"
  find /usr/lib/uml/modules \( -name can.ko -o -name can-raw.ko -o -name can-bcm.ko \
    -o -name can-dev.ko -o -name vcan.ko \) -exec cp {} "$place/modules/" \; ||
    fail "the modules of user-mode-linux"
  [[ -w $memory_place ]] || memory_place=$work
  c++ -std=c++20 -O2 -shared -fPIC -o "$work/whole_registers.so" "$vm/whole_registers.cpp" ||
    fail "whole_registers.cpp could not be built"
  LD_PRELOAD=$work/whole_registers.so TMPDIR=$memory_place \
    timeout --foreground -k 5 "$limit_s" linux.uml mem=768M rootfstype=hostfs "rootflags=$root" rw \
    con=null con0=null,fd:1 ssl=pts quiet loglevel=3 noreboot "uml_dir=$work" umid=guest \
    systemd.show_status=0 init=/sbin/init < /dev/null > "$work/console" 2>&1
}

status=0
"boot_$kind" || status=$?
cat "$place/output" 2>/dev/null
if [[ ! -s $place/status ]]; then
  ((status == 124)) && { echo "run_in_systemd.sh: not over after $limit_s s" >&2; exit 124; }
  echo "run_in_systemd.sh: the guest ended without a result (status $status); its console:" >&2
  tail -n 40 "$work/console" >&2
  exit 125
fi
exit "$(cat "$place/status")"
