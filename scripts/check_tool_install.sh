#!/bin/sh
# The program as users install it: a wheel of this checkout by `uv tool install` or `pipx install`, then used from an
# empty home. The demonstration must show a picture with nothing downloaded, and the doctor must find every package.
#
#   check_tool_install.sh uv|pipx
#
# UV and PIPX name the commands; WHEEL an existing wheel.
set -eu

installer=$1
checkout=$(cd "$(dirname "$0")/.." && pwd)
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
mkdir "$place/home" "$place/bin" "$place/empty"

if [ -z "${WHEEL:-}" ]; then
    "${PYTHON:-python3}" -m pip wheel --quiet --no-deps --wheel-dir "$place" "$checkout"
    WHEEL=$(ls "$place"/relit_camera-*.whl)
fi
case $installer in
    uv)
        UV_TOOL_DIR=$place/tools UV_TOOL_BIN_DIR=$place/bin "${UV:-uv}" tool install --quiet "$WHEEL"
        ;;
    pipx)
        PIPX_HOME=$place/tools PIPX_BIN_DIR=$place/bin "${PIPX:-pipx}" install --quiet "$WHEEL"
        ;;
    *)
        echo "usage: $0 uv|pipx" >&2
        exit 2
        ;;
esac

cd "$place/empty"
HOME=$place/home
PATH=$place/bin:/usr/bin:/bin
export HOME PATH
unset RELIT_MODELS_DIR RELIT_CONFIG XDG_CACHE_HOME XDG_CONFIG_HOME XDG_DATA_HOME PYTHONPATH VIRTUAL_ENV

relit --version
relit demo --headless --seconds 20 --port 0 >"$place/demo.txt"
grep "First picture" "$place/demo.txt"
relit doctor --fix >"$place/doctor.txt" || true # no camera here
grep -E "^ok +(python|packages|configuration|provider)" "$place/doctor.txt"
test "$(grep -cE '^ok +(python|packages|configuration|provider)' "$place/doctor.txt")" = 4
unit=$HOME/.config/systemd/user/relit-camera.service
grep -qF "ExecStart=\"$place/bin/relit\" run" "$unit" || { grep ExecStart "$unit" >&2; exit 1; }
relit config check
echo "relit, installed by $installer: picture, packages, settings and service are right"
