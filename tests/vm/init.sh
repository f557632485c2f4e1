#!/bin/sh
# Process 1 of the test machine: mounts what the host shares, then does what the host says until it hangs up.
export PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LANG=C.UTF-8
for place in tmp run; do mount -t tmpfs tmpfs "/$place"; done
mkdir -p /dev/shm /dev/pts
mount -t tmpfs tmpfs /dev/shm
mount -t devpts devpts /dev/pts
ln -sf /proc/self/fd /dev/fd
hostname relit-vm
ip link set lo up
modprobe -a virtio_console virtio_rng 9pnet_virtio 9p
mount -t 9p -o trans=virtio,version=9p2000.L,msize=262144,cache=mmap host /host
# The program and its libraries, if the host gave them as a second disk.
[ ! -b /dev/vdb ] || mount -t ext4 -o ro /dev/vdb /opt/relit
tries=0
until [ -e /dev/vport1p1 ] || [ -e /dev/vport2p1 ] || [ $tries = 100 ]; do
    tries=$((tries + 1))
    sleep 0.1
done
# There is no udev: devices are given to the group `video` by whoever loads a module.
python3 /host/guest/agent.py /dev/vport*p1
sync
echo o >/proc/sysrq-trigger
sleep 60
