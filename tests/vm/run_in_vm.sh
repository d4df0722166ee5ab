#!/bin/bash
# run_in_vm.sh [--emulated] [--timeout S] [--memory SIZE] [--times] COMMAND [ARGUMENT...]
#
# Runs COMMAND as root in a guest with AF_CAN and the virtual CAN interfaces vcan0 and vcan1 up.
# The guest's root file system is the host's own, read-write; working directory and exported variables are
# the caller's; PATH includes the sbin folders. /run, /dev and /dev/shm are the guest's own and empty: for
# sockets and FIFOs. TMPDIR is /dev/shm, because host files seen from a guest cannot serve as temporary
# files (an open file cannot be truncated after its deletion). Any number of guests can run at a time.
#
# The guest is User Mode Linux (package user-mode-linux): as fast as the host except for system calls, one
# CPU; ASan and TSan programs abort in it. Processors with AMX need whole_registers.cpp, which is compiled
# at each boot and preloaded. With --emulated it is Debian's kernel under QEMU (qemu-system-x86,
# busybox-static, scripts/guest-kernel.sh): some five times slower, runs all programs of the host, and has
# two more CAN interfaces, can0 and can1, emulated PCI cards on one bus.
#
# Exit status: COMMAND's; 124 after S seconds (default 300); 125 if the guest did not come up or died.
# --times prints the duration of boot and command to stderr.
set -u

usage() { sed -n '2,4p' "$0" | cut -c3- >&2; exit 125; }
fail() { echo "run_in_vm.sh: $*" >&2; exit 125; }

here=$(cd "$(dirname "$0")" && pwd)
limit_s=300 memory=512M times='' emulated=''
while [ $# -gt 0 ]; do
  case $1 in
    --timeout) limit_s=${2:-}; shift 2 || usage ;;
    --memory) memory=${2:-}; shift 2 || usage ;;
    --times) times=yes; shift ;;
    --emulated) emulated=qemu memory=1G; shift ;;
    --) shift; break ;;
    -*) usage ;;
    *) break ;;
  esac
done
[ $# -gt 0 ] || usage
[[ $limit_s =~ ^[1-9][0-9]*$ ]] || fail "--timeout $limit_s: must be a whole number of seconds"

PATH=$PATH:/usr/local/sbin:/usr/sbin:/sbin
need() { # need TOOL PACKAGE
  command -v "$1" > /dev/null || fail "$1 is missing (apt-get install $2)"
}
need ip iproute2
need insmod kmod
if [ -n "$emulated" ]; then
  need qemu-system-x86_64 qemu-system-x86
  need busybox busybox-static
  kernel=${THERMOCOMP_GUEST_KERNEL:-$here/../../build/guest-kernel}
  [ -s "$kernel/vmlinux" ] || fail "there is no $kernel/vmlinux (scripts/guest-kernel.sh makes it)"
else
  need linux.uml user-mode-linux
  need c++ g++
fi

# The kernel splits its command line at spaces.
place=${TMPDIR:-/tmp}
[[ $place == *[[:space:]]* ]] && place=/tmp
run=$(mktemp -d "$place/thermocomp-vm.XXXXXX") || fail "no temporary folder in $place"
vm_pid=
clean_up() {
  if [ -n "$vm_pid" ]; then kill "$vm_pid" 2> /dev/null; wait "$vm_pid" 2> /dev/null; fi
  rm -rf "$run"
}
trap clean_up EXIT
trap 'exit 125' HUP INT TERM

cp "$here/guest_init.sh" "$run/init" && chmod 755 "$run/init" || fail "no guest_init.sh"
{
  export -p
  echo 'export TMPDIR=/dev/shm'
  # Longer timeouts for emulated programs on a busy machine.
  if [ -n "$emulated" ]; then echo 'export THERMOCOMP_PATIENCE_S=120'; fi
  echo "export THERMOCOMP_VM=${emulated:-user-mode-linux}"
  printf 'cd %q || exit 125\n' "$PWD"
  printf 'exec timeout -k 5 %s' "$limit_s"
  printf ' %q' "$@"
  echo
} > "$run/command"

boot_user_mode_linux() {
  # The guest's memory is a sparse file; on a tmpfs it never reaches a disk.
  local memory_place=/dev/shm needed_kB free_kB
  needed_kB=$(($(numfmt --from=iec "$memory") / 1024))
  free_kB=$(df --output=avail /dev/shm 2> /dev/null | tail -n 1)
  [ "${free_kB:-0}" -gt "$needed_kB" ] || memory_place=$place
  LD_PRELOAD=$run/whole_registers.so TMPDIR=$memory_place \
    exec timeout -k 5 $((limit_s + 60)) linux.uml "mem=$memory" \
    rootfstype=hostfs rootflags=/ rw con=null con0=null,fd:1 quiet loglevel=3 noreboot \
    pty.legacy_count=0 "uml_dir=$run" umid=vm "init=$run/init" "VM_RUN=$run"
}

# Files that the guest needs before it sees the host's.
make_initramfs() {
  local tree=$run/initramfs version module
  version=$(cat "$kernel/version")
  mkdir -p "$tree"/{bin,proc,sys,dev,root,modules}
  cp "$(command -v busybox)" "$tree/bin/busybox" && cp "$here/emulated_init.sh" "$tree/init" &&
    chmod 755 "$tree/init" || return 1
  for module in virtio_pci 9pnet_virtio 9p can-raw can-bcm vcan slcan kvaser_pci; do
    modprobe -d "$kernel" -S "$version" --show-depends "$module" || return 1
  done | awk '$1 == "insmod" && !seen[$2]++ { print $2 }' > "$run/modules"
  while read -r module; do
    cp "$module" "$tree/modules/" && basename "$module" >> "$tree/modules/order" || return 1
  done < "$run/modules"
  (cd "$tree" && find . | busybox cpio -o -H newc > "$run/initramfs.cpio" 2> /dev/null)
}

boot_qemu() {
  local acceleration=tcg,thread=multi
  exec timeout -k 5 $((limit_s + 120)) qemu-system-x86_64 -nodefaults -no-user-config -M pc \
    -accel "$acceleration" -cpu max -smp 2 -m "$memory" -no-reboot -display none -serial stdio \
    -kernel "$kernel/vmlinux" -initrd "$run/initramfs.cpio" \
    -fsdev local,id=host,path=/,security_model=none,multidevs=remap \
    -device virtio-9p-pci,fsdev=host,mount_tag=host \
    -object can-bus,id=bus -device kvaser_pci,canbus=bus -device kvaser_pci,canbus=bus \
    -append "console=ttyS0 quiet panic=-1 mitigations=off nokaslr no_timer_check audit=0 \
apparmor=0 VM_RUN=$run"
}

numfmt --from=iec "$memory" > /dev/null 2>&1 || fail "--memory $memory: must be a size such as 512M"
boot=boot_user_mode_linux
if [ -n "$emulated" ]; then
  make_initramfs || fail "the initramfs could not be made (modules of $(cat "$kernel/version"))"
  boot=boot_qemu
else
  c++ -std=c++20 -O2 -shared -fPIC -o "$run/whole_registers.so" "$here/whole_registers.cpp" ||
    fail "whole_registers.cpp could not be built"
fi
begin=$(date +%s.%N)
# Not --foreground: the guest's processes are a separate group, which ends as a whole.
$boot < /dev/null > "$run/console" 2>&1 &
vm_pid=$!
wait "$vm_pid"
vm_pid=
end=$(date +%s.%N)

cat "$run/stdout" 2> /dev/null
cat "$run/stderr" >&2 2> /dev/null
if [ -n "$times" ] && [ -e "$run/started" ] && [ -e "$run/status" ]; then
  awk -v a="$begin" -v b="$(date -r "$run/started" +%s.%N)" \
      -v c="$(date -r "$run/status" +%s.%N)" -v d="$end" 'BEGIN {
    printf "run_in_vm.sh: boot %.2f s, command %.2f s, power-off %.2f s\n", b-a, c-b, d-c }' >&2
fi
if [ ! -s "$run/status" ]; then
  echo "run_in_vm.sh: the guest ended without a result; its console:" >&2
  tail -n 40 "$run/console" >&2
  exit 125
fi
exit "$(cat "$run/status")"
