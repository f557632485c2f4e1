"""Raw files from a local folder: verified, and never another one."""

from __future__ import annotations

import errno
from pathlib import Path

import pytest

from relit_camera.base.errors import NotFoundError, StorageError
from relit_studio.base.assets.manifest import Manifest, manifest
from relit_studio.base.assets.store import asset, assets_folder, fetch_assets


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


def test_every_file_is_credited() -> None:
    assert {file.credit for file in manifest().files} == set(manifest().credits)


def test_files_come_from_a_mirror(shared: Path) -> None:
    fetched = fetch_assets(shared / "faces")
    assert [path.relative_to(assets_folder()).as_posix() for path in fetched] == [f.name for f in manifest().files]
    assert fetch_assets(Path("/no/such/folder")) == fetched  # those that are sound are left


def test_what_is_missing_is_named(tmp_path: Path) -> None:
    with pytest.raises(NotFoundError, match=r"has no ict_facekit_light\.npz"):
        fetch_assets(tmp_path)
    with pytest.raises(NotFoundError, match="relit_studio fetch"):
        asset("ict_facekit_light.npz")


def test_another_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "ict_facekit_light.npz").write_bytes(b"not it")
    with pytest.raises(NotFoundError, match="is another file"):
        fetch_assets(tmp_path)
    assert not (assets_folder() / "ict_facekit_light.npz").exists()


def test_a_disk_that_is_full_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "full")

    scan = [file for file in manifest().files if file.urls]
    monkeypatch.setattr("relit_studio.base.assets.store.manifest", lambda: Manifest(credits={}, files=tuple(scan)))
    monkeypatch.setattr("pooch.retrieve", full)
    with pytest.raises(StorageError, match=r"cannot write .*LeePerrySmith\.glb"):
        fetch_assets()


def test_what_no_address_offers_is_said() -> None:
    with pytest.raises(NotFoundError, match="offered by no address"):
        fetch_assets()
