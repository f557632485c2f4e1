"""The preview: encoded once, shared, paced, and gone when the viewer is."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import cv2
import httpx
import numpy as np
import pytest
from fastapi import FastAPI

from relit_camera.api import preview as module
from relit_camera.api.preview import MAX_VIEWERS, Channel, PreviewFeed, Variant, encode
from relit_camera.api.server import ApiServer
from relit_camera.space.images import DisplayImage
from tests.api.api_client import Client, check_problem
from tests.api.fake_camera import FPS, FakeCamera

PREVIEW = "api/v1/preview.mjpg"


def decoded(jpeg: bytes) -> DisplayImage:
    picture: DisplayImage = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)[..., ::-1]
    return picture


def parts(body: httpx.Response, chunks: Iterator[bytes], count: int) -> list[bytes]:
    """The first JPEG files of a multipart/x-mixed-replace body, read as RFC 2046 says.

    `chunks` are the body's, held by the caller: the answer is closed with the last reference to them.
    """
    boundary = b"--" + body.headers["content-type"].partition("boundary=")[2].encode()
    found: list[bytes] = []
    data = b""
    for chunk in chunks:
        data += chunk
        while len(pieces := data.split(boundary + b"\r\n", 2)) == 3:
            head, _, content = pieces[1].partition(b"\r\n\r\n")
            headers = dict(line.split(b": ") for line in head.split(b"\r\n"))
            assert headers[b"Content-Type"] == b"image/jpeg"
            assert content[int(headers[b"Content-Length"]) :] == b"\r\n"
            found.append(content[:-2])
            data = boundary + b"\r\n" + pieces[2]
            if len(found) == count:
                return found
    return found


def wait_until(holds: Callable[[], bool], timeout_s: float = 3.0) -> bool:
    deadline = time.monotonic() + timeout_s
    while time.monotonic() < deadline:
        if holds():
            return True
        time.sleep(0.01)
    return False


def test_a_picture_is_scaled_and_mirrored(camera: FakeCamera) -> None:
    whole = decoded(encode(camera.image, Variant()))
    assert whole.shape == (180, 320, 3)
    assert np.abs(whole.astype(int) - camera.image).mean() < 3
    small = decoded(encode(camera.image, Variant(width=160, mirror=True)))
    assert small.shape == (90, 160, 3)
    assert small[:, 0, 0].mean() > 230
    assert small[:, -1, 0].mean() < 25
    assert decoded(encode(camera.image, Variant(width=4000))).shape == (180, 320, 3)


def test_viewers_of_one_variant_share_each_encoding(camera: FakeCamera, monkeypatch: pytest.MonkeyPatch) -> None:
    encodings = []

    def counted(picture: DisplayImage, variant: Variant) -> bytes:
        encodings.append(variant)
        return encode(picture, variant)

    monkeypatch.setattr(module, "encode", counted)
    feed, all_watch = PreviewFeed(camera), threading.Barrier(4)

    def view(_: int) -> list[tuple[int, bytes]]:
        seen, count = [], -1
        with feed.watch(Variant()) as channel:
            all_watch.wait(5)
            for _ in range(8):
                picture = channel.next(count, 2.0)
                assert picture is not None
                assert picture.count > count
                count = picture.count
                seen.append((count, picture.jpeg))
            all_watch.wait(5)
        return seen

    with ThreadPoolExecutor(4) as pool:
        views = list(pool.map(view, range(4)))
    files: dict[int, set[bytes]] = {}
    for count, jpeg in (pair for seen in views for pair in seen):
        files.setdefault(count, set()).add(jpeg)
    assert len(encodings) == len(files) < 4 * 8
    assert all(len(same) == 1 for same in files.values())


def test_a_rate_limit_is_kept(camera: FakeCamera) -> None:
    channel, times, count = Channel(camera, Variant(fps=10)), [], -1
    for _ in range(8):
        picture = channel.next(count, 1.0)
        assert picture is not None
        count = picture.count
        times.append(time.monotonic())
    assert (times[-1] - times[0]) / 7 == pytest.approx(0.1, abs=0.025)
    assert all(later - earlier > 0.05 for earlier, later in pairwise(times[1:]))


def test_a_limit_at_the_camera_s_rate_drops_no_picture(camera: FakeCamera) -> None:
    channel, counts = Channel(camera, Variant(fps=FPS)), [-1]
    for _ in range(20):
        picture = channel.next(counts[-1], 1.0)
        assert picture is not None
        counts.append(picture.count)
    assert counts[-1] - counts[1] <= 19 + 3  # a busy machine may miss one now and then, not every other


def test_waiting_ends_when_time_is_up(camera: FakeCamera) -> None:
    camera.publishing = False
    channel = Channel(camera, Variant())
    started = time.monotonic()
    assert channel.next(-1, 0.1) is None
    assert time.monotonic() - started < 0.5


def test_a_second_viewer_waits_no_longer_than_it_said(camera: FakeCamera) -> None:
    camera.publishing = False
    channel = Channel(camera, Variant())
    first = threading.Thread(target=channel.next, args=(-1, 1.0))
    first.start()
    started = time.monotonic()
    assert channel.next(-1, 0.1) is None
    assert time.monotonic() - started < 0.5
    first.join()


def test_channels_last_as_long_as_somebody_watches(camera: FakeCamera) -> None:
    feed = PreviewFeed(camera)
    with feed.watch(Variant()) as one, feed.watch(Variant()) as same, feed.watch(Variant(mirror=True)) as other:
        assert one is same is not other
        assert feed.viewers == 3
    assert feed.viewers == 0


def test_snapshot_is_the_newest_picture_whole(client: Client, camera: FakeCamera) -> None:
    answer = client.get("/api/v1/snapshot.jpg")
    assert answer.headers["content-type"] == "image/jpeg"
    assert answer.headers["cache-control"] == "no-store"
    assert np.abs(decoded(answer.content).astype(int) - camera.image).mean() < 3


def test_no_snapshot_before_the_first_picture(
    client: Client, camera: FakeCamera, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("relit_camera.api.routes.preview.FIRST_PICTURE_S", 0.05)
    camera.publishing = False
    assert check_problem(client.get("/api/v1/snapshot.jpg"), 503)["cure"]


@pytest.mark.parametrize("query", ["fps=0", "fps=nan", "width=10", "width=wide", "mirror=maybe"])
def test_bad_wishes_are_refused(client: Client, query: str) -> None:
    problem = check_problem(client.get(f"/{PREVIEW}?{query}"), 422)
    assert problem["errors"][0]["field"] == query.partition("=")[0]


def test_a_viewer_gets_pictures_and_leaves(server: ApiServer, app: FastAPI) -> None:
    feed = app.state.context.preview
    with httpx.stream("GET", f"{server.address.url}{PREVIEW}?mirror=true&width=160&fps=60", timeout=5) as body:
        assert body.headers["content-type"].startswith("multipart/x-mixed-replace")
        chunks = body.iter_bytes()
        pictures = parts(body, chunks, 3)
        assert feed.viewers == 1
    for picture in pictures:
        assert decoded(picture).shape == (90, 160, 3)
        assert decoded(picture)[:, 0, 0].mean() > 230
    assert wait_until(lambda: feed.viewers == 0)


def test_a_viewer_who_leaves_while_nothing_comes_is_noticed(
    server: ApiServer, app: FastAPI, camera: FakeCamera
) -> None:
    feed = app.state.context.preview
    with httpx.stream("GET", f"{server.address.url}{PREVIEW}", timeout=5) as body:
        chunks = body.iter_bytes()
        parts(body, chunks, 1)
        camera.publishing = False
        time.sleep(0.1)
        assert feed.viewers == 1
    assert wait_until(lambda: feed.viewers == 0)


def test_one_viewer_too_many_is_told_so(server: ApiServer, app: FastAPI) -> None:
    feed = app.state.context.preview
    with httpx.Client(base_url=server.address.url, timeout=5) as client:
        opened = [client.send(client.build_request("GET", PREVIEW), stream=True) for _ in range(MAX_VIEWERS)]
        assert wait_until(lambda: feed.viewers == MAX_VIEWERS)
        assert "8 previews" in check_problem(client.get(PREVIEW), 503)["what"]
        assert client.get("api/v1/mode").status_code == 200
        opened.pop().close()
        assert wait_until(lambda: feed.viewers < MAX_VIEWERS)
        opened.append(client.send(client.build_request("GET", PREVIEW), stream=True))
        assert opened[-1].status_code == 200
        for answer in opened:
            answer.close()


def test_the_preview_ends_when_the_camera_does(server: ApiServer, camera: FakeCamera) -> None:
    with httpx.stream("GET", f"{server.address.url}{PREVIEW}", timeout=5) as body:
        chunks = body.iter_bytes()
        next(chunks)
        camera.stop()
        started = time.monotonic()
        for _ in chunks:
            pass
        assert time.monotonic() - started < 1
