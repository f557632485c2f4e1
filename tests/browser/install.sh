#!/bin/sh
# Installs Debian's Chromium, with which the panel is tested, and a font for its pictures. Exit status 69: it cannot be
# had here, and why.
set -eu

say() { printf '%s browser: %s\n' "$(date +%T)" "$*" >&2; }
unavailable() {
    say "not installed: $*"
    exit 69
}

if chromium=$(command -v chromium); then
    say "$chromium is there"
    exit 0
fi
[ "$(id -u)" = 0 ] || unavailable "it needs root (sudo apt install chromium does it)"
command -v apt-get >/dev/null || unavailable "there is no apt here; install Chromium, or name one with CHROMIUM"
export DEBIAN_FRONTEND=noninteractive
log=$(mktemp)
trap 'rm -f "$log"' EXIT
if ! { apt-get -q update && apt-get -qy install --no-install-recommends chromium fonts-dejavu-core; } >"$log" 2>&1; then
    cat "$log" >&2
    unavailable "apt cannot install it"
fi
say "$(command -v chromium) is installed"
