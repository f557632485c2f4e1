"""A subject from a few ordinary frames in the light of the room: the first rung of capture (docs/instant.md)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera import __version__
from relit_camera.base.array_types import Float32Array
from relit_camera.base.errors import CaptureError
from relit_camera.base.images.color import LUMINANCE, linear_from_uint8, luminance
from relit_camera.base.images.image_quality import psnr
from relit_camera.base.images.image_types import DisplayImage, LinearImage, Mask
from relit_camera.capture.geometry.horizon_map import HorizonMap
from relit_camera.capture.geometry.normal_completion import pull_push_fill
from relit_camera.capture.geometry.shape_estimation import Geometry
from relit_camera.capture.instant.back_light import soften_back_light
from relit_camera.capture.instant.face_selection import SCHEME, follow_face, select_faces
from relit_camera.capture.instant.head_shape import HeadShape, fit_head_shape
from relit_camera.capture.instant.median_picture import MedianPicture, face_hull, median_picture, with_head
from relit_camera.capture.instant.response.generic_compression import compress_generic_field
from relit_camera.capture.instant.response.generic_reflectance import (
    GenericField,
    ShapeResponse,
    gloss_amounts,
    shape_response,
)
from relit_camera.capture.instant.response.learned_response import with_learned_response
from relit_camera.capture.instant.room_light import fit_room_light
from relit_camera.capture.instant.room_shadows import with_room_shadows
from relit_camera.capture.instant.skin.bare_skin import below_nose, find_bare_skin
from relit_camera.capture.instant.skin.even_sides import even_sides
from relit_camera.capture.instant.skin.eye_whites import eye_white_ratio
from relit_camera.capture.instant.skin.skin_albedo import TUNABLES as ALBEDO
from relit_camera.capture.instant.skin.skin_albedo import estimate_albedo
from relit_camera.capture.subject_builder import quantize_geometry
from relit_camera.face.face_state import FaceState
from relit_camera.face.landmarks.landmark_schemes import landmark_scheme
from relit_camera.face.skin_prior import estimate_skin
from relit_camera.light.directions import texel_directions
from relit_camera.subject.compression.accuracy_target import CompressionTarget
from relit_camera.subject.rungs import EXPECTED_DB
from relit_camera.subject.subject import Subject, SubjectMetadata

METHOD = "instant"
ACCURACY = CompressionTarget(texel_db=38.0)
"""Of the compression, against the generic field, which is further from the truth than that."""
STAGE = "Estimating light and skin"
Progress = Callable[[str, int, int | None], None]


@dataclass(frozen=True)
class InstantTunables:
    """What a picture must be like.

    Attributes:
        black_face, dark_face: linear mean of the face below which nothing is seen of it, and noise is most of it.
        clipped_code: from which a value counts as clipped.
        max_clipped, some_clipped: largest share of the skin in which two channels are, and of what needs no warning:
            red alone often is.
        least_unclipped: pixels of skin, as a share, that the fit needs; else clipped ones count too.
        harsh_dark_fraction: share of the skin that hardly any light reaches from which a room is harsh.
        sure_matte: from which a pixel's color is the person's alone; others take the colors next to them.
    """

    black_face: float = 0.004
    dark_face: float = 0.008
    clipped_code: int = 250
    max_clipped: float = 0.6
    some_clipped: float = 0.25
    least_unclipped: float = 0.3
    harsh_dark_fraction: float = 0.15
    sure_matte: float = 0.9


TUNABLES = InstantTunables()


@dataclass(frozen=True)
class InstantCapture:
    """A subject, and what could be better in its room.

    Attributes:
        subject: the person.
        warnings: lines for people.
        frames: how many frames were used.
        states: the face in each frame that was given, see `follow_face`; none where a picture was.
    """

    subject: Subject
    warnings: tuple[str, ...]
    frames: int
    states: tuple[FaceState, ...] = ()


def build_instant_subject(
    frames: Sequence[DisplayImage], source: str, progress: Progress = lambda stage, done, total: None
) -> Subject:
    """The subject of `capture_instant`, whose arguments and errors it shares."""
    return capture_instant(frames, source, progress).subject


def capture_instant(
    frames: Sequence[DisplayImage], source: str, progress: Progress = lambda stage, done, total: None
) -> InstantCapture:
    """Make a subject from some frames (height, width, 3) uint8 of one person in one light; one frame is enough.

    Args:
        frames: of one size, in order of time.
        source: what they come from, for the header and for messages: a file's name, never a path.
        progress: called with a stage's name, what is done, and the total.

    Raises:
        CaptureError: no face, or one that is too small, turned away, black or white in all frames.
        ModelError: the networks are not there.
    """
    progress("Finding the face", 0, None)
    states = follow_face(frames)
    selection = select_faces(frames, states, source)
    captured = capture_from_picture(median_picture(selection.faces), source, progress)
    return replace(captured, warnings=selection.warnings + captured.warnings, states=tuple(states))


def capture_from_picture(
    picture: MedianPicture, source: str, progress: Progress = lambda stage, done, total: None
) -> InstantCapture:
    """Make a subject from one clean picture, its matte and landmarks; see `capture_instant`.

    Raises:
        CaptureError: the face in it is nearly black, or mostly white.
    """
    progress(STAGE, 0, 3)
    warnings = _light_warnings(picture, source)
    picture, missed = with_head(picture)
    if missed:
        warnings += ("the head cannot be told from what is behind it: choose another background, or more light",)
    side = len(picture.matte) // 2
    half = np.asarray(cv2.resize(picture.matte, (side, side), interpolation=cv2.INTER_AREA), np.float32)
    shape = fit_head_shape((picture.landmarks / 2).astype(np.float32), half)
    warnings += _exposure_warnings(picture, shape, source)
    progress(STAGE, 1, 3)
    response = with_learned_response(shape_response(shape.geometry, shape.certainty, half), shape, half)
    field, room, harsh = _reflectance(picture, shape, response)
    progress(STAGE, 2, 3)
    subject = _subject(picture, shape, field, room, source)
    progress(STAGE, 3, 3)
    return InstantCapture(subject, warnings + harsh, picture.frames)


def _light_warnings(picture: MedianPicture, source: str) -> tuple[str, ...]:
    """What to say of a dark face; raises CaptureError where it is nearly black."""
    seen = linear_from_uint8(picture.image[face_hull(picture.landmarks, picture.matte.shape) > 0])
    light = float(luminance(seen[None]).mean())
    if light < TUNABLES.black_face:
        raise CaptureError(f"it is too dark in {source}: the face is nearly black", "switch a light on")
    return ("the face is dark: switch a light on for a better subject",) if light < TUNABLES.dark_face else ()


def _exposure_warnings(picture: MedianPicture, shape: HeadShape, source: str) -> tuple[str, ...]:
    """What to say of skin that is white; raises CaptureError where most is, or none is seen."""
    codes = picture.image[_doubled(shape.skin)]
    if len(codes) == 0:
        raise CaptureError(f"no skin can be seen in {source}", "take from your face what covers it")
    clipped = float((np.median(codes, axis=1) >= TUNABLES.clipped_code).mean())
    what, cure = f"{100 * clipped:.0f} % of the skin is white", "turn the light or the camera's exposure down"
    if clipped > TUNABLES.max_clipped:
        raise CaptureError(f"the face in {source} is over-exposed: {what}", cure)
    return (f"{what}: {cure}",) if clipped > TUNABLES.some_clipped else ()


def _reflectance(
    picture: MedianPicture, shape: HeadShape, response: ShapeResponse
) -> tuple[GenericField, Float32Array, tuple[str, ...]]:
    """The field, the room's light (2048, 3) as radiance times solid angle, and warnings."""
    linear = _own_colors(linear_from_uint8(picture.image), picture.matte)
    height, width = shape.skin.shape
    coarse = np.asarray(cv2.resize(linear, (width, height), interpolation=cv2.INTER_AREA), np.float32)
    eyes = eye_white_ratio(linear, picture.landmarks, landmark_scheme(SCHEME))
    skin_albedo = estimate_skin(coarse[shape.skin], picture.frame_luminance, eyes)
    below = below_nose(np.asarray(picture.landmarks / 2, np.float32), shape.skin.shape)
    skin = find_bare_skin(response, coarse, shape.skin, below, skin_albedo)
    clipped = cv2.resize(picture.image.max(axis=2), (width, height), interpolation=cv2.INTER_AREA)
    unclipped = skin & (clipped < TUNABLES.clipped_code)
    enough = unclipped.sum() > TUNABLES.least_unclipped * skin.sum()
    room = fit_room_light(response, coarse, unclipped if enough else skin, skin_albedo)
    response = with_room_shadows(response, coarse, skin, shape.certainty, room, skin_albedo)
    lit = response.spread(np.concatenate([response.diffuse @ room, response.glossy @ room], axis=1))
    lit = lit.reshape(*picture.matte.shape, 6)
    gloss = gloss_amounts(_doubled(shape.face), 0.01 * width)
    whole_skin = _doubled(shape.skin)
    found = estimate_albedo(linear, lit[..., :3], gloss[..., None] * lit[..., 3:], whole_skin)
    evened = found.albedo * even_sides(found.albedo, whole_skin, picture.landmarks, landmark_scheme(SCHEME))
    albedo = np.where(picture.matte[..., None] > 0, np.clip(evened, *ALBEDO.limits), 0).astype(np.float32)
    warnings: tuple[str, ...] = ()
    if found.dark_fraction > TUNABLES.harsh_dark_fraction:
        warnings = (
            f"hardly any light reaches {100 * found.dark_fraction:.0f} % of the face: turn toward the window, or put a "
            "light before you, and capture again",
        )
    return GenericField(response, albedo, gloss), room, warnings


def _own_colors(linear: LinearImage, matte: Mask) -> LinearImage:
    """The picture, colors at the person's edge replaced by those next to them: the room shines through there."""
    trust = np.clip((matte - 0.5) / (TUNABLES.sure_matte - 0.5), 0, 1) ** 2
    return pull_push_fill(linear, trust.astype(np.float32))


def _doubled(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    return mask.repeat(2, axis=0).repeat(2, axis=1)


def _subject(picture: MedianPicture, shape: HeadShape, field: GenericField, room: Float32Array, source: str) -> Subject:
    compressed = compress_generic_field(field, picture.matte, ACCURACY)
    coefficients = soften_back_light(compressed.coefficients)
    side = len(picture.matte)
    gray = room @ np.asarray(LUMINANCE, np.float32)
    toward = gray @ texel_directions().reshape(-1, 3)
    explained = psnr(field.pictures(room[None])[0], linear_from_uint8(picture.image), picture.matte)
    return Subject(
        metadata=SubjectMetadata(
            width=side,
            height=side,
            method=METHOD,
            lights=1,
            components=compressed.basis.components,
            source=source,
            psnr_db=explained,
            texel_psnr_db=compressed.quality.texel_db,
            bytes_share=compressed.quality.bytes_share,
            rung="instant",
            expected_db=EXPECTED_DB["instant"],
            measured_fraction=0.0,
            created_by=f"relit-camera {__version__}",
            created_at=datetime.now(UTC).isoformat(timespec="seconds"),
        ),
        basis=compressed.basis,
        coefficients=coefficients,
        light_directions=(toward / max(float(np.linalg.norm(toward)), 1e-9))[None].astype(np.float32),
        light_coefficients=np.ascontiguousarray(coefficients @ gray[:, None]),
        matte=picture.matte,
        neutral=picture.image,
        landmarks={SCHEME: picture.landmarks},
        stills=(),
        **quantize_geometry(_whole_geometry(shape.geometry, field.albedo)),
    )


def _whole_geometry(geometry: Geometry, albedo: LinearImage) -> Geometry:
    """A geometry of half the resolution at the whole."""
    height, width = albedo.shape[:2]

    def larger(values: Float32Array) -> Float32Array:
        planes = [
            cv2.resize(plane, (width, height), interpolation=cv2.INTER_LINEAR)
            for plane in np.moveaxis(np.atleast_3d(values).astype(np.float32), 2, 0)
        ]
        return np.dstack(planes)

    normals = larger(geometry.normals)
    depth = np.nan_to_num(geometry.depth, nan=0.0)
    known = larger(np.isfinite(geometry.depth).astype(np.float32))
    return Geometry(
        np.asarray(normals / np.maximum(np.linalg.norm(normals, axis=2, keepdims=True), 1e-6), np.float32),
        albedo,
        larger(geometry.confidence)[..., 0],
        np.where(known > 0, 2 * larger(depth) / np.maximum(known, 1e-6), np.nan)[..., 0].astype(np.float32),
        HorizonMap(larger(geometry.horizon.heights.astype(np.float32)).astype(np.float16)),
    )
