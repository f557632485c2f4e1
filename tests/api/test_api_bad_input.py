"""Bad input over the API: a problem in one line, nothing written, and the camera goes on."""

from __future__ import annotations

import json
import socket
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from time import process_time

import pytest

from relit_camera.api.app import create_app
from relit_camera.api.middleware.body_limits import MAX_UPLOAD_BYTES
from relit_camera.api.server.http_server import start_api_server
from relit_camera.base.config.settings import RelitSettings, ServerSettings, StorageSettings
from tests import bad_pictures as bad
from tests.api.api_client import Client, check_problem, hdr, png
from tests.api.fake_camera import FakeCamera

BACKGROUNDS: dict[str, tuple[Callable[[], bytes], str]] = {
    "empty": (lambda: b"", "is empty"),
    "text": (lambda: b"hello", "none of PNG"),
    "gif, animated": (bad.gif, "none of PNG"),
    "svg": (lambda: b'<svg xmlns="http://www.w3.org/2000/svg"/>', "none of PNG"),
    "png, 600 MB in 0.6": (bad.png_bomb, "20000x10000 pixels, more than 64 million"),
    "png of 2^31 a side": (lambda: bad.png_of_size(2**31 - 1, 2**31 - 1), "more than 64 million"),
    "png of no width": (lambda: bad.png_of_size(0, 5), "0x5 pixels"),
    "png, cut off": (lambda: png()[:20], "header is cut off"),
    "jpeg of 65500 a side": (lambda: bad.jpeg_of_size(65500, 65500), "more than 64 million"),
    "jpeg of 600 scans": (lambda: bad.jpeg_of_scans(600), "more than 500 scans"),
    "webp of 2^24 a side": (lambda: bad.webp_of_size(1 << 24, 1 << 24), "more than 64 million"),
    "webp of two sizes": (lambda: bad.webp_of_size(8000, 4000), "cannot be read"),
    "bmp of a negative width": (lambda: bad.bmp_of_size(-64, 32), "-64x32 pixels"),
    "bmp of two negatives": (lambda: bad.bmp_of_size(-64000, -32000), "-64000x32000 pixels"),
    "bmp without its pixels": (lambda: bad.bmp_of_size(60000, 1000), "cannot be read"),
    "tiff of 2^32": (lambda: bad.tiff_of_size(2**32 - 1, 1), "more than 64 million"),
    "tiff without its pixels": (lambda: bad.tiff_of_size(60000, 1000), "cannot be read"),
}
PANORAMAS: dict[str, tuple[str, Callable[[], bytes], str]] = {
    "hdr of 10^18 pixels": ("a.hdr", lambda: bad.hdr_of_size(999999998, 499999999), "more than 33.6 million"),
    "hdr without its pixels": ("a.hdr", lambda: bad.hdr_of_size(8000, 4000), "cannot be read"),
    "hdr of two sizes": ("a.hdr", bad.hdr_of_two_sizes, "a line longer than 120 bytes"),
    "hdr that is png": ("a.hdr", lambda: png(), "not a Radiance file"),
    "exr of 2^39 pixels": ("a.exr", lambda: bad.exr_of_size(1 << 20, 1 << 19), "million values"),
    "exr without its pixels": ("a.exr", lambda: bad.exr_of_size(8000, 4000), "cannot be read"),
    "exr of a negative size": ("a.exr", lambda: bad.exr_of_size(-8000, -4000), "cannot be read"),
    "exr of 130 channels": ("a.exr", lambda: bad.exr_of_size(2048, 1024, 130), "million values"),
    "png, 600 MB in 0.6": ("a.png", bad.png_bomb, "more than 33.6 million"),
    "not twice as wide": ("a.png", lambda: png(64, 64), "not twice as wide"),
    "no suffix": ("a", hdr, "no panorama format"),
    "foreign suffix": ("a.exe", hdr, "no panorama format"),
    "suffix with NUL": ("a.hdr\0", hdr, "no panorama format"),
    "suffix with folders": ("a.hdr\\..\\b", hdr, "no panorama format"),
    "long suffix": ("a." + "h" * 3000, hdr, "no panorama format"),
}
NAMES = ["..", ".", "", "/etc/passwd", "../evil", "..\\evil", "a/b", "a\\b", "a\0b", "~root", "-x", ".hidden",
         "x" * 65, "é", "a\nb", "%2e%2e", "a:b", "con", "NUL", "com1", "Lpt9.x", "aux .hdr",
         "trailing.", "trailing "]  # fmt: skip


@dataclass(frozen=True)
class Served:
    """A camera on a real port, to which requests go as they are written: no client of ours tidies the path."""

    camera: FakeCamera
    host: str
    port: int

    def status(self, method: str, target: str) -> int:
        """The status of the answer to a request without a body."""
        head = f"{method} {target} HTTP/1.1\r\nHost: {self.host}:{self.port}\r\nConnection: close\r\n"
        with socket.create_connection((self.host, self.port), 5) as connection:
            connection.sendall(f"{head}Content-Length: 0\r\n\r\n".encode())
            return int(connection.recv(1000).split()[1])


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """One for all requests that must leave nothing behind: to start and stop one for each takes longer than all."""
    folder = tmp_path_factory.mktemp("served") / "data"
    camera = FakeCamera(folder)
    settings = RelitSettings(storage=StorageSettings(data_dir=folder))
    with start_api_server(create_app(camera, settings), ServerSettings(port=0)) as server:
        yield Served(camera, server.address.host, server.address.port)
    camera.stop()


def stored(camera: FakeCamera) -> set[str]:
    folder = camera.scene_controller.environments.folder.parent
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("case", BACKGROUNDS)
def test_a_bad_background(client: Client, camera: FakeCamera, case: str) -> None:
    make, said = BACKGROUNDS[case]
    began = process_time()
    problem = check_problem(client.upload("/api/v1/backgrounds", "room", make(), "a.jpg"), 422)
    assert process_time() - began < 10
    assert said in problem["what"]
    assert "\n" not in problem["detail"]
    assert stored(camera) == set()


@pytest.mark.parametrize("case", PANORAMAS)
def test_a_bad_panorama(client: Client, camera: FakeCamera, case: str) -> None:
    file_name, make, said = PANORAMAS[case]
    problem = check_problem(client.upload("/api/v1/environments", "room", make(), file_name), 422)
    assert said in problem["what"]
    assert "\n" not in problem["detail"]
    assert stored(camera) == set()


@pytest.mark.parametrize("collection", ["environments", "backgrounds"])
def test_a_file_that_is_too_large(client: Client, camera: FakeCamera, collection: str) -> None:
    check_problem(client.upload(f"/api/v1/{collection}", "room", bytes(MAX_UPLOAD_BYTES + 1), "a.hdr"), 413)
    assert stored(camera) == set()


def test_of_an_animation_the_first_frame_is_kept(client: Client, camera: FakeCamera) -> None:
    assert client.upload("/api/v1/backgrounds", "room", bad.animated_webp(), "a.webp").status_code == 201
    assert stored(camera) == {"backgrounds/room.jpg"}


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("collection", ["environments", "backgrounds"])
def test_a_name_that_is_none(client: Client, camera: FakeCamera, collection: str, name: str) -> None:
    check_problem(client.upload(f"/api/v1/{collection}", name, hdr(), "a.hdr"), 422)
    assert stored(camera) == set()


@pytest.mark.parametrize("name", ["%2e%2e", "..%2f..%2fevil", "..%5cevil", "%00", "a%00b", "%2fetc%2fpasswd", "con",
                                  "a%0ab", "%252e%252e%252fevil", "x" * 65])  # fmt: skip
@pytest.mark.parametrize("path", ["presets", "environments", "backgrounds", "subjects"])
@pytest.mark.parametrize("method", ["GET", "PUT", "DELETE"])
def test_a_path_leads_nowhere_else(served: Served, path: str, method: str, name: str) -> None:
    outside = served.camera.scene_controller.environments.folder.parent.parent / "evil.yaml"
    outside.write_text("{}")
    assert served.status(method, f"/api/v1/{path}/{name}") in (404, 405, 422)
    assert outside.read_text() == "{}"
    assert stored(served.camera) == set()


@pytest.mark.parametrize("path", ["/panel/../app.py", "/panel/..%2fapp.py", "/panel/%2e%2e/app.py",
                                  "/panel//etc/passwd",
                                  "/panel/..%5capp.py", "/panel/%00", "/panel/.", "/panel/" + "x" * 300])  # fmt: skip
def test_the_panel_s_folder_has_no_way_out(served: Served, path: str) -> None:
    assert served.status("GET", path) == 404


JSON = {
    "nested 100000 deep": ("[" * 100_000, 400),
    "objects nested": ('{"a":' * 50_000, 400),
    "a number of 5000 digits": ('{"yaw_deg": ' + "9" * 5000 + "}", 400),
    "infinite": ('{"yaw_deg": 1e999}', 422),
    "NaN": ('{"yaw_deg": NaN}', 422),
    "a million lamps": (json.dumps({"lamps": [{}] * 100_000}), 422),
    "more than 1 MiB": (json.dumps({"environment": "x" * (1 << 20)}), 413),
    "a name with a way out": ('{"environment": "../../evil"}', 422),
    "lone surrogate": ('{"environment": "\\ud800"}', 422),
    "not UTF-8": (b'{"environment": "\xff"}', 400),
    "text": ("hello", 400),
}


@pytest.mark.parametrize("case", JSON)
@pytest.mark.parametrize(("method", "path"), [("PUT", "lighting"), ("PATCH", "lighting"), ("PUT", "presets/look")])
def test_bad_json(client: Client, camera: FakeCamera, case: str, method: str, path: str) -> None:
    text, status = JSON[case]
    before = camera.scene_controller.scene
    answer = client.request(method, f"/api/v1/{path}", content=text, headers={"content-type": "application/json"})
    assert answer.status_code in (status, 422)
    check_problem(answer, answer.status_code)
    assert len(answer.content) < 20_000
    assert camera.scene_controller.scene is before
    assert stored(camera) == set()


PRESETS = {
    "billion laughs": "a: &a [x,x,x,x,x,x,x,x,x]\n" + "".join(
        f"{chr(98 + i)}: &{chr(98 + i)} [{','.join(['*' + chr(97 + i)] * 9)}]\n" for i in range(9)
    ),
    "nested": "[" * 100_000,
    "objects": "!!python/object/apply:os.system ['touch /tmp/evil']",
    "large": "#" * ((1 << 20) + 1),
    "a date that is none": "lighting: 2001-99-99",
    "a number of 5000 digits": "lighting: " + "9" * 5000,
    "bytes": "\0\1\2",
    "a list": "[1, 2]",
}  # fmt: skip


@pytest.mark.parametrize("case", PRESETS)
def test_a_bad_preset_file(client: Client, camera: FakeCamera, case: str) -> None:
    folder = camera.scene_controller.environments.folder.parent / "presets"
    folder.mkdir(parents=True)
    (folder / "look.yaml").write_text(PRESETS[case])
    began = process_time()
    problem = check_problem(client.post("/api/v1/presets/look/apply"), 422)
    assert process_time() - began < 5
    assert "preset 'look' cannot be read" in problem["what"]
    assert len(problem["detail"]) < 500


# Symbolic links in the data folder are the owner's own: they are followed, and deleting or replacing is of the link.


@pytest.mark.parametrize("collection", ["presets", "environments", "backgrounds"])
def test_a_link_is_deleted_and_not_what_it_leads_to(
    client: Client, camera: FakeCamera, tmp_path: Path, collection: str
) -> None:
    suffix, data = {"presets": (".yaml", b"{}"), "environments": (".hdr", hdr()), "backgrounds": (".png", png())}[
        collection
    ]
    outside = tmp_path / f"outside{suffix}"
    outside.write_bytes(data)
    folder = camera.scene_controller.environments.folder.parent / collection
    folder.mkdir(parents=True)
    (folder / f"linked{suffix}").symlink_to(outside)
    assert "linked" in [item["name"] for item in client.get(f"/api/v1/{collection}").json()]
    if collection == "presets":
        assert client.put("/api/v1/presets/linked", {"mode": "portrait"}).status_code == 200
        assert not (folder / "linked.yaml").is_symlink()
    assert client.delete(f"/api/v1/{collection}/linked").status_code == 204
    assert list(folder.iterdir()) == []
    assert outside.read_bytes() == data
