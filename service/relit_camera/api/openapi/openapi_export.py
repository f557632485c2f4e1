"""Writes the API's description to docs/openapi.json: `python -m relit_camera.api.openapi.openapi_export [FILE]`."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from relit_camera.api.app import create_app_without_camera
from relit_camera.base.errors import RelitError
from relit_camera.base.storage.atomic_files import write_atomic

DEFAULT_PATH = Path("docs/openapi.json")


def openapi_text() -> str:
    """The OpenAPI document as docs/openapi.json holds it."""
    return json.dumps(create_app_without_camera().openapi(), indent=2, ensure_ascii=False) + "\n"


def main() -> None:
    """Write the description."""
    try:
        write_atomic(Path(sys.argv[1]) if len(sys.argv) > 1 else DEFAULT_PATH, openapi_text())
    except RelitError as error:
        sys.exit(str(error))


if __name__ == "__main__":
    main()
