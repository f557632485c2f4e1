#!/bin/sh
# The image's build, in the folder of a checkout: a wheel of it, installed into the virtual environment VENV.
#
#   build-steps.sh VENV [gpu]
#
# The Dockerfile runs this, and so does `make image-steps`, which needs no Docker.
set -eu

venv=$1
extra=${2:-}
wheels=$(mktemp -d)
trap 'rm -rf "$wheels"' EXIT
PIP_DISABLE_PIP_VERSION_CHECK=1
export PIP_DISABLE_PIP_VERSION_CHECK

"$venv/bin/pip" wheel --quiet --no-deps --wheel-dir "$wheels" .
wheel=$(ls "$wheels"/relit_camera-*.whl)
"$venv/bin/pip" install --quiet "$wheel${extra:+[$extra]}"
if [ "$extra" = gpu ]; then
    # Both packages own the folder onnxruntime/: the one installed last must be the only one.
    "$venv/bin/pip" uninstall --quiet --yes onnxruntime onnxruntime-gpu
    "$venv/bin/pip" install --quiet --no-deps 'onnxruntime-gpu>=1.24.1'
fi
"$venv/bin/relit" --version
