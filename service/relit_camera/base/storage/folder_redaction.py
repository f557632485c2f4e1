"""Taking the folders of this machine out of texts that others may read."""

from __future__ import annotations

import re
import tempfile
from pathlib import Path

# Folders of a path would reveal the person's machine: only the last part is shown. Paths of the API itself stay.
_FOLDER_PATTERN = re.compile(r"(?<![\w.:/\\])(?!/api/|/panel/)(?:[A-Za-z]:)?[/\\](?:[^\s/\\:'\",;]+[/\\])+")


def redact_folders(text: str) -> str:
    """`text` with every absolute path cut down to its last part."""
    for folder in (Path.home(), Path(tempfile.gettempdir())):
        text = text.replace(f"{folder}/", "/…/").replace(f"{folder}\\", "/…/")  # the home folder's name may hold spaces
    return _FOLDER_PATTERN.sub("", text)
