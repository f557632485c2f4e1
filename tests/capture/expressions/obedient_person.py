"""A generated person before a webcam who does what they are asked, and the tracker that sees them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from relit_camera.base.images.image_types import DisplayImage, Frame
from relit_camera.base.rotations import rotation_from_angles
from relit_camera.face.face_state import LOST, FaceState, FaceStatus
from relit_camera.face.head_pose import HeadPose, project
from tests.capture.expressions.talking_film import SCHEME, SIZE, moved_points

CORNERS = [SCHEME.upper_lip_outer[0], SCHEME.upper_lip_outer[-1]]


def picture(brightness: int = 150) -> DisplayImage:
    """A picture with detail everywhere, so that a face in it counts as sharp."""
    noise = np.random.default_rng(0).integers(-40, 40, (SIZE[1], SIZE[0], 1))
    return np.clip(brightness * (1 + noise / 100), 0, 255).astype(np.uint8).repeat(3, axis=2)


def doing(name: str, strength: float = 1.0) -> FaceState:
    """What the tracker sees of a face that does what a prompt of this name asks for."""
    points = moved_points(
        open_cm=strength * {"lips apart": 0.6, "jaw dropped": 1.8}.get(name, 0.0),
        shut=strength * (name == "eyes shut"),
    )
    points[CORNERS, 0] += np.sign(points[CORNERS, 0]) * strength * {"wide mouth": 0.4, "round mouth": -0.4}.get(name, 0)
    yaw = strength * {"turned right": -19, "turned far right": -31, "turned left": 19, "turned far left": 31}.get(
        name, 0
    )
    pose = HeadPose(rotation_from_angles(yaw, 0.0), np.array([0.0, 0.0, -50.0]), 640.0)
    mouth = 0.1 * strength * (name in ("lips apart", "jaw dropped"))
    eyes = (0.3 - 0.25 * strength * (name == "eyes shut"),) * 2
    return FaceState(FaceStatus.FOUND, 1.0, "mesh478", project(points, pose, SIZE), pose, (eyes[0], eyes[1]), mouth)


class PersonTracker:
    """Implements `face.face_state.Tracker`: sees a person who does what `asked` says, or nobody."""

    name, scheme = "person", "mesh478"

    def __init__(self, asked: Callable[[], str | None]) -> None:
        """`asked` gives the name of what the person does; None where they are away."""
        self._asked = asked

    def track(self, frame: Frame) -> FaceState:
        name = self._asked()
        return LOST if name is None else doing(name)

    def reset(self) -> None:
        """Nothing is kept between frames."""
