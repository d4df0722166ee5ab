#!/bin/sh
# First process of run_in_vm.sh's guests after mounting the host's files as root: at once under User Mode
# Linux (hostfs), after emulated_init.sh under QEMU (9p). VM_RUN, from the kernel's command line, is the
# folder with the file `command`, for `stdout`, `stderr`, `started` and `status`. Not to be run by hand.
export PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin
mountpoint -q /proc || mount -t proc proc /proc
mountpoint -q /sys || mount -t sysfs sysfs /sys
mountpoint -q /dev || mount -t devtmpfs dev /dev
mkdir -p /dev/shm /dev/pts
mount -t tmpfs tmpfs /dev/shm
mount -t devpts devpts /dev/pts
mount -t tmpfs tmpfs /run

if [ -e /proc/sys/kernel/hotplug ]; then echo > /proc/sys/kernel/hotplug; fi  # no such program
uml_modules=/usr/lib/uml/modules/$(uname -r)/kernel
if [ -d "$uml_modules" ]; then
  for module in net/can/can net/can/can-raw net/can/can-bcm drivers/net/can/dev/can-dev \
                drivers/net/can/vcan drivers/net/can/slcan/slcan; do
    insmod "$uml_modules/$module.ko" || echo "guest: insmod $module failed"
  done
  # The kernel starts it for each name of a missing interface, for a second, and there is nothing it could find.
  echo > /proc/sys/kernel/modprobe
fi
ip link set lo up
for interface in vcan0 vcan1; do
  ip link add dev "$interface" type vcan && ip link set "$interface" up
done
# Real-time threads may use the whole CPU, as on a machine set up for them.
sysctl -q kernel.sched_rt_runtime_us=-1

: > "$VM_RUN/started"
bash "$VM_RUN/command" > "$VM_RUN/stdout" 2> "$VM_RUN/stderr"
echo $? > "$VM_RUN/status.part"
mv "$VM_RUN/status.part" "$VM_RUN/status"
sync
echo o > /proc/sysrq-trigger
while :; do sleep 1; done
