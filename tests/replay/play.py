"""Plays a case: the picture path of `relit replay`, its frames kept instead of encoded."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from relit_camera.app.replay.video_replay import ReplayedFrame, replay
from relit_camera.app.wiring import make_pipeline, make_tracker
from relit_camera.base.config.look import Lighting, Look
from relit_camera.base.config.settings import RelitSettings, StorageSettings
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.base.rotations import Angles
from relit_camera.cli.arguments import parse_background
from relit_camera.face.face_state import FaceStatus
from relit_camera.live.pipeline import Pipeline
from relit_camera.live.scene.scene_controller import SceneController
from relit_camera.live.status.camera_status import Degradation
from tests.replay.case import Case
from tests.replay.materials import find, subject_file, use_models, whole_picture

RECORDED = "recorded:"


@dataclass(frozen=True)
class Played:
    """What came out.

    Attributes:
        frames: what each frame was.
        live: uint8 sRGB pictures of the clip.
        relit: uint8 sRGB pictures that the replay made of them.
        troubles: what worked less well than asked.
    """

    frames: list[ReplayedFrame]
    live: list[DisplayImage]
    relit: list[DisplayImage]
    troubles: list[Degradation]

    @property
    def found(self) -> float:
        """Share of the frames in which the face was found."""
        return sum(status(frame) is FaceStatus.FOUND for frame in self.frames) / len(self.frames)

    @property
    def angles(self) -> list[Angles | None]:
        """Each frame's pose relative to neutral, degrees; None where the picture path followed no face."""
        return [frame.motion.angles if frame.motion else None for frame in self.frames]


def status(frame: ReplayedFrame) -> FaceStatus:
    """Whether the face was found in a frame."""
    return frame.motion.status if frame.motion else FaceStatus.LOST


def play(case: Case, folder: Path) -> Played:
    """Play the case of a folder.

    Raises:
        UnavailableError: data or models that it needs are not on this machine.
        RelitError: as `relit replay` would say.
    """
    clip = find(case.clip, folder, "clip.mp4")
    lights = find(case.subject, folder, "olat/lights.lp")
    tracker = case.tracker
    if tracker.startswith(RECORDED):
        tracker = RECORDED + str(find(tracker.removeprefix(RECORDED), folder, "track.json"))
    else:
        use_models()
    settings = RelitSettings(
        storage=StorageSettings(data_dir=folder / "data"),
        tracker={"name": tracker},
        matte=f"{RECORDED}{whole_picture()}" if case.background == "none" else RelitSettings().matte,
        subject=None,
    )
    scene_controller = SceneController(settings.storage)
    scene_controller.load_configured_subject(str(subject_file(lights, case.gamma)))
    scene_controller.set_avatar_allowed(True)  # the mannequin is not known by its own subject
    named = case.environment if case.environment in scene_controller.environments.names() else None
    environment = scene_controller.register_temporary_environment(named or str(find(case.environment, folder, "")))
    lighting = Lighting(environment=environment, yaw_deg=case.yaw_deg)
    scene_controller.set_look(Look(lighting=lighting, background=parse_background(case.background), mode=case.mode))
    live: list[DisplayImage] = []
    relit: list[DisplayImage] = []
    pipelines: list[Pipeline] = []

    def pipeline_for(size: tuple[int, int]) -> Pipeline:
        pipelines.append(make_pipeline(settings, make_tracker(settings), size))
        return pipelines[0]

    def watch(_: int, before: DisplayImage, after: DisplayImage) -> None:
        live.append(before)
        relit.append(after)

    frames = replay(clip, None, pipeline_for, lambda _: scene_controller.scene, watch)
    return Played(frames, live, relit, pipelines[0].troubles)
