"""Files on disk: written whole or not at all (`atomic_files`), and stored by name in a folder (`named_files`).

Texts that others may read name no folder of this machine (`folder_redaction`).
"""

from __future__ import annotations

from relit_camera.base.storage.atomic_files import (
    atomic_path,
    make_folder,
    remove_unfinished_files,
    storage_error,
    write_atomic,
    write_tensors,
)
from relit_camera.base.storage.named_files import FileVersion, NamedFiles, file_version

__all__ = [
    "FileVersion",
    "NamedFiles",
    "atomic_path",
    "file_version",
    "make_folder",
    "remove_unfinished_files",
    "storage_error",
    "write_atomic",
    "write_tensors",
]
