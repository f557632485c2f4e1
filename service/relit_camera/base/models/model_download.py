"""Downloads the files of public models, or takes them from a local folder; their sha256 is checked."""

from __future__ import annotations

import hashlib
import logging
from pathlib import Path
from urllib.parse import urlsplit

from relit_camera.base.errors import ModelError, NotFoundError
from relit_camera.base.models.model_manifest import Download

_TIMEOUT_S = 20.0
"""Without an answer for this long, the next URL is tried."""


def sha256_of(path: Path) -> str:
    """Return the sha256 of a file's bytes, in hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def find_in_mirror(name: str, download: Download, mirror: Path) -> Path:
    """Find the file in a local folder by one of its names.

    Raises:
        NotFoundError: there is no such folder.
        ModelError: the folder does not have the file, or it has another sha256.
    """
    if not mirror.is_dir():
        raise NotFoundError(f"no folder {mirror}", "name the folder that holds the downloaded models")
    names = (name, *download.also_named)
    path = next((mirror / each for each in names if (mirror / each).is_file()), None)
    if path is None:
        raise ModelError(f"{mirror} has no {' or '.join(names)}", f"put it there; it is at {download.urls[0]}")
    found = sha256_of(path)
    if found != download.sha256:
        raise ModelError(
            f"{path} has the wrong sha256 {_short(found)}, not {_short(download.sha256)}",
            f"get the file from {download.urls[0]}",
        )
    return path


def fetch(name: str, download: Download, folder: Path) -> Path:
    """Download the file into `folder`, or take it from there; returns its path.

    Raises:
        ModelError: no url gives the file, or what they give has another sha256. Nothing is left in the folder.
        OSError: the folder cannot be written.
    """
    import pooch
    import requests

    pooch.get_logger().setLevel(logging.ERROR)  # it would print on stderr what the error says
    downloader = pooch.HTTPDownloader(timeout=_TIMEOUT_S)
    failures = []
    for url in download.urls:
        host = urlsplit(url).netloc
        try:
            return Path(pooch.retrieve(url, f"sha256:{download.sha256}", name, folder, downloader=downloader))
        except requests.HTTPError as error:
            failures.append(f"{host} answers {error.response.status_code if error.response is not None else error}")
        except requests.Timeout:
            failures.append(f"{host} does not answer")
        except requests.RequestException:
            failures.append(f"no connection to {host}")
        except ValueError:
            failures.append(f"{host} gives a file of the wrong sha256")
    cure = f"or get {download.urls[0]} some other way and run `relit models pull --from FOLDER`"
    raise ModelError(f"cannot download {name}: {', '.join(failures)}", f"check the network, {cure}")


def _short(sha256: str) -> str:
    return f"{sha256[:12]}…"
