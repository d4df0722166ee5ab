#!/bin/bash
# run_in_vm.sh [--timeout S] [--memory SIZE] [--times] COMMAND [ARGUMENT...]
#
# Runs COMMAND as root under User Mode Linux (Debian package user-mode-linux), where AF_CAN exists
# and the virtual CAN interfaces vcan0 and vcan1 are up. The guest's root file system is the host's
# own, read-write (hostfs); working directory and exported variables are those of the caller; PATH
# is extended by the sbin folders. /run, /dev and /dev/shm are the guest's own and empty: sockets
# and FIFOs belong there. One CPU. ASan and TSan programs abort in it. Any number can run at a time.
#
# Exit status: COMMAND's; 124 after S seconds (default 300); 125 when the guest did not come up or
# died. --times prints to stderr how long the boot and the command took.
set -u

usage() { sed -n '2,4p' "$0" | cut -c3- >&2; exit 125; }
fail() { echo "run_in_vm.sh: $*" >&2; exit 125; }

limit_s=300 memory=512M times=
while [ $# -gt 0 ]; do
  case $1 in
    --timeout) limit_s=${2:-}; shift 2 || usage ;;
    --memory) memory=${2:-}; shift 2 || usage ;;
    --times) times=yes; shift ;;
    --) shift; break ;;
    -*) usage ;;
    *) break ;;
  esac
done
[ $# -gt 0 ] || usage
[[ $limit_s =~ ^[1-9][0-9]*$ ]] || fail "--timeout $limit_s: must be a whole number of seconds"

kernel=/usr/bin/linux.uml
[ -x "$kernel" ] || fail "package user-mode-linux is not installed (apt-get install user-mode-linux)"
PATH=$PATH:/usr/local/sbin:/usr/sbin:/sbin
for tool in ip insmod; do
  command -v $tool > /dev/null || fail "$tool is missing (apt-get install iproute2 kmod)"
done

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

cp "$(dirname "$0")/guest_init.sh" "$run/init" && chmod 755 "$run/init" || fail "no guest_init.sh"
{
  export -p
  echo 'unset TMPDIR'
  printf 'cd %q || exit 125\n' "$PWD"
  printf 'exec timeout -k 5 %s' "$limit_s"
  printf ' %q' "$@"
  echo
} > "$run/command"

# The guest's memory is a sparse file; on a tmpfs it never meets a disk.
memory_place=/dev/shm
needed_kB=$(numfmt --from=iec "$memory") && needed_kB=$((needed_kB / 1024)) \
  || fail "--memory $memory: must be a size such as 512M"
free_kB=$(df --output=avail /dev/shm 2> /dev/null | tail -n 1)
[ "${free_kB:-0}" -gt "$needed_kB" ] || memory_place=$place

begin=$(date +%s.%N)
# Not --foreground: the guest's processes are a group of their own, which ends as a whole.
TMPDIR=$memory_place timeout -k 5 $((limit_s + 60)) "$kernel" "mem=$memory" rootfstype=hostfs \
  rootflags=/ rw con=null con0=null,fd:1 quiet loglevel=3 noreboot "uml_dir=$run" umid=vm \
  "init=$run/init" "VM_RUN=$run" < /dev/null > "$run/console" 2>&1 &
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
