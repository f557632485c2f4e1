"""Two mirror balls see where the light is, not only its direction (the thesis's future work)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relit_camera.capture.ball.view import PinholeView, Vectors


@dataclass(frozen=True, eq=False)
class LightPosition:
    """A light near by.

    Attributes:
        position_cm: (3,) camera axes.
        gap_deg: angle at which the two balls see the gap between the rays where they are closest: how well they agree.
        across_cm: how far apart the rays start, across them: where both are off by an angle e, 1 / distance is off by
            about √2 e / across_cm.
    """

    position_cm: Vectors
    gap_deg: float
    across_cm: float


@dataclass(frozen=True, eq=False)
class BallHighlight:
    """A highlight on a ball whose size is known.

    Attributes:
        view: of the ball.
        radius_cm: of the ball.
        normal: (3,) of its surface at the highlight.
    """

    view: PinholeView
    radius_cm: float
    normal: Vectors

    def ray(self) -> tuple[Vectors, Vectors]:
        """Where the mirrored ray starts, and its direction."""
        return self.radius_cm * (self.view.centre + self.normal), self.view.mirrored(self.normal)


def locate_light(first: BallHighlight, second: BallHighlight) -> LightPosition | None:
    """Where the rays that two balls mirror come closest; None where they part.

    Between them, nearer to the one that is shorter: rays that are equally sure are surer the nearer.
    """
    (start_a, ray_a), (start_b, ray_b) = first.ray(), second.ray()
    between, cosine = start_b - start_a, float(ray_a @ ray_b)
    under = 1 - cosine**2
    if under < 1e-9:
        return None
    along_a = float(between @ (ray_a - cosine * ray_b)) / under
    along_b = float(between @ (cosine * ray_a - ray_b)) / under
    if along_a <= 0 or along_b <= 0:
        return None
    a, b = start_a + along_a * ray_a, start_b + along_b * ray_b
    position = (a * along_b**2 + b * along_a**2) / (along_a**2 + along_b**2)
    gap = float(np.linalg.norm(a - b)) / float(np.hypot(along_a, along_b))
    middle = (ray_a + ray_b) / np.linalg.norm(ray_a + ray_b)
    return LightPosition(position, float(np.degrees(gap)), float(np.linalg.norm(np.cross(between, middle))))
