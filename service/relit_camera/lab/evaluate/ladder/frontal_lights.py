"""Frontal lights alone: lights beyond them, as at a desk no screen reaches, predicted from those before the face.

What a desk capture or a single picture must guess of real faces is so measured on any set of one-light pictures.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import CaptureError, InputError, LightsError
from relit_camera.base.images.color import luminance, uint8_from_linear
from relit_camera.base.images.image_types import Mask
from relit_camera.capture.alignment.picture_set_alignment import align_if_better
from relit_camera.capture.desk.person.desk_field import (
    DeskField,
    certain_skin,
    fit_desk_field,
    hold_geometry,
    skin_mask,
)
from relit_camera.capture.desk.person.generic_head import GenericHead
from relit_camera.capture.desk.person.learned_field import (
    brightened,
    mix,
    mixture,
    mixture_inputs,
    on_face,
    paint_head,
    skin_brightness,
)
from relit_camera.capture.geometry.shape_estimation import Geometry
from relit_camera.capture.instant.head_shape import HeadShape, fit_head_shape
from relit_camera.capture.instant.response.generic_reflectance import AMOUNTS, shape_response
from relit_camera.capture.instant.response.learned_response import with_learned_response
from relit_camera.capture.instant.response.response_network import DEGREE
from relit_camera.capture.reflectance.appearance_model import TERM_COUNT, distant_terms
from relit_camera.capture.reflectance.methods.appearance_field import AppearanceMethod
from relit_camera.capture.reflectance.methods.blend import Blend
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from relit_camera.face.face_state import Tracker
from relit_camera.face.skin_prior import skin_luminance_by_eyes
from relit_camera.face.tracking.trackers import track_still
from relit_camera.lab.evaluate.field.ground_truth import select_lights
from relit_camera.lab.evaluate.field.relighting_metrics import MAX_DB, Colors
from relit_camera.lab.evaluate.ladder.known_person import reduced
from relit_camera.light.directions import spherical_from_direction
from relit_camera.light.spherical_harmonics import basis
from relit_camera.subject.reflectance_field import texel_vectors

AZIMUTH_DEG, ELEVATION_DEG = 30.0, 21.0
"""Lights within these angles of the camera's axis are frontal: those of a large screen half a meter away."""
BEHIND_Z = -0.35
"""Lights further behind the face than this are not predicted: next to nothing of it is lit."""
SIDE_DEG = (65.0, 80.0)
"""Angles from the camera's axis of what counts as light from the side."""
NEUTRAL_FRONTAL_Z = 0.95
"""The landmarks are found in the mean of the pictures under lights within 18 degrees of the camera's axis."""
LANDMARK_SIDE_PX = 512
"""Side of the picture in which landmarks are found."""
MARGIN = 0.2
"""Width of the margin round it, as a share of the pictures' longer side: detectors want to see more than a face."""


@dataclass(frozen=True)
class FrontalSet:
    """The frontal lights of a set, and what shall be predicted of it.

    Attributes:
        name: of the list.
        captured: the frontal lights.
        asked: (count, 3) directions of the others.
        truth: (count, height, width, 3) their pictures.
        open_tracker: opens what finds the face.
    """

    name: str
    captured: OlatSamples
    asked: NDArray[np.float64]
    truth: Colors
    open_tracker: Callable[[], Tracker]

    @cached_property
    def frontal(self) -> int:
        """Index of the captured light nearest to the camera's axis."""
        return int(self.captured.directions[:, 2].argmax())

    @cached_property
    def head(self) -> HeadShape:
        """A generic head fitted to the face, cut to the pictures.

        Raises:
            CaptureError: no face is found.
            ModelError: the tracker's models are missing.
        """
        near = self.captured.directions[:, 2] > NEUTRAL_FRONTAL_Z
        mean = self.captured.pictures[near if near.any() else [self.frontal]].mean(axis=0)
        height, width = self.captured.matte.shape
        side = round(max(height, width) * (1 + 2 * MARGIN))
        top, left = (side - height) // 2, (side - width) // 2
        canvas, matte = np.zeros((side, side, 3), np.float32), np.zeros((side, side), np.float32)
        canvas[top : top + height, left : left + width] = mean * (0.7 / max(float(np.percentile(mean, 95)), 1e-6))
        matte[top : top + height, left : left + width] = self.captured.matte
        shown = cv2.resize(canvas, (LANDMARK_SIDE_PX, LANDMARK_SIDE_PX), interpolation=cv2.INTER_CUBIC)
        state = track_still(uint8_from_linear(np.asarray(shown, np.float32)), self.open_tracker())
        if not state.visible:
            raise CaptureError(f"no face is found in {self.name}", "give pictures of a face that looks to the camera")
        head = fit_head_shape(state.landmarks * np.float32(side / LANDMARK_SIDE_PX), matte)
        cut = np.s_[top : top + height, left : left + width]
        geometry = head.geometry
        return replace(
            head,
            geometry=Geometry(
                geometry.normals[cut],
                geometry.albedo[cut],
                geometry.confidence[cut],
                geometry.depth[cut],
                replace(geometry.horizon, heights=geometry.horizon.heights[cut]),
            ),
            face=head.face[cut],
            skin=head.skin[cut],
            certainty=head.certainty[cut],
        )


@dataclass(frozen=True)
class FrontalScores:
    """How well one predictor does, with one gain a light; PSNR has its peak at 1.

    Attributes:
        light_db: (count,) of each predicted light; NaN where the predictor cannot be made.
        failure: why it cannot.
    """

    light_db: NDArray[np.float64]
    failure: str = ""


@dataclass(frozen=True)
class FrontalResult:
    """All predictors on one list of lights.

    Attributes:
        name: of the list.
        captured: how many lights are frontal.
        asked: (count, 3) directions of the predicted lights.
        scores: by predictor.
        truth: (count, height, width, 3) the pictures to be predicted.
        predicted: predictor → the same, each with its gain.
    """

    name: str
    captured: int
    asked: NDArray[np.float64]
    scores: Mapping[str, FrontalScores]
    truth: Colors
    predicted: Mapping[str, Colors]

    @property
    def from_side(self) -> NDArray[np.bool_]:
        """Which predicted lights (count,) come from the side."""
        angle = np.degrees(np.arccos(np.clip(self.asked[:, 2], -1, 1)))
        return np.asarray((angle >= SIDE_DEG[0]) & (angle < SIDE_DEG[1]))


def split_frontal(name: str, samples: OlatSamples, open_tracker: Callable[[], Tracker], size: int) -> FrontalSet:
    """The set, reduced to a longer side of `size` pixels, aligned, in frontal lights and others.

    Raises:
        LightsError: there are too few frontal lights, or no others.
    """
    small = reduced(samples, size)
    aligned = align_if_better(small, [str(index) for index in range(len(small.directions))]).samples
    azimuth, elevation = map(np.degrees, spherical_from_direction(aligned.directions))
    ahead = aligned.directions[:, 2] > 0
    frontal = ahead & (np.abs(azimuth) <= AZIMUTH_DEG + 1e-6) & (np.abs(elevation) <= ELEVATION_DEG + 1e-6)
    asked = ~frontal & (aligned.directions[:, 2] > BEHIND_Z)
    if not asked.any():
        raise LightsError(f"{name} has no lights beside frontal ones", "give lights from more directions")
    captured = select_lights(aligned, np.flatnonzero(frontal))
    return FrontalSet(name, captured, aligned.directions[asked], aligned.pictures[asked], open_tracker)


def _frontal_only(known: FrontalSet) -> Colors:
    return np.repeat(known.captured.pictures[[known.frontal]], len(known.asked), axis=0)


def _nearest(known: FrontalSet) -> Colors:
    return np.asarray(known.captured.pictures[(known.asked @ known.captured.directions.T).argmax(axis=1)])


def _generic_head(known: FrontalSet) -> Colors:
    """The frontal picture divided by the generic head's shading in it, times that under each light."""
    amounts, gloss = np.array(_TIED, np.float32), np.array(_GLOSS, np.float32)
    pixels = np.arange(known.captured.matte.size)
    toward = known.captured.directions[[known.frontal]]
    shading = distant_terms(known.head.geometry, toward, pixels)[..., 0] @ amounts
    terms = distant_terms(known.head.geometry, known.asked, pixels)
    shaded, shiny = (np.einsum("ptl,t->lp", terms, each) for each in (amounts, gloss))
    return _shaded_again(known, shading, shaded, shiny)


def _instant(known: FrontalSet) -> Colors:
    """The same with the response that instant gives to the head, in the texels nearest to the lights."""
    head, matte = known.head, known.captured.matte
    response = with_learned_response(shape_response(head.geometry, head.certainty, matte), head, matte)

    def under(rows: NDArray[np.float32], directions: NDArray[np.float64]) -> NDArray[np.float32]:
        nearest = (directions @ texel_vectors().T).argmax(axis=1)
        found = np.zeros((len(directions), matte.size), np.float32)
        found[:, response.pixels] = rows[:, nearest].T
        return found

    shading = under(response.diffuse, known.captured.directions[[known.frontal]])[0]
    return _shaded_again(known, shading, *(under(each, known.asked) for each in (response.diffuse, response.glossy)))


def _shaded_again(
    known: FrontalSet, shading: NDArray[np.float32], shaded: NDArray[np.float32], shiny: NDArray[np.float32]
) -> Colors:
    """The frontal picture by its shading (pixels,), times that (lights, pixels) of other lights, and their gloss."""
    picture = known.captured.pictures[known.frontal].reshape(-1, 3)
    albedo = picture / np.maximum(shading, _LEAST_SHADING)[:, None]
    return _pictures(known, shaded[..., None] * albedo + shiny[..., None])


_TIED = (AMOUNTS.diffuse, AMOUNTS.wrap, 0.0, 0.0, AMOUNTS.surroundings)
"""Amounts of the appearance model's terms that have the pixel's color, for albedo 1."""
_GLOSS = (0.0, 0.0, AMOUNTS.sheen, AMOUNTS.shine, 0.0)
"""Those of skin's gloss."""
_LEAST_SHADING = 0.15
assert len(_TIED) == len(_GLOSS) == TERM_COUNT


def _model(known: FrontalSet) -> Colors:
    field = AppearanceMethod().build(known.captured)
    return _pictures(known, field.at(known.asked, np.arange(known.captured.matte.size)))


def _blend(known: FrontalSet) -> Colors:
    field = Blend().build(known.captured)
    return _pictures(known, field.at(known.asked, np.arange(known.captured.matte.size)))


def _measured_desk(known: FrontalSet) -> Colors:
    """The field of a desk capture, which ties what frontal light leaves open to skin and to a generic head."""
    field, _ = _desk_field(known)
    return _pictures(known, field.at(known.asked, np.arange(known.captured.matte.size)))


def _desk(known: FrontalSet) -> Colors:
    """The same as desk captures have it: with what rendered people taught."""
    (field, skin), head, matte = _desk_field(known), known.head, known.captured.matte
    painted = paint_head(head, matte, known.captured.directions)
    response = painted.response
    level = field.at(known.captured.directions, response.pixels).mean(axis=0)
    found = mixture(mixture_inputs(painted, head, matte, level, field, response.pixels))
    level = brightened(level, skin_brightness(painted, head, level))
    asked = on_face(skin, head).ravel()[response.pixels]
    nearest = (known.asked @ texel_vectors().T).argmax(axis=1)
    diffuse, glossy = (each[:, nearest].T[..., None] for each in (response.diffuse, response.glossy))
    pictures = np.zeros((len(known.asked), matte.size, 3), np.float32)
    pictures[:, response.pixels] = mix(
        field.at(known.asked, response.pixels),
        painted.albedo(level) * diffuse + painted.gloss[:, None] * glossy,
        (1 - asked * (1 - found.share))[:, None],
        (basis(known.asked, DEGREE) @ (asked[:, None] * found.added).T)[..., None] * level,
    )
    return _pictures(known, pictures)


def _desk_field(known: FrontalSet) -> tuple[DeskField, Mask]:
    """The field that a desk capture fits to the frontal lights, a white wall having 1, and what is skin."""
    samples, head = known.captured, known.head
    generic = GenericHead(
        points_cm=np.zeros((*samples.matte.shape, 3), np.float32),
        normals=head.geometry.normals,
        horizon=head.geometry.horizon,
        pixels_per_cm=head.pixels_per_cm,
        face=head.face,
        skin=head.skin,
        matte=samples.matte,
    )
    held = hold_geometry(samples.geometry, generic, np.zeros(samples.matte.shape, bool))
    skin = skin_mask(samples.geometry.albedo, head.skin)
    luminance_of_skin = skin_luminance_by_eyes(None)
    field = fit_desk_field(samples, held, skin, luminance_of_skin)
    chosen = np.flatnonzero(certain_skin(skin, samples.matte).ravel())
    if len(chosen) == 0:
        raise CaptureError(f"no skin is seen in {known.name}", "give pictures of a face that looks to the camera")
    bright = max(float(np.percentile(luminance(field.at(samples.directions, chosen).mean(axis=0)), 75)), 1e-9)
    return field.scaled(np.full((samples.matte.size, 1), luminance_of_skin / bright, np.float32)), skin


def _pictures(known: FrontalSet, colors: Colors) -> Colors:
    return colors.reshape(len(known.asked), *known.captured.matte.shape, 3)


PREDICTORS: Mapping[str, Callable[[FrontalSet], Colors]] = {
    "frontal picture": _frontal_only,
    "nearest light": _nearest,
    "generic head": _generic_head,
    "instant": _instant,
    "model": _model,
    "blend": _blend,
    "desk, untaught": _measured_desk,
    "desk": _desk,
}
"""By name: what predicts the pictures (count, height, width, 3) of all lights that are asked for."""


def evaluate_frontal(
    known: FrontalSet, progress: Callable[[int, int], None] = lambda done, total: None
) -> FrontalResult:
    """Every predictor on one set; one that cannot be made, for want of a face, has no figures.

    Args:
        known: the set.
        progress: called with predictors done and their total.
    """
    inside = known.captured.matte > 0.5
    scores, predicted = {}, {}
    for done, (name, predict) in enumerate(PREDICTORS.items()):
        try:
            pictures = predict(known)
        except InputError as error:
            scores[name] = FrontalScores(np.full(len(known.asked), np.nan), str(error))
        else:
            seen, truth = pictures[:, inside].astype(np.float64), known.truth[:, inside]
            gain = (seen * truth).sum(axis=(1, 2)) / np.maximum((seen * seen).sum(axis=(1, 2)), 1e-9)
            wrong = ((seen * gain[:, None, None] - truth) ** 2).mean(axis=(1, 2))
            scores[name] = FrontalScores(np.minimum(-10 * np.log10(np.maximum(wrong, 1e-30)), MAX_DB))
            predicted[name] = np.asarray(pictures * gain[:, None, None, None], np.float32)
        progress(done + 1, len(PREDICTORS))
    return FrontalResult(known.name, len(known.captured.directions), known.asked, scores, known.truth, predicted)
