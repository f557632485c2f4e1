"""Who is captured: the seam between the capture and the ways to get a person's light."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from relit_camera.space.images import LinearImage, Mask
from relit_studio.capture.head_motion import Motion
from relit_studio.capture.pinhole import Pinhole
from relit_studio.capture.torch import Torch

FACE_REACH_CM = 9.0
"""What is seen of the person within this distance of the head's origin counts as the face's surface."""


@dataclass(frozen=True, eq=False)
class Layers:
    """One moment's pictures of the person, linear, premultiplied over black; a white wall at unit irradiance reads 1.

    Attributes:
        matte: (height, width) straight alpha.
        ambient: (height, width, 3) under the room's light.
        flash: (height, width, 3) under the torch alone, switched on; black without one.
    """

    matte: Mask
    ambient: LinearImage
    flash: LinearImage


class Person(Protocol):
    """Somebody before the camera who can be lit from anywhere near."""

    name: str
    camera: Pinhole

    @property
    def origin(self) -> NDArray[np.float64]:
        """Camera axes (3,), centimetres: the head's origin at rest, about 7.5 cm behind the tip of the nose."""
        ...

    def layers(self, motion: Motion, torch: Torch | None) -> Layers:
        """The person moved so, under the room's light and, where there is one, the torch's."""
        ...

    def face_points(self) -> NDArray[np.float64]:
        """Visible points (count, 3) of the face's surface at rest, camera axes, one a pixel or sample."""
        ...


@dataclass(frozen=True)
class PictureMotion:
    """The rigid transform in the picture that takes a frame to the head at rest, about the picture's centre.

    Attributes:
        rotation_deg: counter-clockwise positive.
        translation_px: (x, y).
        residual_px: RMS of what such a transform cannot undo, over the face's surface.
    """

    rotation_deg: float
    translation_px: tuple[float, float]
    residual_px: float


def to_rest(person: Person, face: NDArray[np.float64], motion: Motion) -> PictureMotion:
    """The best rigid transform (least squares; Kabsch 1976) of the face's surface points (count, 3) at rest."""
    moved = motion.apply(face - person.origin) + person.origin
    middle = np.array([person.camera.width / 2, person.camera.height / 2])
    # With y up a turn counter-clockwise in the picture is one in the plane.
    rest, now = ((person.camera.project(points)[:, :2] - middle) * [1, -1] for points in (face, moved))
    flat = [np.pad(points - points.mean(axis=0), ((0, 0), (0, 1))) for points in (rest, now)]
    turn = np.arctan2(*(np.sum(a) for a in (np.cross(flat[1], flat[0])[:, 2], flat[1] * flat[0])))
    matrix = Rotation.from_euler("Z", turn).as_matrix()[:2, :2]
    shift = rest.mean(axis=0) - matrix @ now.mean(axis=0)
    residual = now @ matrix.T + shift - rest
    return PictureMotion(
        rotation_deg=float(np.degrees(turn)),
        translation_px=(float(shift[0]), float(-shift[1])),
        residual_px=float(np.sqrt(np.square(residual).sum(axis=1).mean())),
    )


def face_centroid(person: Person) -> NDArray[np.float64]:
    """Centroid (3,) of the visible face surface at rest, camera axes, centimetres."""
    return np.asarray(person.face_points().mean(axis=0))
