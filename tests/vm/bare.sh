#!/bin/sh
# Makes a bare Debian 12, as its installer leaves it without a desktop: systemd, the stock kernel, apt, a user `you` who may
# use sudo. In it `python -m tests.vm.bare` goes the README's way to the picture in a call. After build.sh, which installs
# the tools. Lands beside its machine.
set -eu

cache=${RELIT_VM_CACHE:-${XDG_CACHE_HOME:-$HOME/.cache}/relit-camera-vm}
here=$(cd "$(dirname "$0")" && pwd)
keyring=/usr/share/keyrings/debian-archive-keyring.gpg
exec 9>"$cache/lock"
flock 9
recipe=$(sha256sum <"$here/bare.sh" | cut -c1-16)
[ "$(cat "$cache/bare.recipe" 2>/dev/null)" != "$recipe" ] || exit 0

export DEBIAN_FRONTEND=noninteractive LC_ALL=C PATH="$PATH:/usr/sbin:/sbin" # not everybody's has chroot and mke2fs
cleanup() {
    awk -v under="$cache/work." 'index($2, under) == 1 {print $2}' /proc/mounts | sort -r | xargs -r umount -l || true
    rm -rf --one-file-system "$cache"/work.*
}
cleanup
trap cleanup EXIT
trap 'exit 130' HUP INT TERM
work=$(mktemp -d "$cache/work.XXXXXX")
chmod 755 "$work"

archives=$(apt-get indextargets --format "\$(REPO_URI)" | sort -u)
mirror=$(echo "$archives" | grep -E '/debian/?$' | head -n 1)
security=$(echo "$archives" | grep -E 'debian-security/?$' | head -n 1)
[ -n "$mirror" ] && [ -n "$security" ] || { echo "bare: apt knows no Debian archive" >&2; exit 1; }
mmdebstrap --quiet --mode=root --variant=important --architectures=amd64 \
    --include=linux-image-amd64,sudo,ca-certificates,dbus-user-session,libpam-systemd bookworm "$work/root" \
    "deb [signed-by=$keyring] $mirror bookworm main" \
    "deb [signed-by=$keyring] $mirror bookworm-updates main" \
    "deb [signed-by=$keyring] $security bookworm-security main" >"$work/log" 2>&1 || {
    cat "$work/log" >&2
    exit 1
}
root=$work/root
echo bare >"$root/etc/hostname"
printf '127.0.0.1 localhost bare\n' >"$root/etc/hosts"
printf 'auto eth0\niface eth0 inet dhcp\n' >"$root/etc/network/interfaces"
chroot "$root" useradd --create-home --shell /bin/bash you
echo 'you ALL=(ALL) NOPASSWD: ALL' >"$root/etc/sudoers.d/you"
# Where this machine's network has certificates of its own, the guest needs them too.
find /usr/local/share/ca-certificates -name '*.crt' -exec cp {} "$root/usr/local/share/ca-certificates/" \; 2>/dev/null || true
chroot "$root" update-ca-certificates >/dev/null 2>&1
cat >"$root/etc/systemd/system/trial.service" <<'UNIT'
[Unit]
After=network-online.target
Wants=network-online.target
[Service]
Type=oneshot
ExecStartPre=/bin/mkdir -p /host
ExecStartPre=/bin/mount -t 9p -o trans=virtio,version=9p2000.L,msize=262144,cache=mmap host /host
ExecStart=/bin/sh /host/guest/bare_steps.sh
ExecStopPost=/bin/systemctl --no-block poweroff
TimeoutStartSec=infinity
StandardOutput=journal+console
StandardError=inherit
[Install]
WantedBy=multi-user.target
UNIT
chroot "$root" systemctl --quiet enable trial.service
cp "$root"/boot/vmlinuz-* "$work/vmlinuz"
cp "$root"/boot/initrd.img-* "$work/bare-initrd"
mke2fs -q -t ext4 -O ^has_journal -E lazy_itable_init=1 -m 0 -d "$root" "$work/bare.img" 12G >"$work/log" 2>&1
rm -f "$cache/bare.recipe"
mv -f "$work/vmlinuz" "$cache/bare-vmlinuz"
mv -f "$work/bare-initrd" "$work/bare.img" "$cache/"
echo "$recipe" >"$cache/bare.recipe"
