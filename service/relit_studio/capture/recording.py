"""Recording of a scene with a phone: video, truth and contact sheet."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from relit_camera.base.images.contact_sheet import contact_sheet
from relit_camera.base.images.image_files import write_display
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.base.storage.atomic_files import make_folder, write_atomic
from relit_camera.base.video.video_writer import VideoWriter
from relit_studio.base.progress import Progress, no_progress
from relit_studio.cameras.camera_simulation import Gains
from relit_studio.cameras.pinhole import Pinhole
from relit_studio.capture.ball.mirror_ball import MirrorBall
from relit_studio.capture.capture_scene import Scene
from relit_studio.capture.capture_truth import capture_truth, frame_truth
from relit_studio.capture.frame_store import FinishedFrame, FrameStore
from relit_studio.capture.lossless_writer import LosslessWriter
from relit_studio.capture.phone import Phone, Stages

_CRF = 20
_STILL_FRAMES, _BALL_FRAMES = 12, 6
_BALL_MARGIN = 1.5
_FACE_POINTS = 5000
"""Number of surface points of the face, enough for centroids and fits."""


def record(
    scene: Scene, stages: Stages, folder: Path, room: str, seed: int, progress: Progress = no_progress
) -> tuple[Path, Path]:
    """Write `capture.mp4` (`capture.mkv`, lossless, without H.264), `truth.json` and `sheet.png` into `folder`.

    Finished frames are kept in `folder/.frames` until all are done: the same call goes on where it was interrupted.

    Args:
        scene: what happens.
        stages: of the phone's processing.
        folder: made if missing; what it holds under these names is replaced.
        room: its name, for the truth.
        seed: of the noise; also named in the truth.
        progress: told of every frame.

    Returns:
        The video and the truth file.

    Raises:
        StorageError: the folder cannot be written.
    """
    make_folder(folder)
    video = folder / ("capture.mp4" if stages.h264 else "capture.mkv")
    face = scene.person.face_points()
    face = face[:: max(1, len(face) // _FACE_POINTS)]
    whole = capture_truth(scene, stages, video.name, room, seed, face)
    total = scene.timing.frames
    # Includes settings that frames depend on but the truth does not contain.
    settings = {"frames": total, "motion": scene.motion, "room_light": float(scene.room.radiance.mean())}
    store = FrameStore(folder / ".frames", whole | settings)
    gains, truths = Gains(), []
    phone: Phone | None = None
    for index in range(total):
        done = store.load(index)
        if done is None:
            phone = phone or Phone(stages, seed, scene.ordinary_mean())
            state = scene.frame_state(index)
            light = scene.light(state)
            done = FinishedFrame(frame_truth(scene, state, gains, face), phone.settle(gains, light))
            store.save(index, phone.develop(light, gains, index), done)
        truths.append(done.truth)
        gains = done.next_gains
        progress(index + 1, total)
    _encode(store, total, video, stages, scene)
    write_display(folder / "sheet.png", _sheet(store, total, scene))
    write_atomic(folder / "truth.json", json.dumps(whole | {"frames": truths}))
    store.remove()
    return video, folder / "truth.json"


def _encode(store: FrameStore, total: int, video: Path, stages: Stages, scene: Scene) -> None:
    size, fps = (scene.camera.width, scene.camera.height), scene.timing.fps
    with VideoWriter(video, size, fps, crf=_CRF) if stages.h264 else LosslessWriter(video, size, fps) as writer:
        for index in range(total):
            writer.write(store.picture(index))


def _sheet(store: FrameStore, total: int, scene: Scene) -> DisplayImage:
    """Contact sheet: frames spread over the video, successive frames from its middle, and crops of each ball."""
    spread = np.linspace(0, total - 1, _STILL_FRAMES).round().astype(int)
    middle = max(0, min(total // 2, total - _BALL_FRAMES)) + np.arange(_BALL_FRAMES)
    pictures = [[store.picture(int(index)) for index in chosen] for chosen in np.split(spread, 2)]
    successive = [store.picture(min(int(index), total - 1)) for index in middle]
    some = [store.picture(int(index)) for index in spread[:: _STILL_FRAMES // _BALL_FRAMES]]
    balls = [[picture[_around(ball, scene.camera)] for picture in some] for ball in scene.balls]
    labels = ("spread over the video", "", "successive", "the ball", "the second ball")
    return contact_sheet([*pictures, successive, *balls], labels[: 3 + len(balls)])


def _around(ball: MirrorBall, camera: Pinhole) -> tuple[slice, slice]:
    """Rows and columns of the picture about a ball."""
    outline = ball.outline(camera)
    reach = outline.radius * _BALL_MARGIN
    rows, columns = (
        slice(max(0, int(at - reach)), min(size, int(at + reach) + 1))
        for at, size in ((outline.y, camera.height), (outline.x, camera.width))
    )
    return rows, columns
