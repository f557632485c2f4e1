"""What the worker process of a replay does; its imports come late, so that it starts sooner."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from relit_camera.base.concurrency.worker_process import Progress
from relit_camera.base.config.settings import RelitSettings
from relit_camera.live.scene.scene import Scene
from relit_camera.subject.subject import Subject

RELIGHTING = "Relighting"
"""Name of the only stage that is told as progress."""


@dataclass(frozen=True)
class ReplayWork:
    """What is to be relit, and how.

    Attributes:
        settings: of the camera: tracker, relighter and so on.
        scene: what to show, without a subject.
        subject: who: name of a stored one, or one that is not stored; None relights whoever comes.
        video: file to read.
    """

    settings: RelitSettings
    scene: Scene
    subject: str | Subject | None
    video: Path


@dataclass(frozen=True)
class ReplayOutcome:
    """What came of it.

    Attributes:
        frames: number of frames.
        with_face: in how many of them a face was found.
        notes: what works less well than asked, a clause each.
    """

    frames: int
    with_face: int
    notes: tuple[str, ...]


def write_replay(work: ReplayWork, out: Path, tell: Progress) -> ReplayOutcome:
    """Relight a video into the file `out`, which appears whole or not at all.

    Raises:
        VideoError: the video cannot be read to its end, or no face is in it.
        ModelError: the networks that find the face are missing.
        StorageError: the file cannot be written.
    """
    from relit_camera.app.replay.video_replay import replay
    from relit_camera.app.wiring import make_pipeline, make_tracker
    from relit_camera.base.images.image_types import DisplayImage
    from relit_camera.base.video.video_readers import probe_video
    from relit_camera.face.face_state import FaceStatus
    from relit_camera.live.pipeline import Pipeline
    from relit_camera.subject.subject_store import SubjectStore

    tell(RELIGHTING, 0, None)
    total = probe_video(work.video).frames
    person = work.subject
    if isinstance(person, str):
        person = SubjectStore(work.settings.storage.subjects).load(person)
    scene, tracker = replace(work.scene, subject=person), make_tracker(work.settings)
    pipelines: list[Pipeline] = []

    def pipeline_for(size: tuple[int, int]) -> Pipeline:
        pipelines.append(make_pipeline(work.settings, tracker, size))
        return pipelines[0]

    def watch(index: int, before: DisplayImage, after: DisplayImage) -> None:
        tell(RELIGHTING, index + 1, total)

    frames = replay(work.video, out, pipeline_for, lambda time_s: scene, watch)
    with_face = sum(1 for each in frames if each.motion and each.motion.status is FaceStatus.FOUND)
    return ReplayOutcome(len(frames), with_face, tuple(f"{each.what}: {each.why}" for each in pipelines[0].troubles))
