#!/bin/sh
# Unpacks PipeWire, its session manager and GStreamer from Debian's packages into a folder, for the tests of the camera
# in PipeWire; of this machine's own suite also the desktop's portal and Firefox, which reads cameras through it. Nothing
# is installed, and root is not needed. What this machine has already is not fetched again.
#   install.sh [SUITE]    this machine's own packages, or those of a suite such as bookworm-backports
# Called again it returns at once. Exit status 69: they cannot be had here, and why.
set -eu

suite=${1:-own}
cache=${PIPEWIRE_TEST_CACHE:-${XDG_CACHE_HOME:-$HOME/.cache}/relit-camera-pipewire}
packages="pipewire pipewire-bin wireplumber dbus gstreamer1.0-pipewire gstreamer1.0-tools gstreamer1.0-plugins-base"
[ "$suite" != own ] || packages="$packages xdg-desktop-portal firefox-esr"
keyring=/usr/share/keyrings/debian-archive-keyring.gpg

say() { printf '%s pipewire: %s\n' "$(date +%T)" "$*" >&2; }
unavailable() {
    say "not unpacked: $*"
    exit 69
}
# Runs a step silently; its words are shown if it fails.
quietly() {
    "$@" >"$work/log" 2>&1 && return
    cat "$work/log" >&2
    return 1
}

command -v apt-get >/dev/null || unavailable "there is no apt here"
mkdir -p "$cache"
exec 9>"$cache/lock"
flock 9
status=/var/lib/dpkg/status
recipe=$(sha256sum "$0" | cut -c1-16)
if [ "$(cat "$cache/$suite/recipe" 2>/dev/null)" = "$recipe" ]; then
    say "up to date in $cache/$suite"
    exit 0
fi
work=$(mktemp -d "$cache/work.XXXXXX")
trap 'rm -rf "$work"' EXIT
trap 'exit 130' HUP INT TERM

# An apt of our own, with this machine's archives, that knows what this machine has.
apt_root=$work/apt
mkdir -p "$apt_root/etc/apt/sources.list.d" "$apt_root/etc/apt/preferences.d" "$apt_root/etc/apt/apt.conf.d" \
    "$apt_root/var/lib/apt/lists/partial" "$apt_root/var/cache/apt/archives/partial"
archives=$(apt-get indextargets --format "\$(REPO_URI) \$(RELEASE)" | sort -u)
mirror=$(echo "$archives" | awk '$1 ~ /\/debian\/?$/ {print $1; exit}')
[ -n "$mirror" ] || unavailable "apt knows no Debian archive"
[ -f "$keyring" ] || unavailable "there are no keys of Debian's archive"
echo "$archives" | while read -r address release; do
    echo "deb [signed-by=$keyring] $address $release main"
done >"$apt_root/etc/apt/sources.list"
if [ "$suite" != own ]; then
    echo "deb [signed-by=$keyring] $mirror $suite main" >>"$apt_root/etc/apt/sources.list"
    set -- -t "$suite"
else
    set --
fi
apt() {
    apt-get -q -o "Dir=$apt_root" -o "Dir::State::status=$status" -o Debug::NoLocking=true \
        -o APT::Sandbox::User="$(id -un)" -o Acquire::Retries=3 -o Acquire::Languages=none "$@"
}
say "packages of ${suite}"
quietly apt update -o APT::Update::Error-Mode=any || unavailable "Debian's archive does not answer"
# What the machine has installed is fetched only where it is too old.
# shellcheck disable=SC2086  # a list
quietly apt install "$@" -y --download-only --no-install-recommends $packages || unavailable "apt cannot fetch them"
mkdir "$work/root"
for deb in "$apt_root"/var/cache/apt/archives/*.deb; do
    [ -f "$deb" ] || continue
    dpkg-deb -x "$deb" "$work/root"
    dpkg-deb -W --showformat "\${Package} \${Version}\n" "$deb" >>"$work/versions"
done
rm -rf "${cache:?}/$suite"
mkdir "$cache/$suite"
mv "$work/root" "$work/versions" "$cache/$suite/"
echo "$recipe" >"$cache/$suite/recipe"
say "done: $(awk '$1 == "pipewire" || $1 == "wireplumber"' "$cache/$suite/versions" | tr '\n' ' ')in $cache/$suite"
