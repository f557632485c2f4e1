#!/bin/sh
# Makes the small Debian 12 machine in which the virtual camera is tested: a stock kernel with vivid, the drivers of USB
# webcams and of a bus to plug one into and, compiled for it, three versions of v4l2loopback; v4l-utils, ffmpeg and
# Chromium. Everything comes from Debian's archive and lands in $RELIT_VM_CACHE (2 GB). Called again it returns at once
# while the recipe is the same. Exit status 69: the machine cannot be had here, and why.
set -eu

here=$(cd "$(dirname "$0")" && pwd)
cache=${RELIT_VM_CACHE:-${XDG_CACHE_HOME:-$HOME/.cache}/relit-camera-vm}
suite=bookworm
# Where each version of v4l2loopback is taken from; all are compiled for the one kernel.
loopback_suites="bookworm bookworm-backports trixie"
# What the guest loads, beyond what these need; and what must be there before its disk can be read.
modules="virtio_pci virtio_blk virtio_console virtio_rng 9pnet_virtio 9p ext4 crc32c_generic videodev vivid uvcvideo vhci_hcd"
early_modules="virtio_pci virtio_blk crc32c_generic ext4"
packages="python3,kmod,util-linux,procps,iproute2,curl,v4l-utils,ffmpeg,chromium,chromium-driver,fonts-dejavu-core"
keyring=/usr/share/keyrings/debian-archive-keyring.gpg

say() { printf '%s vm: %s\n' "$(date +%T)" "$*" >&2; }
unavailable() {
    say "not built: $*"
    exit 69
}
# Runs a step silently; its words are shown if it fails.
quietly() {
    "$@" >"$work/log" 2>&1 && return
    cat "$work/log" >&2
    return 1
}

[ "$(id -u)" = 0 ] || unavailable "it needs root (to install packages, and to make a root file system)"
[ "$(uname -m)" = x86_64 ] || unavailable "it is made for x86_64"
grep -q "^VERSION_CODENAME=$suite" /etc/os-release || unavailable "it is made on Debian 12"

umask 022
mkdir -p "$cache"
exec 9>"$cache/lock"
flock -n 9 || {
    say "another build is at work"
    flock 9
}
recipe=$(cat "$here/build.sh" "$here/init.sh" "$here/initramfs.sh" | sha256sum | cut -c1-16)
if [ "$(cat "$cache/recipe" 2>/dev/null)" = "$recipe" ]; then
    say "up to date in $cache"
    exit 0
fi

export DEBIAN_FRONTEND=noninteractive LC_ALL=C PATH="$PATH:/usr/sbin:/sbin" # not everybody's has chroot and mke2fs
# Never delete through a mount that an interrupted mmdebstrap has left.
cleanup() {
    awk -v under="$cache/work." 'index($2, under) == 1 {print $2}' /proc/mounts | sort -r | xargs -r umount -l || true
    rm -rf --one-file-system "$cache"/work.*
}
cleanup # what a killed build left
trap cleanup EXIT
trap 'exit 130' HUP INT TERM
work=$(mktemp -d "$cache/work.XXXXXX")
chmod 755 "$work"
system=$work/system

say "tools of this machine"
quietly apt-get -q update || unavailable "apt has no package lists"
quietly apt-get -qy install --no-install-recommends \
    qemu-system-x86 mmdebstrap gcc-12 make libc6-dev binutils libelf1 e2fsprogs cpio kmod \
    || unavailable "apt cannot install QEMU, mmdebstrap and a compiler"

say "package lists"
# This machine's own archives, of its own and of later suites; of the latter nothing is taken that is not asked for.
archives=$(apt-get indextargets --format "\$(REPO_URI)" | sort -u)
mirror=$(echo "$archives" | grep -E '/debian/?$' | head -n 1)
security=$(echo "$archives" | grep -E 'debian-security/?$' | head -n 1)
[ -n "$mirror" ] && [ -n "$security" ] || unavailable "apt knows no Debian archive"
apt_root=$work/apt
mkdir -p "$apt_root/etc/apt/sources.list.d" "$apt_root/etc/apt/preferences.d" "$apt_root/etc/apt/apt.conf.d" \
    "$apt_root/etc/apt/trusted.gpg.d" "$apt_root/var/lib/apt/lists/partial" \
    "$apt_root/var/cache/apt/archives/partial" "$apt_root/var/lib/dpkg" "$work/debs"
: >"$apt_root/var/lib/dpkg/status"
{
    echo "deb [signed-by=$keyring] $mirror $suite main"
    echo "deb [signed-by=$keyring] $mirror $suite-updates main"
    echo "deb [signed-by=$keyring] $security $suite-security main"
} >"$work/sources"
cp "$work/sources" "$apt_root/etc/apt/sources.list"
for later in ${loopback_suites#* }; do
    echo "deb [signed-by=$keyring] $mirror $later main" >>"$apt_root/etc/apt/sources.list"
done
printf 'Package: *\nPin: release n=trixie\nPin-Priority: 50\n' >"$apt_root/etc/apt/preferences.d/pin"
apt() {
    tool=$1
    shift
    "apt-$tool" -q -o "Dir=$apt_root" -o "Dir::State::status=$apt_root/var/lib/dpkg/status" \
        -o APT::Architecture=amd64 -o APT::Sandbox::User=root -o Acquire::Retries=3 -o Acquire::Languages=none "$@"
}
quietly apt get update -o APT::Update::Error-Mode=any || unavailable "Debian's archive does not answer"
download() { (cd "$1" && shift && apt get download "$@"); }

# apt-cache names the image that the metapackage stands for.
image=$(apt cache depends linux-image-amd64 | awk '/Depends: linux-image-[0-9]/ {print $2; exit}')
kernel=${image#linux-image-}
[ -n "$kernel" ] || unavailable "Debian's archive names no kernel"
headers=linux-headers-$kernel
say "kernel $kernel"
quietly download "$work/debs" "$image" "$headers" "linux-headers-${kernel%-amd64}-common" \
    "linux-kbuild-${kernel%%.0-*}" busybox-static || unavailable "the kernel cannot be fetched"
mkdir -p "$work/image" "$work/src" "$work/busybox" "$work/loopback"
dpkg-deb -x "$work"/debs/linux-image-*.deb "$work/image"
for deb in "$work"/debs/linux-headers-*.deb "$work"/debs/linux-kbuild-*.deb; do dpkg-deb -x "$deb" "$work/src"; done
dpkg-deb -x "$work"/debs/busybox-static_*.deb "$work/busybox"
# The headers name their common half by an absolute path.
sed -i "s#^include /usr/src/#include $work/src/usr/src/#" "$work/src/usr/src/$headers/Makefile"

for from in $loopback_suites; do
    mkdir -p "$work/debs/$from" "$work/source/$from"
    quietly download "$work/debs/$from" "v4l2loopback-dkms/$from" || unavailable "v4l2loopback cannot be fetched"
    dpkg-deb -x "$work/debs/$from"/v4l2loopback-dkms_*.deb "$work/source/$from"
    source=$(echo "$work/source/$from"/usr/src/v4l2loopback-*)
    version=${source##*/v4l2loopback-}
    say "v4l2loopback $version"
    quietly make -s -C "$work/src/usr/src/$headers" M="$source" v4l2loopback.ko modules
    strip --strip-debug "$source/v4l2loopback.ko"
    cp "$source/v4l2loopback.ko" "$work/loopback/v4l2loopback-$version.ko"
done

say "root file system"
quietly mmdebstrap --quiet --mode=root --variant=apt --architectures=amd64 --include="$packages" \
    --aptopt='APT::Install-Recommends "0"' --aptopt='Acquire::Languages "none"' --aptopt='Acquire::Retries "3"' \
    --dpkgopt='path-exclude=/usr/share/doc/*' --dpkgopt='path-exclude=/usr/share/man/*' \
    --dpkgopt='path-exclude=/usr/share/locale/*' "$suite" "$system" "$work/sources" \
    || unavailable "the root file system cannot be fetched"
# The camera and its readers are a plain user's.
chroot "$system" useradd --create-home --groups video you

say "modules"
lib=lib/modules/$kernel
# The files of these modules and of all that they need, in the order of loading.
depends() {
    for module in "$@"; do
        modprobe -d "$work/image" -S "$kernel" --show-depends "$module" >"$work/needs" || return 1
        awk '$1 == "insmod" {print $2}' "$work/needs"
    done
}
depmod -b "$work/image" "$kernel"
# shellcheck disable=SC2086  # these are lists
depends $modules >"$work/needed"
sort -u "$work/needed" | sed "s#^$work/image/##" >"$work/keep"
mkdir -p "$system/$lib"
(cd "$work/image" && cpio --quiet -pdm "$system" <"$work/keep" && cp "$lib"/modules.* "$system/$lib/")
# `modprobe v4l2loopback` loads what the link names, which the tests change.
mkdir "$system/$lib/loopback"
cp "$work"/loopback/*.ko "$system/$lib/"
first=$(basename "$(find "$work/loopback" -name '*.ko' | sort | head -n 1)")
ln -s "../$first" "$system/$lib/loopback/v4l2loopback.ko"
chroot "$system" depmod "$kernel"

say "initramfs"
early=$work/initramfs
mkdir -p "$early/bin" "$early/modules" "$early/proc" "$early/sys" "$early/dev" "$early/system"
cp "$work/busybox/bin/busybox" "$early/bin/"
# shellcheck disable=SC2086
depends $early_modules >"$work/needed"
awk '!seen[$0]++' "$work/needed" | while read -r file; do
    cp "$file" "$early/modules/"
    basename "$file" >>"$early/modules/order"
done
install -m 755 "$here/initramfs.sh" "$early/init"
(cd "$early" && find . -print0 | cpio --null --quiet -o -H newc -R 0:0 | gzip -1) >"$work/initrd"

say "kernel, unpacked"
# Emulated unpacking costs seconds at each boot: once is enough.
python3 - "$work/image/boot/vmlinuz-$kernel" "$work/vmlinux" <<'PY'
import lzma, sys

packed = open(sys.argv[1], "rb").read()
start = packed.index(b"\xfd7zXZ\x00")
open(sys.argv[2], "wb").write(lzma.LZMADecompressor().decompress(packed[start:]))
PY

say "disk image"
rm -rf "$system/var/cache/apt" "$system/var/lib/apt/lists" "$system/etc/resolv.conf"
echo relit-vm >"$system/etc/hostname"
printf '127.0.0.1 localhost relit-vm\n' >"$system/etc/hosts"
mkdir -p "$system/opt/relit" "$system/host"
install -m 755 "$here/init.sh" "$system/init.sh"
{
    echo "kernel $(dpkg-deb -f "$work"/debs/linux-image-*.deb Version)"
    for ko in "$work"/loopback/*.ko; do basename "$ko" .ko | sed 's/-/ /'; done
    chroot "$system" dpkg-query -W -f "\${Package} \${Version}\n" python3 v4l-utils ffmpeg chromium
} >"$work/versions"
size=$(($(du -sm --apparent-size "$system" | cut -f1) * 5 / 4 + 1024))
quietly mke2fs -q -t ext4 -O ^has_journal -E lazy_itable_init=1 -m 0 -d "$system" "$work/root.img" "${size}M"

rm -f "$cache/recipe"
for file in vmlinux initrd root.img versions; do mv -f "$work/$file" "$cache/$file"; done
echo "$recipe" >"$cache/recipe"
say "done: $cache"
