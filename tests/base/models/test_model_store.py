"""Pulling public models: from a server on this machine, from a folder, and through every mishap."""

from __future__ import annotations

import errno
import io
import logging
import os
import threading
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from hashlib import sha256
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import numpy as np
import pooch
import pytest
from filelock import FileLock
from onnx import TensorProto, helper

from relit_camera.base.errors import ModelError, NotFoundError, StorageError
from relit_camera.base.models import model_store as registry_module
from relit_camera.base.models.model_manifest import Manifest, public_manifest
from relit_camera.base.models.model_store import ModelState, ModelStore, model_path, models_folder
from relit_camera.base.models.session_with_fallback import open_session
from relit_camera.base.models.tflite.tflite_converter import convert_tflite_to_onnx
from tests.base.models.tflite_writer import NetworkWriter, Operator

FLOATS = np.array([1, -2], np.float32)

AGREED = {
    "face_embedding",
    "face_mesh",
    "face_mesh_attention",
    "face_blendshapes",
    "face_detector_yunet",
    "face_detector_short_range",
    "openseeface",
    "selfie_landscape",
    "selfie_square",
}
MIRRORED = sorted(AGREED - {"face_embedding", "face_mesh_attention"})
"""Whose upstream files the shared data has."""


def relu_onnx() -> bytes:
    value = partial(helper.make_tensor_value_info, elem_type=TensorProto.FLOAT, shape=[2])
    graph = helper.make_graph([helper.make_node("Relu", ["a"], ["b"])], "relu", [value("a")], [value("b")])
    return bytes(
        helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8).SerializeToString()
    )


def neg_tflite() -> bytes:
    writer = NetworkWriter()
    writer.computed(2)
    writer.operators.append(Operator("NEG", [0], [writer.computed(2)]))
    return writer.write([0], [1])


@dataclass
class Upstream:
    """A folder served over HTTP, as the authors' site would be."""

    folder: Path
    url: str
    asked: list[str] = field(default_factory=list)


@pytest.fixture
def upstream(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Upstream]:
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")
    folder = tmp_path / "upstream"
    folder.mkdir()
    (folder / "relu.onnx").write_bytes(relu_onnx())
    with zipfile.ZipFile(folder / "bundle.task", "w") as archive:
        archive.writestr(zipfile.ZipInfo("neg.tflite"), neg_tflite())
    site = Upstream(folder, "")

    class Handler(SimpleHTTPRequestHandler):
        def log_message(self, *_: object) -> None:
            site.asked.append(self.path)

    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Handler, directory=folder))
    site.url = f"http://127.0.0.1:{server.server_address[1]}"
    thread = threading.Thread(target=server.serve_forever, args=(0.01,))
    thread.start()
    yield site
    server.shutdown()
    thread.join()
    server.server_close()


def entry(path: Path, urls: list[str]) -> dict[str, object]:
    data = path.read_bytes()
    about = {"licence": "MIT", "credits": "nobody", "page": "https://example.org"}
    return {"urls": urls, "sha256": sha256(data).hexdigest(), "size": len(data), **about}


def manifest_of(upstream: Upstream, urls: dict[str, list[str]] | None = None) -> Manifest:
    """Two models, `plain` and `converted`, served by `upstream` unless `urls` says otherwise."""
    urls = {"relu.onnx": [f"{upstream.url}/relu.onnx"], "bundle.task": [f"{upstream.url}/bundle.task"], **(urls or {})}
    plain, converted = relu_onnx(), convert_tflite_to_onnx(neg_tflite(), "converted", ["image"], ["result"])
    return Manifest.model_validate(
        {
            "downloads": {name: entry(upstream.folder / name, urls[name]) for name in urls},
            "models": {
                "plain": {
                    "purpose": "test",
                    "download": "relu.onnx",
                    "sha256": sha256(plain).hexdigest(),
                    "size": len(plain),
                },
                "converted": {
                    "purpose": "test",
                    "download": "bundle.task",
                    "member": {"name": "neg.tflite", "sha256": sha256(neg_tflite()).hexdigest()},
                    "convert": {"inputs": ["image"], "outputs": ["result"]},
                    "sha256": sha256(converted).hexdigest(),
                    "size": len(converted),
                },
            },
        }
    )


@pytest.fixture
def registry(upstream: Upstream, tmp_path: Path) -> ModelStore:
    return ModelStore(tmp_path / "models", manifest_of(upstream))


def stored(registry: ModelStore) -> set[str]:
    """Names of all files under the folder, but the lock and the list of origins."""
    return {path.name for path in registry.folder.rglob("*") if path.is_file()} - {".lock", "origins.json"}


def test_pull_stores_what_the_manifest_says(registry: ModelStore, upstream: Upstream) -> None:
    assert [registry.state(name) for name in registry.names()] == [ModelState.MISSING, ModelState.MISSING]
    registry.pull()
    assert [registry.state(name) for name in registry.names()] == [ModelState.PULLED, ModelState.PULLED]
    assert registry.path("plain").read_bytes() == relu_onnx()
    assert open_session(registry.path("converted"), "converted").run({"image": FLOATS})["result"].tolist() == [-1, 2]
    assert upstream.asked == ["/relu.onnx", "/bundle.task"]
    assert registry.origin("plain") == registry.origin("converted") == upstream.url.removeprefix("http://")
    registry.pull()
    assert len(upstream.asked) == 2


def test_pull_takes_the_chosen_only_and_says_so(registry: ModelStore) -> None:
    said: list[str] = []
    registry.pull(["plain", "plain"], say=said.append)
    assert stored(registry) == {"plain.onnx", "relu.onnx"}
    registry.pull(["plain"], say=said.append)
    assert said == ["plain: getting relu.onnx", "plain: already there"]


def test_pull_logs_nothing_beside(registry: ModelStore) -> None:
    logger, stream = pooch.get_logger(), io.StringIO()
    logger.setLevel(logging.INFO)
    handler = logging.StreamHandler(stream)
    logger.addHandler(handler)
    registry.pull(["plain"])
    logger.removeHandler(handler)
    assert stream.getvalue() == ""


def test_pull_from_a_folder_asks_nobody(registry: ModelStore, upstream: Upstream) -> None:
    registry.pull(mirror=upstream.folder)
    assert stored(registry) == {"plain.onnx", "converted.onnx"}
    assert upstream.asked == []


def test_a_mirror_may_use_another_name(registry: ModelStore, upstream: Upstream, tmp_path: Path) -> None:
    mirror = tmp_path / "mirror"
    mirror.mkdir()
    (mirror / "other.onnx").write_bytes(relu_onnx())
    with pytest.raises(ModelError, match=r"mirror has no relu.onnx; put it there"):
        registry.pull(["plain"], mirror)
    renamed = registry.manifest.downloads["relu.onnx"].model_copy(update={"also_named": ("other.onnx",)})
    downloads = {**registry.manifest.downloads, "relu.onnx": renamed}
    manifest = registry.manifest.model_copy(update={"downloads": downloads})
    ModelStore(registry.folder, manifest).pull(["plain"], mirror)
    assert registry.state("plain") is ModelState.PULLED


def test_a_wrong_file_in_the_mirror_leaves_nothing(registry: ModelStore, upstream: Upstream) -> None:
    wrong = upstream.folder / "bundle.task"
    wrong.write_bytes(wrong.read_bytes()[:-1] + b"x")
    for fails in (registry.pull, registry.verify_mirror):
        with pytest.raises(ModelError, match=r"bundle.task has the wrong sha256 \w{12}…, not \w{12}…; get") as caught:
            fails(["converted"], upstream.folder)
        assert "\n" not in str(caught.value)
    assert stored(registry) == set()
    registry.verify_mirror(["plain"], upstream.folder)


def test_a_mirror_that_is_no_folder(registry: ModelStore, tmp_path: Path) -> None:
    with pytest.raises(NotFoundError, match="no folder"):
        registry.pull(mirror=tmp_path / "none")


def test_a_wrong_download_leaves_nothing(registry: ModelStore, upstream: Upstream) -> None:
    (upstream.folder / "relu.onnx").write_bytes(b"<html>Sign in to the hotel's network</html>")
    with pytest.raises(ModelError, match=r"cannot download relu.onnx: 127.0.0.1:\d+ gives a file of the wrong sha256"):
        registry.pull(["plain"])
    assert stored(registry) == set()


def test_the_second_url_is_tried(upstream: Upstream, tmp_path: Path) -> None:
    (upstream.folder / "wrong").write_bytes(b"something else")
    urls = [f"{upstream.url}/{path}" for path in ("none", "wrong", "relu.onnx")]
    registry = ModelStore(tmp_path / "models", manifest_of(upstream, {"relu.onnx": urls}))
    registry.pull(["plain"])
    assert registry.state("plain") is ModelState.PULLED
    assert stored(registry) == {"plain.onnx", "relu.onnx"}


@pytest.mark.parametrize(
    ("url", "reason"),
    [
        ("http://127.0.0.1:1/relu.onnx", "no connection to 127.0.0.1:1"),
        ("{site}/none", r"127.0.0.1:\d+ answers 404"),
    ],
)
def test_no_network_names_the_cure(
    upstream: Upstream, tmp_path: Path, url: str, reason: str, capfd: pytest.CaptureFixture[str]
) -> None:
    urls = {"relu.onnx": [url.format(site=upstream.url)]}
    registry = ModelStore(tmp_path / "models", manifest_of(upstream, urls))
    with pytest.raises(ModelError, match=rf"cannot download relu.onnx: {reason}; .*pull --from FOLDER") as caught:
        registry.pull(["plain"])
    assert "\n" not in str(caught.value)
    assert stored(registry) == set()
    assert capfd.readouterr() == ("", "")


def test_a_pull_goes_on_where_the_last_one_failed(registry: ModelStore, upstream: Upstream) -> None:
    bundle = upstream.folder / "bundle.task"
    whole = bundle.read_bytes()
    bundle.unlink()
    with pytest.raises(ModelError, match=r"cannot download bundle\.task"):
        registry.pull()
    assert [registry.state(name) for name in registry.names()] == [ModelState.PULLED, ModelState.MISSING]
    bundle.write_bytes(whole)
    registry.pull()
    assert upstream.asked.count("/relu.onnx") == 1
    assert registry.state("converted") is ModelState.PULLED


@pytest.mark.parametrize("damage", [lambda data: data[:-3], lambda data: data[:-1] + b"x", lambda _: b""])
def test_a_damaged_model_is_found_and_repaired_without_network(
    registry: ModelStore, upstream: Upstream, damage: Callable[[bytes], bytes]
) -> None:
    registry.pull()
    path = registry.path("converted")
    path.write_bytes(damage(path.read_bytes()))
    os.utime(path, ns=(1, 1))  # the clock of the file system may be too coarse to tell
    assert registry.state("converted") is ModelState.DAMAGED
    with pytest.raises(ModelError, match=r"of another version or damaged; run `relit models pull converted`"):
        registry.path("converted")
    registry.pull()
    assert registry.state("converted") is ModelState.PULLED
    assert len(upstream.asked) == 2


def test_a_conversion_that_differs_is_not_stored(registry: ModelStore) -> None:
    other = registry.manifest.models["converted"].model_copy(update={"sha256": "0" * 64})
    manifest = registry.manifest.model_copy(update={"models": {"converted": other}})
    with pytest.raises(ModelError, match="not 000000000000… as tested; report this"):
        ModelStore(registry.folder, manifest).pull()
    assert "converted.onnx" not in stored(registry)


def test_unknown_names_are_refused_before_anything_is_done(registry: ModelStore, upstream: Upstream) -> None:
    for fails in (registry.pull, registry.names):
        with pytest.raises(NotFoundError, match="no public model 'plane'; there are plain, converted"):
            fails(["plain", "plane"])
    assert upstream.asked == []
    with pytest.raises(NotFoundError):
        registry.path("plane")


def test_two_pulls_do_not_collide(registry: ModelStore, upstream: Upstream) -> None:
    threads = [threading.Thread(target=ModelStore(registry.folder, registry.manifest).pull) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(upstream.asked) == ["/bundle.task", "/relu.onnx"]
    assert stored(registry) == {"plain.onnx", "relu.onnx", "converted.onnx", "bundle.task"}


def test_a_lock_is_not_waited_for_without_end(registry: ModelStore, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry_module, "_LOCK_TIMEOUT_S", 0.05)
    registry.folder.mkdir()
    with FileLock(registry.folder / ".lock"), pytest.raises(StorageError, match="locked by another pull"):
        ModelStore(registry.folder, registry.manifest).pull()


def test_a_folder_that_cannot_be(upstream: Upstream, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    registry = ModelStore(tmp_path / "file" / "models", manifest_of(upstream))
    with pytest.raises(StorageError, match=r"cannot store models in .*; set RELIT_MODELS_DIR"):
        registry.pull()


def test_a_full_disk(registry: ModelStore, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object, **__: object) -> str:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(pooch, "retrieve", full)
    with pytest.raises(StorageError, match="No space left on device"):
        registry.pull()
    assert stored(registry) == set()


def test_the_folder_is_the_users_or_the_caches(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("RELIT_MODELS_DIR", str(tmp_path / "mine"))
    assert models_folder() == tmp_path / "mine"
    with pytest.raises(ModelError, match="model face_mesh is not pulled; run `relit models pull face_mesh`"):
        model_path("face_mesh")
    monkeypatch.delenv("RELIT_MODELS_DIR")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    assert models_folder().name == "models"
    assert "relit-camera" in str(models_folder())


def test_the_public_manifest_has_the_agreed_names() -> None:
    manifest = public_manifest()
    assert set(manifest.models) == AGREED
    assert all(url.startswith("https://") for download in manifest.downloads.values() for url in download.urls)
    for model in manifest.models.values():
        if not model.convert and not model.weights:
            assert model.download is not None
            download = manifest.downloads[model.download]
            assert (model.sha256, model.size) == (download.sha256, download.size)


def test_every_mirrored_model_is_made_to_the_byte(
    shared: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("RELIT_MODELS_DIR", str(tmp_path / "models"))
    ModelStore().verify_mirror(MIRRORED, shared / "models")
    ModelStore().pull(MIRRORED, mirror=shared / "models")
    for name in MIRRORED:
        assert open_session(model_path(name), name).provider == "cpu"
    assert capfd.readouterr() == ("", "")
