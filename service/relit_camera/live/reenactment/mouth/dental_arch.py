"""A row of teeth as a curved wall before the mouth's cavity: where a ray meets it, and how much of a pixel teeth fill.

Axes are the head's, see `HeadPose`. Widths are means of adults (Nelson, Wheeler's Dental Anatomy, 11th edition),
rounded; crowns are as much of theirs as the gum usually leaves, the rest was chosen by eye.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from relit_camera.live.reenactment.mouth.ray_crossing import first_crossing, share_at_outline

ROUNDING_CM = 0.09
"""How much shorter a crown is at its corners than in its middle."""
PAPILLA_CM = 0.22
"""How much further the gum reaches between two teeth than at the middle of one."""
LINE_CM, LINE_SHADE = 0.055, 0.4
"""Half width of the shade between two teeth, and how dark it is."""
PLACES = 1024
"""Places along one side of a row for which its shape is tabulated."""


@dataclass(frozen=True)
class TeethInView:
    """What some rays meet of a row of teeth; float32 arrays with a value for each ray.

    Attributes:
        points: (3, count) where the ray meets the row's wall, cm.
        toward_front: how far the wall faces forward there: 1 at the front teeth, 0 where it is seen from its side.
        teeth: share of the ray's pixel that teeth fill.
        gum: share that the gum fills.
        shade: factor of the teeth's brightness: darker between two of them.
    """

    points: NDArray[np.float32]
    toward_front: NDArray[np.float32]
    teeth: NDArray[np.float32]
    gum: NDArray[np.float32]
    shade: NDArray[np.float32]


@dataclass(frozen=True)
class DentalArch:
    """One row of teeth: half an ellipse from above, the teeth upright on it, the same at both sides of the middle.

    Attributes:
        half_width: cm, from the middle to the outer side of the last molar.
        depth: cm, from the front teeth to where it is widest.
        up: 1 where the teeth grow upward from their biting edge, as those of the upper jaw, −1 else.
        widths: cm along the row, from the middle outward.
        crowns: cm from the biting edge to the gum, at each tooth's middle.
        shorter: cm by which each tooth's biting edge lies nearer to the gum than that of the front teeth.
    """

    half_width: float
    depth: float
    up: int
    widths: tuple[float, ...]
    crowns: tuple[float, ...]
    shorter: tuple[float, ...]

    @cached_property
    def _shape(self) -> NDArray[np.float32]:
        """(4, `PLACES`) along one side of the row: biting edge and gum, cm from the front teeth's edge; facing; shade.

        The places are even in the tangent of half the ellipse's angle, which needs no trigonometry to find.
        """
        angle = 2 * np.arctan(np.linspace(0, 1, PLACES))
        x, z = self.half_width * np.sin(angle), self.depth * np.cos(angle)
        length = np.concatenate([[0], np.cumsum(np.hypot(np.diff(x), np.diff(z)))])
        ends = np.cumsum(self.widths)
        tooth = np.minimum(np.searchsorted(ends, length), len(ends) - 1)
        width = np.array(self.widths)[tooth]
        across = np.abs(length - (ends[tooth] - width / 2)) / (width / 2)
        edge = np.array(self.shorter)[tooth] + ROUNDING_CM * across**6
        gum = np.array(self.shorter)[tooth] + np.array(self.crowns)[tooth] - PAPILLA_CM * across**2
        normal = x / self.half_width**2, z / self.depth**2
        shade = 1 - LINE_SHADE * np.exp(-(((1 - across) * width / 2 / LINE_CM) ** 2))
        return np.stack([edge, gum, normal[1] / np.hypot(*normal), shade]).astype(np.float32)

    def seen(
        self,
        origins: NDArray[np.float32],
        direction: NDArray[np.float32],
        front: tuple[float, float],
        pixel_cm: float,
    ) -> TeethInView:
        """What parallel rays meet.

        Args:
            origins: (3, count) cm, a point of each ray.
            direction: (3,) unit vector, away from the camera.
            front: y and z of the biting edge of the front teeth.
            pixel_cm: distance of two rays: edges are as soft.
        """
        radii = np.array([[self.half_width], [self.depth]], np.float32)
        center = np.array([[0], [front[1] - self.depth]], np.float32)
        # In units of the radii the row is a circle.
        start, along = (origins[::2] - center) / radii, direction[::2] / radii[:, 0]
        steps, met = first_crossing(start, along)
        points = origins + steps * direction[:, None]
        x, z = on_circle = start + steps * along[:, None]
        # The tangent of half the angle from the front.
        place = np.abs(x) / np.maximum(1 + z, np.float32(1e-3))
        shown = share_at_outline(on_circle / radii, direction[::2]) * (met & (place <= 1))
        column = (np.minimum(place, 1) * np.float32(PLACES - 1)).astype(np.intp)
        edge, gum, toward_front, shade = (row.take(column) for row in self._shape)
        height = np.float32(self.up) * (points[1] - np.float32(front[0]))
        per_pixel = np.float32(1 / max(pixel_cm, 1e-3))
        above_edge = np.clip((height - edge) * per_pixel + np.float32(0.5), 0, 1) * shown
        below_gum = np.clip((gum - height) * per_pixel + np.float32(0.5), 0, 1)
        return TeethInView(
            points=points,
            toward_front=toward_front,
            teeth=above_edge * below_gum,
            gum=above_edge * (1 - below_gum),
            shade=shade,
        )


UPPER_TEETH = DentalArch(
    half_width=2.9,
    depth=4.0,
    up=1,
    widths=(0.85, 0.65, 0.75, 0.7, 0.7, 1.0, 0.9),
    crowns=(1.0, 0.9, 1.0, 0.85, 0.8, 0.75, 0.7),
    shorter=(0.0, 0.06, 0.0, 0.08, 0.12, 0.16, 0.18),
)
LOWER_TEETH = DentalArch(
    half_width=2.65,
    depth=3.75,
    up=-1,
    widths=(0.5, 0.55, 0.7, 0.7, 0.7, 1.1, 1.05),
    crowns=(0.85, 0.9, 1.0, 0.85, 0.8, 0.75, 0.7),
    shorter=(0.0, 0.0, -0.03, 0.02, 0.05, 0.08, 0.1),
)
