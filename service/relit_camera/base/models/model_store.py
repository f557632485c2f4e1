"""The folder of downloaded public models, and `relit models pull`, which fills it.

A stored model is one ONNX file with the sha256 in the manifest, whether it is published as ONNX or was converted on
this machine. The published files stay in the folder `downloads` beside them, so that a repair needs no network.
"""

from __future__ import annotations

import os
import zipfile
from collections.abc import Callable, Sequence
from enum import StrEnum
from functools import lru_cache
from hashlib import sha256
from pathlib import Path

import platformdirs
from filelock import FileLock, Timeout

from relit_camera.base.errors import ModelError, NotFoundError, StorageError
from relit_camera.base.models import model_download
from relit_camera.base.models.model_manifest import Manifest, PublicModel, public_manifest
from relit_camera.base.storage.atomic_files import write_atomic

FOLDER_VARIABLE = "RELIT_MODELS_DIR"
_LOCK_TIMEOUT_S = 300.0


class ModelState(StrEnum):
    """What is stored under a model's name."""

    PULLED = "pulled"
    MISSING = "missing"
    DAMAGED = "damaged"
    """A file with another sha256: incomplete, or converted by an older Relit Camera."""


def models_folder() -> Path:
    """Return the folder that `RELIT_MODELS_DIR` names, else the one in the user's cache. It may not exist yet."""
    chosen = os.environ.get(FOLDER_VARIABLE)
    return Path(chosen).expanduser() if chosen else platformdirs.user_cache_path("relit-camera") / "models"


def model_path(name: str) -> Path:
    """Return the ONNX file of a pulled public model, proven by its sha256 once a process.

    Raises:
        NotFoundError: no public model has that name.
        ModelError: it is not pulled, or damaged.
    """
    return ModelStore().path(name)


class ModelStore:
    """The public models of a manifest, stored in a folder; by default the packaged manifest and the user's folder."""

    def __init__(self, folder: Path | None = None, manifest: Manifest | None = None) -> None:
        self.folder = folder or models_folder()
        self.manifest = manifest or public_manifest()

    def names(self, chosen: Sequence[str] = ()) -> list[str]:
        """Return the chosen names, all of them where none is chosen.

        Raises:
            NotFoundError: no public model has such a name.
        """
        for name in chosen:
            if name not in self.manifest.models:
                raise NotFoundError(f"no public model '{name}'", f"there are {', '.join(self.manifest.models)}")
        return list(dict.fromkeys(chosen)) or list(self.manifest.models)

    def state(self, name: str) -> ModelState:
        """Compare what is stored with the manifest: size and sha256, read again when the file has changed.

        Raises:
            NotFoundError: no public model has that name.
        """
        self.names([name])
        model, path = self.manifest.models[name], self._file(name)
        try:
            found = path.stat()
        except FileNotFoundError:
            return ModelState.MISSING
        except OSError as error:
            raise self._storage_error(error) from error
        same = found.st_size == model.size and _sha256(path, found.st_size, found.st_mtime_ns) == model.sha256
        return ModelState.PULLED if same else ModelState.DAMAGED

    def path(self, name: str) -> Path:
        """Return the ONNX file of a model.

        Raises:
            NotFoundError: no public model has that name.
            ModelError: it is not pulled, or damaged.
        """
        state = self.state(name)
        if state is ModelState.PULLED:
            return self._file(name)
        what = "is not pulled" if state is ModelState.MISSING else f"in {self.folder} is of another version or damaged"
        raise ModelError(f"model {name} {what}", f"run `relit models pull {name}`")

    def pull(
        self, chosen: Sequence[str] = (), mirror: Path | None = None, say: Callable[[str], None] = lambda _: None
    ) -> None:
        """Store the chosen models, or all, where they are not yet; each whole or not at all.

        Args:
            chosen: names; none for all.
            mirror: a local folder with the upstream files, instead of the network.
            say: called with a line for each model.

        Raises:
            NotFoundError: no public model has such a name, or there is no such mirror.
            ModelError: a file cannot be downloaded or has the wrong sha256. Models before it are stored.
            StorageError: the folder cannot be written, or another pull keeps it locked.
        """
        names = self.names(chosen)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            with FileLock(self.folder / ".lock", timeout=_LOCK_TIMEOUT_S):
                for name in names:
                    if self.state(name) is ModelState.PULLED:
                        say(f"{name}: already there")
                        continue
                    say(f"{name}: getting {self.manifest.models[name].download}")
                    self._store(name, mirror)
        except Timeout as error:
            raise StorageError(f"{self.folder} is locked by another pull", "wait for it to end") from error
        except OSError as error:
            raise self._storage_error(error) from error

    def verify_mirror(self, chosen: Sequence[str], mirror: Path) -> None:
        """Check that a local folder has the upstream files of the chosen models, or of all.

        Raises:
            NotFoundError: no public model has such a name, or there is no such mirror.
            ModelError: a file is missing or has the wrong sha256.
        """
        for file in dict.fromkeys(self.manifest.models[name].download for name in self.names(chosen)):
            model_download.find_in_mirror(file, self.manifest.downloads[file], mirror)

    def _store(self, name: str, mirror: Path | None) -> None:
        model = self.manifest.models[name]
        download = self.manifest.downloads[model.download]
        if mirror is None:
            source = model_download.fetch(model.download, download, self.folder / "downloads")
        else:
            source = model_download.find_in_mirror(model.download, download, mirror)
        data = _onnx_bytes(name, model, source)
        found = sha256(data).hexdigest()
        if found != model.sha256:
            what = f"{name} made from {source} has the sha256 {found[:12]}…, not {model.sha256[:12]}… as tested"
            raise ModelError(what, "report this with the versions of the packages onnx and protobuf")
        write_atomic(self._file(name), data)

    def _file(self, name: str) -> Path:
        return self.folder / f"{name}.onnx"

    def _storage_error(self, error: OSError) -> StorageError:
        reason = error.strerror or str(error)
        return StorageError(
            f"cannot store models in {self.folder}: {reason}", f"set {FOLDER_VARIABLE} to another folder"
        )


def _onnx_bytes(name: str, model: PublicModel, source: Path) -> bytes:
    """The bytes of the ONNX file, made from the published file, whose sha256 was checked."""
    data = source.read_bytes()
    if model.member:
        with zipfile.ZipFile(source) as archive:
            data = archive.read(model.member.name)
        if sha256(data).hexdigest() != model.member.sha256:
            raise ModelError(f"{model.member.name} in {source} has the wrong sha256", "pull it again")
    if model.convert is None:
        return data
    from relit_camera.base.models.tflite.tflite_converter import convert_tflite_to_onnx

    return convert_tflite_to_onnx(data, name, model.convert.inputs, model.convert.outputs)


@lru_cache(maxsize=64)
def _sha256(path: Path, size: int, modified_ns: int) -> str:
    """Return the sha256 of a file, read once for each size and time of change."""
    return model_download.sha256_of(path)
