"""Store of the raw files on this machine, filled by download or from a local folder."""

from __future__ import annotations

import logging
import shutil
from pathlib import Path

import platformdirs

from relit_camera.base.errors import NotFoundError
from relit_camera.base.models.model_download import sha256_of
from relit_camera.base.storage.atomic_files import atomic_path, make_folder, storage_error
from relit_studio.base.assets.manifest import AssetFile, manifest

_TIMEOUT_S = 30.0
_CURE = "run `python -m relit_studio fetch`, with --from FOLDER where there is no network"


def cache_folder() -> Path:
    """The studio's folder in the user's cache."""
    return platformdirs.user_cache_path("relit-studio")


def assets_folder() -> Path:
    """Folder of the raw files."""
    return cache_folder() / "assets"


def asset(name: str) -> Path:
    """Path of a fetched file.

    Raises:
        NotFoundError: it has not been fetched.
    """
    path = assets_folder() / name
    if not path.is_file():
        raise NotFoundError(f"no {path}", _CURE)
    return path


def fetch_assets(mirror: Path | None = None) -> list[Path]:
    """Fetch and verify every file of the manifest, except those that exist and are intact.

    Args:
        mirror: a folder that holds them under their names; else they are downloaded.

    Raises:
        NotFoundError: a file is not in the mirror, cannot be downloaded, or has another sha256.
        StorageError: the cache cannot be written.
    """
    return [_fetch(file, mirror) for file in manifest().files]


def _fetch(file: AssetFile, mirror: Path | None) -> Path:
    target = assets_folder() / file.name
    if target.is_file() and sha256_of(target) == file.sha256:
        return target
    make_folder(target.parent)
    if mirror is None:
        return _download(file, target)
    found = mirror / file.name
    if not found.is_file():
        raise NotFoundError(f"{mirror} has no {file.name}", f"put it there; it comes from {file.source}")
    if sha256_of(found) != file.sha256:
        raise NotFoundError(f"{found} is another file than the one that is used", f"get it from {file.source}")
    with atomic_path(target) as temporary:
        shutil.copyfile(found, temporary)
    return target


def _download(file: AssetFile, target: Path) -> Path:
    import pooch
    import requests

    pooch.get_logger().setLevel(logging.ERROR)
    for url in file.urls:
        try:
            downloader = pooch.HTTPDownloader(timeout=_TIMEOUT_S)
            pooch.retrieve(url, f"sha256:{file.sha256}", target.name, target.parent, downloader=downloader)
        except (requests.RequestException, ValueError):  # pooch's answer to another sha256 is a ValueError
            continue
        except OSError as error:
            raise storage_error(target, error) from error
        return target
    reason = "cannot be downloaded" if file.urls else "is offered by no address as one file"
    raise NotFoundError(f"{file.name} {reason}", f"it comes from {file.source}; use `fetch --from FOLDER`")
