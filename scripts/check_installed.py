"""Checks an installed Relit Camera against this checkout: run it with the Python of the environment to check.

The wheel must hold every file of the package, byte for byte, data and licences too; its plug-ins must load;
its own licence must be with it.
"""

from __future__ import annotations

import sys
from importlib.metadata import distribution
from pathlib import Path

import relit_camera

SOURCE = Path(__file__).resolve().parents[1] / "service" / "relit_camera"


def main() -> str | None:
    """Return what is wrong, or None."""
    installed = Path(relit_camera.__file__).parent
    if installed == SOURCE:
        return f"{sys.executable} uses the checkout itself: install a wheel there"
    for path in SOURCE.rglob("*"):
        if path.is_dir() or "__pycache__" in path.parts:
            continue
        copy = installed / path.relative_to(SOURCE)
        if not copy.is_file() or copy.read_bytes() != path.read_bytes():
            return f"{copy} is missing or not as in the checkout"
    package = distribution("relit-camera")
    for point in package.entry_points:
        point.load()
    if not any(file.name == "LICENSE" and file.read_text() for file in package.files or ()):
        return "the wheel has no LICENSE"
    print(f"relit-camera {package.version} in {installed.parent}: {len(package.entry_points)} entry points load")
    return None


if __name__ == "__main__":
    sys.exit(main())
