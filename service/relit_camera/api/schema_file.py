"""Writes the API's description: `python -m relit_camera.api.schema_file [FILE]`, docs/openapi.json if none is named."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from relit_camera.api.app import bare_app
from relit_camera.errors import RelitError
from relit_camera.files import write_atomic

USUAL = Path("docs/openapi.json")


def schema_text() -> str:
    """The description as it is kept in the repository."""
    return json.dumps(bare_app().openapi(), indent=2, ensure_ascii=False) + "\n"


def main() -> None:
    """Write the description."""
    try:
        write_atomic(Path(sys.argv[1]) if len(sys.argv) > 1 else USUAL, schema_text())
    except RelitError as error:
        sys.exit(str(error))


if __name__ == "__main__":
    main()
