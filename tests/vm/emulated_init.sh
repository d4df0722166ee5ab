#!/bin/busybox sh
# shellcheck shell=dash
# First process under QEMU, in memory: loads the modules, mounts the host's files as root (9p) and continues
# with guest_init.sh. Not to be run by hand.
/bin/busybox --install -s /bin
export PATH=/bin
mount -t proc proc /proc
mount -t sysfs sysfs /sys
mount -t devtmpfs dev /dev
while read -r module; do
  insmod "/modules/$module" || echo "guest: insmod $module failed"
done < /modules/order
mount -t 9p -o trans=virtio,version=9p2000.L,msize=524288,cache=loose host /root ||
  { echo "guest: no 9p"; echo o > /proc/sysrq-trigger; }
for folder in proc sys dev; do mount --move "/$folder" "/root/$folder"; done
exec switch_root /root "$VM_RUN/init"
