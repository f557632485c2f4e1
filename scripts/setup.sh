#!/bin/sh
# Makes a virtual environment in folder $1 and installs Relit Camera with its development tools into it.
set -eu

venv=$1
python=${PYTHON:-python3}

fail() {
    echo "setup: $1" >&2
    exit 1
}

command -v "$python" >/dev/null || fail "there is no $python; on Debian: sudo apt install python3 python3-venv"
"$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' ||
    fail "$("$python" --version) is too old, 3.11 or newer is needed; name another with: make PYTHON=python3.12 …"

if ! "$venv/bin/python" -m pip --version >/dev/null 2>&1; then
    # Debian keeps venv's pip in a package of its own; a pip of the system can do its work.
    if "$python" -c 'import ensurepip' 2>/dev/null; then
        "$python" -m venv "$venv"
    elif "$python" -m pip --version >/dev/null 2>&1; then
        "$python" -m venv --without-pip "$venv"
        "$python" -m pip --python "$venv/bin/python" install --quiet pip
    else
        fail "$python has neither venv nor pip; on Debian: sudo apt install python3-venv"
    fi
fi

# uv takes a third of the time. It does not read pip's configuration, with which some networks are reached.
pip() { "$venv/bin/python" -m pip install --quiet --disable-pip-version-check "$@"; }
{ pip uv && "$venv/bin/python" -m uv pip install --quiet --python "$venv/bin/python" --editable '.[dev]'; } ||
    pip --editable '.[dev]'
