"""How one rendered person answers light, beside what a desk capture measures of them and what their head suggests."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Float32Array
from relit_camera.base.errors import CaptureError
from relit_camera.base.images.color import luminance
from relit_camera.capture.desk.desk_capture import measure_desk_samples, measured_field
from relit_camera.capture.desk.person.learned_field import on_face, two_answers
from relit_camera.face.landmarks.landmark_schemes import landmark_scheme
from relit_camera.lab.evaluate.ladder.desk_rung import SCHEME, filmed_before
from relit_camera.lab.evaluate.ladder.known_person import KnownPerson
from relit_camera.live.modes.ratio_relighting import fit_similarity
from relit_camera.subject.reflectance_field import texel_vectors
from relit_studio.field.learned_response.known_response import (
    LEAST_LIGHT,
    OPAQUE,
    harmonics_of,
    lamp_maps,
    lamp_weights,
)

ASKED = 0.5
"""Of `on_face`, from which a pixel is learned from."""
_BLOCK = 512


@dataclass(frozen=True)
class KnownField:
    """One person's skin and face, under some lights; all but the inputs in units of what the screen showed there.

    Attributes:
        inputs: (pixels, 23) what the network sees, see `mixture_inputs`.
        measured: (pixels, lights) what the measured field sends.
        painted: (pixels, lights) what the painted head sends.
        truth: (pixels, lights) logarithm of the truth, up to a constant of the person: on skin, what both answers send
            is right in the median.
        brightness: (pixels,) in all lights, skin having 1.
        harmonics: (lights, 9) what one of each harmonic adds.
    """

    inputs: Float32Array
    measured: Float32Array
    painted: Float32Array
    truth: Float32Array
    brightness: Float32Array
    harmonics: Float32Array


def known_field(person: KnownPerson, screen: str, lights: NDArray[np.float32], lamp_size_deg: float) -> KnownField:
    """The field of a person before a screen, and the truth, under lights (2048, count), luminance times solid angle.

    Args:
        person: under lamps all round, and under the patches of the screen.
        screen: its name.
        lights: see `training_lights`.
        lamp_size_deg: full angle of those lamps.

    Raises:
        CaptureError: the recording is not good enough, or no face is found.
        ModelError: the networks are not there.
        SubjectError: no face is found in the pictures under lamps.
    """
    found = measure_desk_samples(filmed_before(person, screen))
    if found.landmarks is None:
        raise CaptureError(f"no face is found before the {screen}", "leave them out")
    field, samples, skin = measured_field(found)
    answers = two_answers(field, samples.directions, found.landmarks, samples.matte)
    width = samples.matte.shape[1]
    y, x = np.divmod(answers.pixels, width)
    rigid = list(landmark_scheme(SCHEME).rigid)
    to_truth = fit_similarity(
        found.landmarks[rigid].astype(np.float64), person.subject.landmarks[SCHEME][rigid].astype(np.float64)
    )
    # A pixel stands for a block of two by two.
    place = to_truth @ np.stack([x + 1.0, y + 1.0, np.ones(len(x))])
    place_x, place_y = (np.asarray(each - 0.5, np.float32)[None] for each in place)

    def at_pixels(image: NDArray[np.float32]) -> Float32Array:
        seen = cv2.remap(image, place_x, place_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
        return np.asarray(seen[0], np.float32)

    opaque = np.minimum(samples.matte.ravel()[answers.pixels], at_pixels(person.samples.matte)) > OPAQUE
    kept = opaque & (on_face(skin, answers.shape).ravel()[answers.pixels] > ASKED)
    lamps = lamp_maps(person.samples.directions, lamp_size_deg)
    weights = lamp_weights(person.samples.directions, lights)
    level = luminance(answers.level[answers.pixels])
    seen = np.stack([at_pixels(luminance(each).astype(np.float32)) for each in person.samples.pictures], axis=1)
    measured = np.concatenate([
        luminance(field.at(texel_vectors(), block)).T @ lamps
        for block in np.array_split(answers.pixels, max(1, len(answers.pixels) // _BLOCK))
    ])  # fmt: skip
    sent, painted, truth = (
        np.maximum((each / level[:, None]) @ weights, LEAST_LIGHT)[kept].astype(np.float32)
        for each in (measured, answers.painted.answer(level, lamps), seen)
    )
    bare = answers.shape.skin.ravel()[answers.painted.response.pixels][kept]
    if not bare.any():
        raise CaptureError("no bare skin is seen of the person", "leave them out")
    logarithm = np.log(truth)
    logarithm += np.median((np.log(sent * painted) / 2 - logarithm)[bare].mean(axis=1))
    bright = truth.mean(axis=1) * level[kept]
    return KnownField(
        inputs=answers.inputs[kept],
        measured=sent,
        painted=painted,
        truth=logarithm,
        brightness=np.asarray(bright / np.median(bright[bare]), np.float32),
        harmonics=harmonics_of(weights, lamps),
    )
