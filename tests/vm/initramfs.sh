#!/bin/busybox sh
# The first program of the test machine: loads what its disk needs, and goes on from there.
b=/bin/busybox
$b mount -t proc proc /proc
$b mount -t sysfs sys /sys
$b mount -t devtmpfs dev /dev
while read -r module; do $b insmod "/modules/$module"; done </modules/order
tries=0
until [ -b /dev/vda ]; do
    tries=$((tries + 1))
    [ $tries -lt 300 ] || $b poweroff -f
    $b sleep 0.1
done
$b mount -t ext4 -o noatime /dev/vda /system || $b poweroff -f
for folder in proc sys dev; do $b mount --move /$folder /system/$folder; done
exec $b switch_root /system /bin/sh /init.sh
