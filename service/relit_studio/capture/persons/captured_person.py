"""Interface of captured persons, and their true motion in the picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_types import LinearImage, Mask
from relit_studio.cameras.pinhole import Pinhole
from relit_studio.capture.flash.torch import Torch
from relit_studio.capture.persons.head_motion import Motion

FACE_REACH_CM = 9.0
"""Distance from the head's origin within which visible points count as the face."""


@dataclass(frozen=True, eq=False)
class Layers:
    """Pictures of the person at one time: linear, premultiplied over black, 1 is a white wall at unit irradiance.

    Attributes:
        matte: (height, width) alpha.
        ambient: (height, width, 3) under the room's light.
        flash: (height, width, 3) under the torch alone, as if on all the time; black without a torch.
    """

    matte: Mask
    ambient: LinearImage
    flash: LinearImage


class Person(Protocol):
    """A person in front of the camera who can be lit by a torch at any position nearby.

    Attributes:
        name: of the person or their field.
        camera: before them.
        credits: whom to name where they are shown.
    """

    name: str
    camera: Pinhole
    credits: tuple[str, ...]

    @property
    def origin(self) -> NDArray[np.float64]:
        """Camera axes (3,), centimeters: the head's origin at rest, about 7.5 cm behind the tip of the nose."""
        ...

    def layers(self, motion: Motion, torch: Torch | None) -> Layers:
        """Pictures of the person after a motion, under the room's light and the torch's, if there is one."""
        ...

    def face_points(self) -> NDArray[np.float64]:
        """Visible points (count, 3) of the face's surface at rest, camera axes, one a pixel or sample."""
        ...


@dataclass(frozen=True)
class PictureMotion:
    """The rigid transform in the picture that takes a frame to the head at rest, about the picture's center.

    Attributes:
        rotation_deg: counter-clockwise positive.
        translation_px: (x, y).
        residual_px: RMS of what such a transform cannot undo, over the face's surface.
    """

    rotation_deg: float
    translation_px: tuple[float, float]
    residual_px: float


def to_rest(person: Person, face: NDArray[np.float64], motion: Motion) -> PictureMotion:
    """Least-squares rigid transform (Kabsch 1976) of the face's surface points (count, 3), given at rest."""
    moved = motion.apply(face - person.origin) + person.origin
    # In the complex plane of the picture, y up, a turn counter-clockwise is a product.
    rest, now = (_complex_plane(person.camera, points) for points in (face, moved))
    turn = np.angle(np.vdot(now - now.mean(), rest - rest.mean()))
    shift = rest.mean() - np.exp(1j * turn) * now.mean()
    residual = np.exp(1j * turn) * now + shift - rest
    return PictureMotion(
        rotation_deg=float(np.degrees(turn)),
        translation_px=(float(shift.real), float(-shift.imag)),
        residual_px=float(np.sqrt(np.mean(np.abs(residual) ** 2))),
    )


def _complex_plane(camera: Pinhole, points: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Image positions of points (count, 3) as complex numbers (count,): pixels right of the center, i times upward."""
    x, y, _ = camera.project(points).T
    return np.asarray((x - camera.width / 2) + 1j * (camera.height / 2 - y))
