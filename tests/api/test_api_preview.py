"""The preview: encoded once, shared, paced, and gone when the viewer is."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import httpx
import numpy as np
import pytest
from anyio import CapacityLimiter
from fastapi import FastAPI

from relit_camera.api import preview_stream as module
from relit_camera.api.preview_stream import (
    MAX_VARIANTS,
    EncodedFrame,
    PreviewBroadcaster,
    PreviewStream,
    PreviewVariant,
    encode_preview,
)
from relit_camera.api.server.http_server import ApiServer
from relit_camera.base.images.image_types import DisplayImage
from tests.api.api_client import Client, check_problem, decoded_picture
from tests.api.fake_camera import FPS, FakeCamera
from tests.lateness import Lateness
from tests.small_camera import WAIT_S, wait_until

PREVIEW = "api/v1/preview.mjpg"


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


def test_a_picture_is_scaled_and_mirrored(camera: FakeCamera) -> None:
    whole = decoded_picture(encode_preview(camera.image, PreviewVariant()))
    assert whole.shape == (180, 320, 3)
    assert np.abs(whole.astype(int) - camera.image).mean() < 3
    small = decoded_picture(encode_preview(camera.image, PreviewVariant(width=160, mirror=True)))
    assert small.shape == (90, 160, 3)
    assert small[:, 0, 0].mean() > 230
    assert small[:, -1, 0].mean() < 25
    assert decoded_picture(encode_preview(camera.image, PreviewVariant(width=4000))).shape == (180, 320, 3)


async def see(channel: PreviewStream, count: int, timeout_s: float = 2.0) -> list[EncodedFrame]:
    """The next pictures of a channel."""
    seen = [EncodedFrame(-1, b"")]
    for _ in range(count):
        picture = await channel.next(seen[-1].count, timeout_s)
        assert picture is not None
        assert picture.count > seen[-1].count
        seen.append(picture)
    return seen[1:]


def test_viewers_of_one_variant_share_each_encoding(camera: FakeCamera, monkeypatch: pytest.MonkeyPatch) -> None:
    encodings = []

    def counted(picture: DisplayImage, variant: PreviewVariant) -> bytes:
        encodings.append(variant)
        return encode_preview(picture, variant)

    monkeypatch.setattr(module, "encode_preview", counted)

    async def view(feed: PreviewBroadcaster) -> list[EncodedFrame]:
        with feed.subscribe(PreviewVariant()) as channel:
            return await see(channel, 8)

    async def all_view() -> list[list[EncodedFrame]]:
        feed = PreviewBroadcaster(camera)
        return await asyncio.gather(*(view(feed) for _ in range(40)))

    views = asyncio.run(all_view())
    files: dict[int, set[bytes]] = {}
    for picture in (picture for seen in views for picture in seen):
        files.setdefault(picture.count, set()).add(picture.jpeg)
    assert len(files) <= len(encodings) < 2 * 8
    assert all(len(same) == 1 for same in files.values())


@pytest.mark.slow
def test_encoding_takes_a_small_share_of_a_core(camera: FakeCamera, monkeypatch: pytest.MonkeyPatch) -> None:
    encodings = []

    def slow(picture: DisplayImage, variant: PreviewVariant) -> bytes:
        end = time.thread_time() + 0.02
        while time.thread_time() < end:
            pass
        encodings.append(variant)
        return b"jpeg"

    monkeypatch.setattr(module, "encode_preview", slow)

    async def view() -> None:
        feed = PreviewBroadcaster(camera)
        with feed.subscribe(PreviewVariant()), feed.subscribe(PreviewVariant(width=160)):
            await asyncio.sleep(2.0)

    asyncio.run(view())
    made_in_2_s = 2.0 * module.ENCODING_SHARE / 0.02
    assert 2 <= len(encodings) <= made_in_2_s + 2 + 1  # the first of each stream comes at once


def test_nothing_is_encoded_without_viewers(camera: FakeCamera, monkeypatch: pytest.MonkeyPatch) -> None:
    encodings = []

    def counted(picture: DisplayImage, variant: PreviewVariant) -> bytes:
        encodings.append(variant)
        return b"jpeg"

    monkeypatch.setattr(module, "encode_preview", counted)

    async def view_and_leave() -> int:
        feed = PreviewBroadcaster(camera)
        with feed.subscribe(PreviewVariant()) as channel:
            await see(channel, 2)
        await asyncio.sleep(0.1)  # what had begun ends
        left = len(encodings)
        await asyncio.sleep(0.5)
        return left

    left = asyncio.run(view_and_leave())
    assert len(encodings) == left > 0


def test_a_slow_viewer_skips_pictures_and_delays_nobody(camera: FakeCamera, monkeypatch: pytest.MonkeyPatch) -> None:
    """It takes a picture only whenever another has seen five more. The camera has a new one whenever it is asked."""
    monkeypatch.setattr(camera, "picture", lambda after, _timeout_s: (after + 1, camera.image))

    async def view() -> tuple[list[int], list[int]]:
        feed = PreviewBroadcaster(camera)
        with feed.subscribe(PreviewVariant()) as channel, feed.subscribe(PreviewVariant()) as same:
            fast, slow = [-1], [-1]
            while len(fast) <= 20:
                for _ in range(5):
                    picture = await channel.next(fast[-1], 2.0)
                    assert picture is not None
                    fast.append(picture.count)
                taken = await same.next(slow[-1], 2.0)
                assert taken is not None
                slow.append(taken.count)
            return fast[1:], slow[1:]

    fast, slow = asyncio.run(view())
    assert fast == list(range(fast[0], fast[0] + 20))
    assert len(slow) == 4
    assert all(later - earlier >= 5 for earlier, later in pairwise(slow))


async def made(channel: PreviewStream, count: int) -> list[tuple[float, EncodedFrame]]:
    """The next pictures of a channel that nobody else watches, each with when it came."""
    task = asyncio.create_task(channel.run(CapacityLimiter(1)))
    seen, last = [], -1
    for _ in range(count):
        picture = await channel.next(last, 2.0)
        assert picture is not None
        last = picture.count
        seen.append((time.monotonic(), picture))
    task.cancel()
    return seen


def test_a_rate_limit_is_kept(camera: FakeCamera) -> None:
    times = [at for at, _ in asyncio.run(made(PreviewStream(camera, PreviewVariant(fps=10)), 8))]
    assert (times[-1] - times[0]) / 7 == pytest.approx(0.1, abs=0.025)
    assert all(later - earlier > 0.05 for earlier, later in pairwise(times[1:]))


def test_a_picture_that_was_late_is_not_followed_by_one_at_once(
    camera: FakeCamera, monkeypatch: pytest.MonkeyPatch
) -> None:
    picture, asked = camera.picture, []

    def late(after: int, timeout_s: float) -> Any:
        asked.append(after)
        if len(asked) == 4:
            time.sleep(0.25)
        return picture(after, timeout_s)

    monkeypatch.setattr(camera, "picture", late)
    times = [at for at, _ in asyncio.run(made(PreviewStream(camera, PreviewVariant(fps=10)), 7))]
    gaps = [later - earlier for earlier, later in pairwise(times[1:])]
    assert max(gaps) > 0.25
    assert min(gaps) > 0.05


@pytest.mark.parametrize("late_s", [0.0, 0.004, 0.012])
def test_a_limit_at_the_camera_s_rate_drops_no_picture(
    camera: FakeCamera, monkeypatch: pytest.MonkeyPatch, late_s: float
) -> None:
    """In virtual time, in which the stream wakes late each time."""
    clock, counts = [100.0], []

    async def sleep(seconds: float) -> None:
        clock[0] += seconds + late_s
        await asyncio.sleep(0)

    def picture(after: int, _timeout_s: float) -> Any:
        clock[0] = max(clock[0], (after + 1) / FPS)
        counts.append(int(clock[0] * FPS + 1e-6))
        return counts[-1], camera.image

    monkeypatch.setattr(camera, "picture", picture)
    stream = PreviewStream(camera, PreviewVariant(fps=FPS), now=lambda: clock[0], sleep=sleep)
    asyncio.run(made(stream, 100))
    assert counts[:100] == list(range(counts[0], counts[0] + 100))


def test_many_viewers_share_what_may_be_sent(camera: FakeCamera, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MAX_FRAMES_SENT_PER_S", 40)

    async def rate() -> float:
        feed = PreviewBroadcaster(camera)
        with contextlib.ExitStack() as stack:
            channels = [stack.enter_context(feed.subscribe(PreviewVariant())) for _ in range(4)]
            await see(channels[0], 1)
            began = time.monotonic()
            await see(channels[0], 6)
            return 5 / (time.monotonic() - began)

    assert asyncio.run(rate()) == pytest.approx(40 / 4, rel=0.3)


def test_waiting_ends_when_time_is_up(camera: FakeCamera) -> None:
    camera.publishing = False

    async def wait() -> float:
        with PreviewBroadcaster(camera).subscribe(PreviewVariant()) as channel:
            started = time.monotonic()
            assert await channel.next(-1, 0.1) is None
            return time.monotonic() - started

    assert 0.09 < asyncio.run(wait()) < 0.5


def test_a_preview_that_fails_ends_and_says_so(
    camera: FakeCamera, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def fail(*_: object) -> bytes:
        raise MemoryError("no room")

    monkeypatch.setattr(module, "encode_preview", fail)

    async def look() -> bool:
        with PreviewBroadcaster(camera).subscribe(PreviewVariant()) as channel:
            assert await channel.next(-1, 2.0) is None
            return channel.ended

    assert asyncio.run(look())
    assert "a preview has ended" in caplog.text


def test_channels_last_as_long_as_somebody_watches(camera: FakeCamera) -> None:
    async def look() -> None:
        feed = PreviewBroadcaster(camera)
        with (
            feed.subscribe(PreviewVariant()) as one,
            feed.subscribe(PreviewVariant()) as same,
            feed.subscribe(PreviewVariant(mirror=True)) as other,
        ):
            assert one is same is not other
            assert feed.viewers == 3
            await asyncio.gather(see(one, 1), see(other, 1))
        assert feed.viewers == 0
        await asyncio.sleep(0.05)
        assert one.ended
        assert other.ended

    asyncio.run(look())


def test_snapshot_is_the_newest_picture_whole(client: Client, camera: FakeCamera) -> None:
    answer = client.get("/api/v1/snapshot.jpg")
    assert answer.headers["content-type"] == "image/jpeg"
    assert answer.headers["cache-control"] == "no-store"
    assert np.abs(decoded_picture(answer.content).astype(int) - camera.image).mean() < 3


def test_no_snapshot_before_the_first_picture(
    client: Client, camera: FakeCamera, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("relit_camera.api.routes.preview.FIRST_FRAME_TIMEOUT_S", 0.05)
    camera.publishing = False
    assert check_problem(client.get("/api/v1/snapshot.jpg"), 503)["cure"]


@pytest.mark.parametrize("query", ["fps=0", "fps=nan", "width=10", "width=wide", "mirror=maybe"])
def test_bad_wishes_are_refused(client: Client, query: str) -> None:
    problem = check_problem(client.get(f"/{PREVIEW}?{query}"), 422)
    assert problem["errors"][0]["field"] == query.partition("=")[0]


def test_a_viewer_gets_pictures_and_leaves(server: ApiServer, app: FastAPI) -> None:
    feed = app.state.context.preview
    with httpx.stream("GET", f"{server.address.url}{PREVIEW}?mirror=true&width=160&fps=60", timeout=WAIT_S) as body:
        assert body.headers["content-type"].startswith("multipart/x-mixed-replace")
        chunks = body.iter_bytes()
        pictures = parts(body, chunks, 3)
        assert feed.viewers == 1
    for picture in pictures:
        assert decoded_picture(picture).shape == (90, 160, 3)
        assert decoded_picture(picture)[:, 0, 0].mean() > 230
    wait_until(lambda: feed.viewers == 0)


def test_a_viewer_who_leaves_while_nothing_comes_is_noticed(
    server: ApiServer, app: FastAPI, camera: FakeCamera
) -> None:
    feed = app.state.context.preview
    with httpx.stream("GET", f"{server.address.url}{PREVIEW}", timeout=WAIT_S) as body:
        chunks = body.iter_bytes()
        parts(body, chunks, 1)
        camera.publishing = False
        assert feed.viewers == 1
    wait_until(lambda: feed.viewers == 0)


def test_one_viewer_too_many_is_told_so(server: ApiServer, app: FastAPI, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MAX_VIEWERS", 3)
    feed = app.state.context.preview
    with httpx.Client(base_url=server.address.url, timeout=WAIT_S) as client:
        opened = [client.send(client.build_request("GET", PREVIEW), stream=True) for _ in range(3)]
        wait_until(lambda: feed.viewers == 3)
        assert "3 previews" in check_problem(client.get(PREVIEW), 503)["what"]
        assert client.get("api/v1/mode").status_code == 200
        opened.pop().close()
        wait_until(lambda: feed.viewers < 3)
        opened.append(client.send(client.build_request("GET", PREVIEW), stream=True))
        assert opened[-1].status_code == 200
        for answer in opened:
            answer.close()


def test_one_variant_too_many_is_told_so(server: ApiServer, app: FastAPI) -> None:
    """Viewers of those that there are may still come: they cost no encoding."""
    feed = app.state.context.preview
    with httpx.Client(base_url=server.address.url, timeout=WAIT_S) as client:
        urls = [f"{PREVIEW}?width={64 + number}" for number in range(MAX_VARIANTS)]
        opened = [client.send(client.build_request("GET", url), stream=True) for url in (*urls, urls[0])]
        wait_until(lambda: feed.viewers == MAX_VARIANTS + 1)
        assert "sizes and rates" in check_problem(client.get(f"{PREVIEW}?width=200"), 503)["what"]
        assert client.get("api/v1/mode").status_code == 200
        for answer in opened:
            answer.close()


def test_the_preview_ends_when_the_camera_does(server: ApiServer, camera: FakeCamera) -> None:
    with Lateness() as lateness, httpx.stream("GET", f"{server.address.url}{PREVIEW}", timeout=WAIT_S) as body:
        chunks = body.iter_bytes()
        next(chunks)
        camera.stop()
        started = time.monotonic()
        for _ in chunks:
            pass
        assert lateness.unexplained_s(started, time.monotonic()) < 1
