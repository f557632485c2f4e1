"""The store of named environments: what goes in, what comes out, what is refused."""

from __future__ import annotations

import io
from pathlib import Path

import cv2
import numpy as np
import pytest

from relit_camera.base.errors import InputError, NotFoundError, PanoramaError, StorageError
from relit_camera.light.environments import environment_store
from relit_camera.light.environments.builtin.builtin_environments import BUILTIN_NAMES
from relit_camera.light.environments.environment_panorama import read_panorama
from relit_camera.light.environments.environment_store import EnvironmentStore
from relit_camera.light.light_map import total


@pytest.fixture
def store(tmp_path: Path) -> EnvironmentStore:
    return EnvironmentStore(tmp_path / "data" / "environments")


def hdr(path: Path, level: float = 1.0, right: float = 1.0) -> Path:
    image = np.full((16, 32, 3), level, np.float32)
    image[:, 16:] *= right
    assert cv2.imwrite(str(path), image)
    return path


def left_behind(store: EnvironmentStore) -> list[str]:
    return sorted(path.name for path in store.folder.iterdir()) if store.folder.exists() else []


def test_built_in_names_are_always_there(store: EnvironmentStore) -> None:
    assert store.names() == list(BUILTIN_NAMES)
    assert store.load("studio").name == "studio"


def test_add_load_and_remove(store: EnvironmentStore, tmp_path: Path) -> None:
    added = store.add("my room", hdr(tmp_path / "a.hdr", 2.0))
    assert added.name == "my room"
    assert store.names() == [*BUILTIN_NAMES, "my room"]
    np.testing.assert_allclose(total(store.load("my room").light_map), 2 * 4 * np.pi, rtol=1e-3)
    store.remove("my room")
    assert store.names() == list(BUILTIN_NAMES)
    assert left_behind(store) == []


def test_bytes_are_stored_as_they_are(store: EnvironmentStore, tmp_path: Path) -> None:
    data = hdr(tmp_path / "a.hdr").read_bytes()
    store.add_upload("upload", io.BytesIO(data), ".HDR")
    assert (store.folder / "upload.hdr").read_bytes() == data


def test_loading_twice_reads_once_until_the_file_changes(store: EnvironmentStore, tmp_path: Path) -> None:
    first = store.add("room", hdr(tmp_path / "a.hdr"))
    assert store.load("room") is first
    store.add("room", hdr(tmp_path / "b.hdr", 3.0))
    assert store.load("room").light_map.max() == pytest.approx(3, rel=0.01)


def test_a_file_that_was_replaced_or_removed_takes_no_memory(store: EnvironmentStore, tmp_path: Path) -> None:
    recent = environment_store._RECENT
    store.add("room", hdr(tmp_path / "a.hdr"))
    kept = recent.nbytes
    store.add("room", hdr(tmp_path / "b.hdr", 3.0))
    assert recent.nbytes == kept
    store.remove("room")
    assert recent.nbytes == kept - 16 * 32 * 3 * 2


def test_a_replacement_of_another_format_leaves_one_file(store: EnvironmentStore, tmp_path: Path) -> None:
    store.add("room", hdr(tmp_path / "a.hdr"))
    cv2.imwrite(str(tmp_path / "a.png"), np.full((16, 32, 3), 128, np.uint8))
    store.add("room", tmp_path / "a.png")
    assert left_behind(store) == ["room.png"]


def test_map_axes_are_stored_as_a_picture(store: EnvironmentStore, tmp_path: Path) -> None:
    source = hdr(tmp_path / "a.hdr", right=5)
    stored = store.add("room", source, axes="map")
    np.testing.assert_array_equal(stored.panorama.radiance, read_panorama(source, axes="map").radiance)
    assert left_behind(store) == ["room.exr"]


def test_clipped_highlights_are_said_in_a_note(store: EnvironmentStore, tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "a.png"), np.full((16, 32, 3), 255, np.uint8))
    assert "clipped" in store.add("room", tmp_path / "a.png").notes[0]


@pytest.mark.parametrize("name", ["", ".hidden", "../evil", "a/b", "a\\b", "x" * 65, "é", "-dash", "a\n"])
def test_unsafe_names_are_refused(store: EnvironmentStore, tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match="cannot name an environment"):
        store.add(name, hdr(tmp_path / "a.hdr"))
    assert left_behind(store) == []


@pytest.mark.parametrize("name", [*BUILTIN_NAMES, "background"])
def test_reserved_names_are_refused(store: EnvironmentStore, tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match="reserved name"):
        store.add(name, hdr(tmp_path / "a.hdr"))


def test_built_in_environments_stay(store: EnvironmentStore) -> None:
    with pytest.raises(InputError, match="built in"):
        store.remove("studio")


def test_what_is_no_light_is_refused_and_leaves_what_was(store: EnvironmentStore, tmp_path: Path) -> None:
    good = store.add("room", hdr(tmp_path / "a.hdr"))
    with pytest.raises(PanoramaError, match=r"^room\.hdr cannot be read") as caught:
        store.add_upload("room", io.BytesIO(b"rubbish"), ".hdr")
    assert str(tmp_path) not in str(caught.value)
    with pytest.raises(PanoramaError, match="format"):
        store.add_upload("room", io.BytesIO(b"rubbish"), "")
    with pytest.raises(PanoramaError, match="no panorama at"):
        store.add("room", tmp_path / "none.hdr")
    assert store.load("room") is good
    assert left_behind(store) == ["room.hdr"]


def test_unknown_names_list_close_ones(store: EnvironmentStore) -> None:
    with pytest.raises(NotFoundError, match="did you mean 'studio'"):
        store.load("stdio")
    with pytest.raises(NotFoundError, match="there are: studio, window"):
        store.remove("zzzzzz")
    with pytest.raises(NotFoundError):
        store.thumbnail("nothing")


def test_resolve_takes_a_stored_name_first_and_then_a_path(
    store: EnvironmentStore, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    stored = store.add("room.hdr", hdr(tmp_path / "a.hdr"))
    hdr(tmp_path / "room.hdr", 7)
    assert store.resolve("room.hdr") is stored
    assert store.resolve("./room.hdr").light_map.max() == pytest.approx(7, rel=0.01)
    assert store.resolve("./room.hdr").name == "room"
    with pytest.raises(PanoramaError, match=r"no panorama at none\.hdr; check the path"):
        store.resolve("none.hdr")
    with pytest.raises(NotFoundError, match="no environment 'none'"):
        store.resolve("none")


def test_foreign_files_in_the_folder_are_left_alone(store: EnvironmentStore) -> None:
    store.folder.mkdir(parents=True)
    for name in ("notes.txt", ".hidden.hdr", "studio.hdr", "bad*name.hdr"):
        (store.folder / name).write_bytes(b"")
    assert store.names() == list(BUILTIN_NAMES)


def test_a_file_put_there_by_hand_counts_and_a_damaged_one_is_said_to_be(store: EnvironmentStore) -> None:
    store.folder.mkdir(parents=True)
    hdr(store.folder / "mine.hdr")
    (store.folder / "broken.hdr").write_bytes(b"#?RADIANCE\n")
    assert store.names() == [*BUILTIN_NAMES, "broken", "mine"]
    assert store.load("mine").light_map.max() == pytest.approx(1, rel=0.01)
    with pytest.raises(PanoramaError, match="broken"):
        store.load("broken")


def test_a_folder_that_cannot_be_made_is_said(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(StorageError, match="cannot write"):
        EnvironmentStore(tmp_path / "file" / "environments").add("room", hdr(tmp_path / "a.hdr"))


def test_thumbnails_are_small_jpegs_as_seen_from_inside(store: EnvironmentStore, tmp_path: Path) -> None:
    store.add("room", hdr(tmp_path / "a.hdr", 0.05, right=20))
    picture = cv2.imdecode(np.frombuffer(store.thumbnail("room"), np.uint8), cv2.IMREAD_COLOR)
    assert picture is not None
    assert picture.shape == (128, 256, 3)
    # As the file: bright right half.
    assert picture[:, 192].mean() > picture[:, 64].mean() + 50


def test_the_default_folder_is_the_user_s() -> None:
    assert EnvironmentStore().folder.parts[-2:] == ("relit-camera", "environments")
