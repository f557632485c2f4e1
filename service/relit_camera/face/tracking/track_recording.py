"""Recorded tracks: the JSON file of `relit track`, a tracker's states for every frame of a video, and its playback.

Angles are degrees and positions centimetres, relative to the camera; landmarks are pixels with pixel centres at
integers + ½ (see `face.face_state`).

The tracker `recorded:PATH` plays such a file back exactly, without any model.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from relit_camera.base.errors import NotFoundError, TrackError
from relit_camera.base.images.image_types import Frame
from relit_camera.base.rotations import angles_from_rotation, rotation_from_angles
from relit_camera.base.storage.atomic_files import write_atomic
from relit_camera.face.face_state import LOST, FaceState, FaceStatus, Tracker
from relit_camera.face.head_pose import HeadPose, guess_focal
from relit_camera.face.landmarks.landmark_schemes import landmark_scheme
from relit_camera.face.tracking.trackers import TrackerOptions

VERSION: Literal[1] = 1
MAX_BYTES = 512 << 20
"""Largest track file, about 20 minutes; in memory it takes several times as much."""

Positive = Annotated[float, Field(gt=0)]
Pixels = Annotated[int, Field(gt=0, le=16384)]
Share = Annotated[float, Field(ge=0, le=1)]


class _Record(BaseModel):
    model_config = ConfigDict(frozen=True, allow_inf_nan=False, use_attribute_docstrings=True)


class TrackPose(_Record):
    """Intrinsic Y-X-Z angles of the head relative to the camera, in degrees."""

    yaw: float
    pitch: float
    roll: float


class TrackFrame(_Record):
    """One frame. Where no face was found only `found`, `status` and `time_s` count."""

    time_s: float
    found: bool
    """Whether there are landmarks and a pose."""
    status: FaceStatus
    confidence: Share = 0.0
    pose: TrackPose | None = None
    translation: tuple[float, float, float] | None = None
    """Of the canonical face's origin in camera axes, centimetres; z is negative."""
    landmarks: tuple[tuple[float, float], ...] = ()
    eyes: tuple[float, float] = (0.0, 0.0)
    """Opening of the subject's right and left eye."""
    mouth: float = 0.0
    blendshapes: dict[str, float] = {}

    @model_validator(mode="after")
    def _whole(self) -> TrackFrame:
        if self.found != (self.status is not FaceStatus.LOST):
            raise ValueError(f"found is {str(self.found).lower()}, but status is {self.status}")
        if self.found and (self.pose is None or self.translation is None):
            raise ValueError("a found face needs pose and translation")
        if self.translation is not None and self.translation[2] >= 0:
            raise ValueError("translation puts the face behind the camera")
        return self


class Track(_Record):
    """A whole video's track."""

    version: Literal[1] = VERSION
    tracker: str
    """Name of the tracker that recorded it."""
    scheme: str
    """Landmark scheme: how many points and what each is."""
    size: tuple[Pixels, Pixels]
    """Width and height of the video's picture."""
    fps: Positive
    focal_px: Positive
    """Focal length that the poses were fitted with."""
    frames: Annotated[tuple[TrackFrame, ...], Field(min_length=1)]

    @model_validator(mode="after")
    def _fits_scheme(self) -> Track:
        try:
            count = landmark_scheme(self.scheme).count
        except NotFoundError as error:
            raise ValueError(error.what) from error
        for index, frame in enumerate(self.frames):
            if frame.found and len(frame.landmarks) != count:
                raise ValueError(f"frame {index} has {len(frame.landmarks)} landmarks, and {self.scheme} has {count}")
        return self

    def state(self, index: int) -> FaceState:
        """The face state of frame `index`, which wraps around at the end."""
        frame = self.frames[index % len(self.frames)]
        if not frame.found or frame.pose is None or frame.translation is None:
            return LOST
        rotation = rotation_from_angles(frame.pose.yaw, frame.pose.pitch, frame.pose.roll)
        return FaceState(
            status=frame.status,
            confidence=frame.confidence,
            scheme=self.scheme,
            landmarks=np.array(frame.landmarks, dtype=np.float32),
            pose=HeadPose(rotation, np.array(frame.translation), self.focal_px),
            eyes=frame.eyes,
            mouth=frame.mouth,
            blendshapes=frame.blendshapes,
        )


class TrackRecorder:
    """Collects a tracker's states, frame after frame."""

    def __init__(self, tracker: Tracker, size: tuple[int, int], fps: float) -> None:
        self._tracker, self._size, self._fps = tracker, size, fps
        self._focal_px = guess_focal(size)
        self._frames: list[TrackFrame] = []

    @property
    def found_fraction(self) -> float:
        """Share of the frames so far in which there was a face."""
        return sum(frame.found for frame in self._frames) / max(len(self._frames), 1)

    def add(self, state: FaceState, time_s: float) -> None:
        """Add the next frame's state."""
        if state.pose is not None:
            self._focal_px = state.pose.focal_px
        self._frames.append(_frame_from_state(state, time_s))

    def write(self, path: Path) -> None:
        """Write the track, whole or not at all.

        Raises:
            TrackError: there is no frame in it.
            StorageError: the file cannot be written.
        """
        if not self._frames:
            raise TrackError("a track of no frames", "track a video that has some")
        track = Track(
            tracker=self._tracker.name,
            scheme=self._tracker.scheme,
            size=self._size,
            fps=self._fps,
            focal_px=self._focal_px,
            frames=tuple(self._frames),
        )
        write_atomic(path, track.model_dump_json())


def read_track(path: Path) -> Track:
    """Read a track file.

    Raises:
        TrackError: it is missing, no track, of another version, or damaged; the message says where.
    """
    try:
        if path.stat().st_size > MAX_BYTES:
            raise TrackError(f"track {path} is larger than {MAX_BYTES >> 20} MiB", "track a shorter video")
        text = path.read_bytes()
    except OSError as error:
        raise TrackError(f"cannot read track {path}: {error.strerror or error}", "check the path") from error
    try:
        return Track.model_validate_json(text)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"])
        cure = "make it again with `relit track`"
        if place == "version":
            raise TrackError(
                f"track {path} is of version {first['input']}, this program reads {VERSION}", cure
            ) from error
        reason = first["msg"].removeprefix("Value error, ")
        raise TrackError(f"{path} is no usable track: {f'{place}: ' if place else ''}{reason}", cure) from error


def _frame_from_state(state: FaceState, time_s: float) -> TrackFrame:
    if not state.visible or state.pose is None:
        return TrackFrame(time_s=time_s, found=False, status=FaceStatus.LOST)
    angles = angles_from_rotation(state.pose.rotation)
    x, y, z = state.pose.translation.tolist()
    return TrackFrame(
        time_s=time_s,
        found=True,
        status=state.status,
        confidence=state.confidence,
        pose=TrackPose(yaw=angles.yaw, pitch=angles.pitch, roll=angles.roll),
        translation=(x, y, z),
        # The shortest text that reads back as the same float32.
        landmarks=tuple((float(str(x)), float(str(y))) for x, y in state.landmarks.astype(np.float32)),
        eyes=state.eyes,
        mouth=state.mouth,
        blendshapes=dict(state.blendshapes),
    )


class RecordedTracker:
    """The tracker `recorded`: returns the recorded state of the frame's index, which wraps around at the end."""

    name = "recorded"

    def __init__(self, options: TrackerOptions) -> None:
        """Read the track that the options' argument names.

        Raises:
            TrackError: no path is given, or the file is no usable track.
        """
        if not options.argument:
            raise TrackError("tracker recorded has no track", "name it as recorded:PATH")
        self._path = Path(options.argument)
        self._track = read_track(self._path)
        self.scheme = self._track.scheme

    def track(self, frame: Frame) -> FaceState:
        """Give the state recorded for `frame.index`.

        Raises:
            TrackError: the track was made on pictures of another size.
        """
        if frame.size != self._track.size:
            wanted, got = ("x".join(map(str, size)) for size in (self._track.size, frame.size))
            raise TrackError(f"track {self._path} is of {wanted} pictures, and this one is {got}", "track this video")
        return self._track.state(frame.index)

    def reset(self) -> None:
        """Nothing is kept between frames."""
