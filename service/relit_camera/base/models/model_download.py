"""Downloads the files of public models, or takes them from a local folder; their sha256 is checked."""

from __future__ import annotations

import hashlib
import logging
from collections.abc import Callable
from pathlib import Path
from urllib.parse import urlsplit

from relit_camera.base.errors import DownloadError, ModelError, NotFoundError
from relit_camera.base.models.model_manifest import Download

_TIMEOUT_S = (10.0, 20.0)
"""Without a connection, or an answer, for this long, the next URL is tried."""

Report = Callable[[str, int, int | None], None]
"""Called with what is fetched, the bytes that are there, and how many it will be."""


def sha256_of(path: Path) -> str:
    """Return the sha256 of a file's bytes, in hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def find_in_mirror(name: str, download: Download, mirror: Path) -> Path:
    """Find the file in a local folder by one of its names.

    Raises:
        NotFoundError: there is no such folder.
        DownloadError: the folder does not have the file.
        ModelError: it has another sha256.
    """
    if not mirror.is_dir():
        raise NotFoundError(f"no folder {mirror}", "name the folder that holds the downloaded models")
    names = (name, *download.also_named)
    path = next((mirror / each for each in names if (mirror / each).is_file()), None)
    if path is None:
        missing = f"{mirror} has no {' or '.join(names)}"
        raise DownloadError(missing, f"put it there; it is at {download.urls[0]}", (missing,))
    found = sha256_of(path)
    if found != download.sha256:
        raise ModelError(
            f"{path} has the wrong sha256 {_short(found)}, not {_short(download.sha256)}",
            f"get the file from {download.urls[0]}",
        )
    return path


class Downloader:
    """Downloads files of one pull into a folder. A host that does not answer is asked once only."""

    def __init__(self, folder: Path, report: Report) -> None:
        """Download into `folder`, which may not exist yet; `report` is called while a file grows."""
        self._folder = folder
        self._report = report
        self._silent: dict[str, str] = {}
        self._givers: dict[str, str] = {}

    def may_give(self, download: Download) -> bool:
        """Whether one of the file's hosts is not known to be silent."""
        return any(urlsplit(url).netloc not in self._silent for url in download.urls)

    def fetch(self, name: str, download: Download) -> tuple[Path, str]:
        """Download the file, or take it from the folder; returns its path and where it is from.

        Raises:
            DownloadError: no url gives the file, or what they give has another sha256. Nothing is left in the folder.
            OSError: the folder cannot be written.
        """
        kept = self._folder / name
        if kept.is_file() and sha256_of(kept) == download.sha256:
            return kept, self._givers.get(name, "an earlier download")
        reasons = []
        for url in download.urls:
            host = urlsplit(url).netloc
            failure = self._silent.get(host) or self._retrieve(url, name, download)
            if failure is None:
                self._givers[name] = host
                return kept, host
            reasons.append(failure)
        cure = f"or get {download.urls[0]} some other way and run `relit models pull --from FOLDER`"
        raise DownloadError(
            f"cannot download {name}: {', '.join(reasons)}", f"check the network, {cure}", tuple(reasons)
        )

    def _retrieve(self, url: str, name: str, download: Download) -> str | None:
        """Download the file; returns why that failed, or None."""
        import pooch
        import requests

        pooch.get_logger().setLevel(logging.ERROR)  # it would print on stderr what the error says
        host = urlsplit(url).netloc
        bar = _Progress(lambda size: self._report(name, size, download.size))
        downloader = pooch.HTTPDownloader(timeout=_TIMEOUT_S, progressbar=bar)
        try:
            pooch.retrieve(url, f"sha256:{download.sha256}", name, self._folder, downloader=downloader)
        except requests.HTTPError as error:
            return f"{host} answers {error.response.status_code if error.response is not None else error}"
        except requests.Timeout:
            self._silent[host] = f"{host} does not answer"
        except requests.RequestException:
            self._silent[host] = f"no connection to {host}"
        except ValueError:
            return f"{host} gives a file of the wrong sha256"
        return self._silent.get(host)


class _Progress:
    """What pooch takes for a progress bar."""

    def __init__(self, grown: Callable[[int], None]) -> None:
        self.total = 0
        self._grown = grown
        self._size = 0

    def update(self, size: int) -> None:
        self._size += size
        self._grown(self._size)

    def reset(self) -> None:
        self._size = 0

    def close(self) -> None:
        pass


def _short(sha256: str) -> str:
    return f"{sha256[:12]}…"
