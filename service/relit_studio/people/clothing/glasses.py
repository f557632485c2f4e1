"""Glasses: two lenses in a rigid frame that rests on the nose and the ears."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relit_camera.base.array_types import Float64Array, Indices
from relit_camera.base.easing import smoothstep
from relit_studio.people.face.face_model import FaceModel, Part
from relit_studio.people.geometry import unit
from relit_studio.people.traits.person_traits import GlassesTraits, LensShape

_SHAPES: dict[LensShape, tuple[float, float, float]] = {
    "round": (2.35, 2.2, 2.1), "square": (2.6, 2.0, 3.4), "wide": (2.7, 1.65, 2.9),
}  # fmt: skip
"""Half the width and height of a lens (cm), and the exponent of its superellipse: 2 is an ellipse."""
_AROUND, _SECTION, _RINGS = 64, 8, 6
_CLEARANCE_CM = 0.12
_LASH_CM = 1.0
"""Least distance of the lens from the lids."""
_TILT, _WRAP = 0.10, 0.016
"""Shape of the frame: depth gained per centimeter of height, and lost per squared centimeter from the middle."""
_EAR = (-0.6, 1.6)
"""Range of depth (z, centimeters) in which the temple rests on the ear."""


@dataclass(frozen=True, eq=False)
class Glasses:
    """On the upright head: frame (n, 3) with faces (m, 4), and lenses (k, 3) with faces (l, 4), -1 in a triangle's."""

    frame: Float64Array
    frame_faces: Indices
    lenses: Float64Array
    lens_faces: Indices


def fit_glasses(model: FaceModel, head: Float64Array, traits: GlassesTraits) -> Glasses:
    """Glasses for a neutral head (vertices, 3)."""
    skin = head[np.unique(model.triangles(Part.FACE, Part.HEAD))]
    marks = head[model.landmarks68]
    right, left = marks[36:42].mean(axis=0), marks[42:48].mean(axis=0)
    middle = np.array([(right[0] + left[0]) / 2, (right[1] + left[1]) / 2 - 0.1, 0.0])
    half_width, half_height, exponent = _SHAPES[traits.shape]
    # Leave room for the bridge of the nose, which is about equally wide in all people.
    aside = max((left[0] - right[0]) / 2, half_width + 0.8)
    angle = np.linspace(0, 2 * np.pi, _AROUND, endpoint=False)
    cosine, sine = np.cos(angle), np.sin(angle)
    outline = np.stack(
        [
            half_width * np.sign(cosine) * np.abs(cosine) ** (2 / exponent),
            half_height * np.sign(sine) * np.abs(sine) ** (2 / exponent),
        ],
        axis=1,
    )
    depth = _depth(skin, marks, middle, aside, outline, traits.rim_cm)

    def placed(flat: Float64Array) -> Float64Array:
        return np.column_stack([flat + middle[:2], depth + _sag(flat)])

    frame, lenses = _Builder(), _Builder()
    for side in (-1.0, 1.0):
        rim = outline * [side, 1] + [side * aside, 0]
        frame.tube(placed(rim), traits.rim_cm, closed=True)
        rings = [
            placed(outline * [side, 1] * fraction + [side * aside, 0]) for fraction in np.linspace(0.02, 1, _RINGS)
        ]
        lenses.grid(np.stack(rings), closed=True)
        frame.tube(_temple(skin, placed(np.array([[side * (aside + half_width), 0.75 * half_height]]))[0], side),
                   max(0.11, 0.85 * traits.rim_cm))  # fmt: skip
    gap = aside - half_width
    across = np.linspace(-1, 1, 13)
    bridge = placed(np.stack([(gap + 0.1) * across, 0.45 * half_height + 0.35 * (1 - across**2)], axis=1))
    frame.tube(bridge + (1 - across**2)[:, None] * [0, 0, 0.18], 0.9 * traits.rim_cm)
    return Glasses(*frame.mesh(), *lenses.mesh())


def _sag(flat: Float64Array) -> Float64Array:
    """Depth (n,) of the frame's surface behind its middle, over (n, 2) from there."""
    return np.asarray(_TILT * flat[:, 1] - _WRAP * flat[:, 0] ** 2)


def _depth(
    skin: Float64Array, marks: Float64Array, middle: Float64Array, aside: float, outline: Float64Array, rim_cm: float
) -> float:
    """Depth at which the frame clears lids, nose, brows and cheeks."""
    lids = marks[36:48]
    wanted = [(lids[:, 2] - _sag(lids[:, :2] - middle[:2])).max() + _LASH_CM]
    front = skin[skin[:, 2] > 5]
    for side in (-1.0, 1.0):
        rim = outline * [side, 1] + [side * aside, 0] + middle[:2]
        near = np.linalg.norm(front[:, None, :2] - rim[None], axis=2).min(axis=1) < rim_cm + 0.1
        close = front[near]
        wanted.append(float((close[:, 2] - _sag(close[:, :2] - middle[:2])).max()) + rim_cm + _CLEARANCE_CM)
    return float(max(wanted))


def _temple(skin: Float64Array, hinge: Float64Array, side: float) -> Float64Array:
    """Path (40, 3) of a temple from its hinge over the ear and down behind it, outside the head."""
    ear = skin[(side * skin[:, 0] > 7.4) & (skin[:, 2] > -2) & (skin[:, 2] < 2.4) & (skin[:, 1] < 5)]
    top = float(np.percentile(ear[:, 1], 97)) if len(ear) else hinge[1]
    z = np.linspace(hinge[2], -3.0, 40)
    rest = np.interp(z, [_EAR[0], _EAR[1], hinge[2]], [top + 0.1, top + 0.1, hinge[1]])
    y = rest - 1.6 * smoothstep(z, _EAR[0], -3.4) ** 1.2
    x = np.abs(hinge[0]) + 0.12 * (hinge[2] - z).clip(0, 2)
    for index in range(len(z)):
        close = np.hypot(skin[:, 1] - y[index], skin[:, 2] - z[index]) < 0.7
        out = float((side * skin[close, 0]).max(initial=0.0)) + 0.2
        # Behind the ear the temple lies on the head; the protruding points there are the ear itself.
        x[index] = max(x[index], out) if z[index] > _EAR[1] else x[index - 1]
    smooth = np.convolve(np.pad(x, 3, mode="edge"), np.full(7, 1 / 7), mode="valid")
    return np.stack([side * np.maximum(smooth, x), y, z], axis=1)


class _Builder:
    """Vertices and quads of several pieces."""

    def __init__(self) -> None:
        self._vertices: list[Float64Array] = []
        self._faces: list[Indices] = []

    def tube(self, path: Float64Array, radius: float, *, closed: bool = False) -> None:
        """A round bar along a path (n, 3)."""
        ahead = unit(np.roll(path, -1, axis=0) - np.roll(path, 1, axis=0) if closed else np.gradient(path, axis=0))
        reference = np.where(np.abs(ahead[:, 2:]) > 0.9, [[0.0, 1.0, 0.0]], [[0.0, 0.0, 1.0]])
        first = unit(np.cross(ahead, reference))
        second = np.cross(ahead, first)
        turn = np.linspace(0, 2 * np.pi, _SECTION, endpoint=False)
        rings = path + radius * (np.cos(turn)[:, None, None] * first[None] + np.sin(turn)[:, None, None] * second[None])
        self.grid(rings, closed=closed, round_=True)

    def grid(self, rows: Float64Array, *, closed: bool, round_: bool = False) -> None:
        """A sheet of rows (r, c, 3); `closed` joins its last column to the first, `round_` its last row."""
        r, c = rows.shape[:2]
        start = sum(len(each) for each in self._vertices)
        row, column = np.mgrid[0 : r if round_ else r - 1, 0 : c if closed else c - 1]
        below, beside = (row + 1) % r, (column + 1) % c
        corners = [(row, column), (row, beside), (below, beside), (below, column)]
        self._faces.append(np.stack([(i * c + j).ravel() for i, j in corners], axis=1) + start)
        self._vertices.append(rows.reshape(-1, 3))

    def mesh(self) -> tuple[Float64Array, Indices]:
        """Vertices (n, 3) and faces (m, 4) of all pieces."""
        return np.concatenate(self._vertices), np.concatenate(self._faces)
