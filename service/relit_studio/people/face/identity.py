"""Head shape of a person: random identity weights, conditioned on the wanted proportions."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np

from relit_camera.base.array_types import Float64Array
from relit_camera.base.easing import smoothstep
from relit_studio.people.face.face_model import IDENTITIES, FaceModel
from relit_studio.people.traits.person_traits import Proportions, Traits

_DECAY = 35
"""Number of identity shapes over which their strength falls to 1/e; late shapes are noise of the scans."""
_X, _Y, _Z = 0, 1, 2
_DISTANCES: dict[str, tuple[int, tuple[int, ...], tuple[int, ...]]] = {
    "jaw_width": (_X, (11, 12), (4, 5)),
    "chin_height": (_Y, (57,), (8,)),
    "nose_width": (_X, (35,), (31,)),
    "nose_length": (_Y, (27,), (33,)),
    "mouth_width": (_X, (54,), (48,)),
    "lip_height": (_Y, (50, 51, 52), (56, 57, 58)),
    "eye_height": (_Y, (37, 38, 43, 44), (40, 41, 46, 47)),
    "brow_depth": (_Z, (19, 20, 23, 24), (37, 38, 43, 44)),
    "face_width": (_X, (14, 15), (1, 2)),
}
"""Definition of each proportion: an axis, and two sets of iBUG points. It is the first mean minus the second."""

_RESTING = {
    "eyes_wide": ("eyeWide_L", "eyeWide_R"),
    "smile": ("mouthSmile_L", "mouthSmile_R"),
    "brows_up": ("browInnerUp_L", "browInnerUp_R", "browOuterUp_L", "browOuterUp_R"),
    "lips_pressed": ("mouthPress_L", "mouthPress_R"),
}
"""Shapes of the face model that each field of `RestingExpression` controls."""


def identity_weights(model: FaceModel, traits: Traits) -> Float64Array:
    """Identity weights (100,): random, falling off with the order of the shapes, with the person's proportions."""
    fall = np.exp(-np.arange(IDENTITIES) / _DECAY)
    drawn = np.random.default_rng(traits.seed).normal(size=IDENTITIES) * traits.spread * fall
    if traits.proportions is None:
        return np.asarray(drawn)
    measured, scale = proportion_shapes(model), traits.spread * fall
    # Condition the Gaussian of the weights on the wanted proportions, which are linear in them.
    spread = measured * scale**2 @ measured.T
    wanted = np.array(list(asdict(traits.proportions).values())) * np.sqrt(np.diag(spread))
    return np.asarray(drawn + (measured * scale**2).T @ np.linalg.solve(spread, wanted - measured @ drawn))


def neutral_face(model: FaceModel, traits: Traits) -> Float64Array:
    """The model's vertices (count, 3) for this person, expression 0."""
    neutral = model.neutral(identity_weights(model, traits))
    if traits.proportions is not None:
        # Below the neck everybody has the mean shape, which the shirt fits.
        own = smoothstep(model.vertices[:, 1] + 0.25 * model.vertices[:, 2], -11.5, -6.5)[:, None]
        neutral = model.vertices + own * (neutral - model.vertices)
    for name, shapes in _RESTING.items():
        if weight := getattr(traits.resting, name):
            neutral += model.displacement(dict.fromkeys(shapes, weight))
    return neutral


def proportion_shapes(model: FaceModel) -> Float64Array:
    """Change (9, 100) in centimeters of each proportion, in the order of `Proportions`, per unit of identity weight."""
    places = model.identities[:, model.landmarks68].astype(np.float64)
    rows = []
    for name in Proportions.__dataclass_fields__:
        axis, far, near = _DISTANCES[name]
        rows.append(places[:, list(far), axis].mean(axis=1) - places[:, list(near), axis].mean(axis=1))
    return np.array(rows)
