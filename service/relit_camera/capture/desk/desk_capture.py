"""A subject from a desk recording: the second rung of capture (docs/desk.md)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Float32Array, Float64Array
from relit_camera.base.errors import CaptureError
from relit_camera.base.images.color import luminance, uint8_from_linear
from relit_camera.base.images.image_types import DisplayImage, LinearImage, Mask, Points
from relit_camera.capture.alignment.rigid_transform import RigidTransform
from relit_camera.capture.desk.desk_recording import DeskRecording, require_frame
from relit_camera.capture.desk.patterns.pattern_matching import FaceCells, match_patterns
from relit_camera.capture.desk.patterns.pattern_pictures import find_motion, mean_frame, pattern_frames
from relit_camera.capture.desk.patterns.pattern_sequence import demultiplex, pattern_lights
from relit_camera.capture.desk.patterns.plateaus import Plateau, decode_table, find_plateaus, frame_cells
from relit_camera.capture.desk.person.desk_face import DeskFace, find_face, find_mesh_landmarks, segment_person
from relit_camera.capture.desk.person.desk_field import (
    DeskField,
    certain_skin,
    fit_desk_field,
    hold_geometry,
    skin_mask,
)
from relit_camera.capture.desk.person.generic_head import GenericHead, ellipsoid_head, head_from_landmarks
from relit_camera.capture.desk.person.learned_field import with_learned_field
from relit_camera.capture.desk.person.mirror_mask import suppress_mirrored_patches
from relit_camera.capture.desk.person.near_field_rounds import undo_near_field
from relit_camera.capture.desk.person.patch_light import Patches, place_patches
from relit_camera.capture.desk.person.room_gain import TUNABLES as ROOM_TUNABLES
from relit_camera.capture.desk.person.room_gain import room_gain
from relit_camera.capture.desk.recording_checks import (
    linearity_warnings,
    motion_warnings,
    require_exposure,
    require_patterns,
    require_person,
    scale_warnings,
    white_drift_warnings,
)
from relit_camera.capture.film.olat.flash_matte import estimate_flash_matte
from relit_camera.capture.film.olat.head_crop import HeadCrop, place_head_crop
from relit_camera.capture.instant.skin.eye_whites import eye_white_ratio
from relit_camera.capture.reflectance.methods.appearance_field import AppearanceField
from relit_camera.capture.reflectance.methods.gaussian_process import Kernel
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from relit_camera.capture.subject_builder import subject_from_field
from relit_camera.face.landmarks.landmark_schemes import landmark_scheme
from relit_camera.face.skin_prior import skin_luminance_by_eyes
from relit_camera.light.directions import texel_solid_angles
from relit_camera.subject.compression.accuracy_target import CompressionTarget
from relit_camera.subject.reflectance_field import ReflectanceField, texel_vectors
from relit_camera.subject.subject import Subject

METHOD = "model"
SIZE_PX = 256
RESIDUAL_KERNEL = Kernel(float(np.radians(30)), 0.1)
"""Of what the appearance model does not explain; so few lights cannot choose one by cross-validation."""
ACCURACY = CompressionTarget(texel_db=38.0, light_db=41.0)
"""Of the compression, against the fitted field, which is further from the truth than that."""
MIN_FACE_IN_MATTE = 0.5
"""Least share of the face that must belong to the matte."""
Progress = Callable[[str, int, int | None], None]


@dataclass(frozen=True, eq=False)
class DeskSamples:
    """What a recording gives before a field is fitted.

    Attributes:
        samples: pictures under distant lights of unit irradiance, in the patches' directions.
        room: (height, width, 3) the person in the room's own light, of any exposure; black where it has next to none.
        head: generic head in the same picture.
        landmarks: (478, 2) of the scheme `mesh478` in it, or None where no network finds them.
        mirrored: (height, width) mask of eyes and glasses that mirrored the screen.
        skin_luminance: of the person's skin, a white wall having 1.
        warnings: what was noticed, for the person.
    """

    samples: OlatSamples
    room: LinearImage
    head: GenericHead
    landmarks: Points | None
    mirrored: NDArray[np.bool_]
    skin_luminance: float
    warnings: list[str]


def build_desk_subject(
    recording: DeskRecording, source: str, progress: Progress = lambda stage, done, total: None
) -> tuple[Subject, list[str]]:
    """The subject of a desk recording, and warnings for the person.

    Args:
        recording: frames and setup.
        source: name of the recording, for the header.
        progress: told the stage, what of it is done, and its total.

    Raises:
        CaptureError: the recording shows no face, or not the patterns, or the face moved, or was lit badly.
        ImageError: a frame cannot be read.
    """
    found = measure_desk_samples(recording, progress)
    progress("Fitting the field", 0, None)
    field, samples = fit_field(found)
    subject = subject_from_field(
        field,
        samples,
        METHOD,
        source,
        str(recording.setup.camera_gamma),
        rung="desk",
        accuracy=ACCURACY,
        progress=lambda done, total: progress("Building the field", done, total),
    )
    return subject, found.warnings


def measure_desk_samples(recording: DeskRecording, progress: Progress = lambda stage, done, total: None) -> DeskSamples:
    """The pictures of single patches, free of the room's light and of the near field. Errors as `build_desk_subject`.

    Args:
        recording: frames and setup.
        progress: told the stage, what of it is done, and its total.
    """
    setup = recording.setup
    lights = pattern_lights(setup.patterns, setup.patches.count, setup.screen.gamma, setup.screen.black)
    shown = identify_patterns(recording, lights, lambda done, total: progress("Reading the frames", done, total))
    face, patches, light = shown.face, shown.patches, lights[shown.patterns]
    crop = place_head_crop(face.circle, recording.size, SIZE_PX)
    scale, on_face = face.pixels_per_cm * crop.scale, crop.disc(*face.circle)
    white = crop.crop(shown.white, RigidTransform())
    landmarks, segmented = find_mesh_landmarks(_exposed(white)), segment_person(_exposed(white))
    filmed = pattern_frames(
        recording, shown.plateaus, crop, lambda done, total: progress("Averaging the frames", done, total)
    )
    progress("Aligning the pictures", 0, None)
    body = on_face.astype(np.float32) if segmented is None else segmented
    transforms = find_motion(filmed.cropped(), light.mean(axis=1), np.maximum(on_face, np.float32(0.3) * body))
    pictures = filmed.cropped(transforms)
    whites = [pictures[index][on_face].mean(axis=0) for index in np.flatnonzero(light.min(axis=1) > 0.99)]
    mixed = light.min(axis=1) < 0.99
    # White is left out: screens dim themselves when all of them is bright.
    alone, room = demultiplex(pictures[mixed], light[mixed])
    white_light = alone.sum(axis=0)[on_face].mean()
    room = np.maximum(room, 0) * np.float32(room[on_face].mean() > ROOM_TUNABLES.min_light * white_light)
    brightest = pictures[int(light.mean(axis=1).argmax())]
    in_room_light = _picture_in_room_light(recording, crop, brightest, np.maximum(on_face, np.float32(0.3) * body))
    warnings = [
        *scale_warnings(face, setup, recording.size[0]),
        *motion_warnings(transforms, scale),
        *white_drift_warnings(whites),
        *linearity_warnings(alone[:, on_face].mean(axis=1), whites, room[on_face].mean(axis=0)),
    ]
    matte = estimate_flash_matte(alone, room) if segmented is None else segmented
    if float(matte[on_face].mean()) < MIN_FACE_IN_MATTE:
        raise CaptureError("the person cannot be told from the room", "sit farther from the wall, or darken the room")
    eyes = None if landmarks is None else eye_white_ratio(white, landmarks, landmark_scheme("mesh478"))
    if eyes is None:
        warnings.append("the whites of your eyes are not seen: your skin is taken to be neither light nor dark")
    center = crop.to_crop(face.circle.x, face.circle.y)
    head = (
        ellipsoid_head(center, scale, matte)
        if landmarks is None
        else head_from_landmarks(landmarks, center, scale, matte)
    )
    progress("Undoing the near field", 0, None)
    distant = undo_near_field(alone, patches, head, matte)
    calm, mirrored = suppress_mirrored_patches(distant, patches.directions, matte)
    samples = OlatSamples(calm, patches.directions, matte)
    seen = room if in_room_light is None else in_room_light
    return DeskSamples(samples, seen, head, landmarks, mirrored, skin_luminance_by_eyes(eyes), warnings)


def _picture_in_room_light(
    recording: DeskRecording, crop: HeadCrop, reference: LinearImage, weights: Mask
) -> LinearImage | None:
    """The recording's picture in the room's own light (size, size, 3), cropped and aligned to the cropped reference."""
    if recording.room is None:
        return None
    room = np.asarray(cv2.LUT(recording.room, decode_table(recording.setup.camera_gamma)), np.float32)
    both = np.stack([reference, crop.crop(room, RigidTransform())])
    to_mean = find_motion(both, np.ones(2), weights)
    aligned = to_mean[1].then(to_mean[0].inverse())
    return np.maximum(crop.crop(room, aligned.scaled(1 / crop.scale)), 0)


@dataclass(frozen=True, eq=False)
class ShownPatterns:
    """What the frames show.

    Attributes:
        plateaus: those that show a pattern.
        patterns: (plateaus,) which of the sequence.
        white: (height, width, 3) mean frame under white, linear.
        face: where the face is.
        patches: before the face.
    """

    plateaus: list[Plateau]
    patterns: NDArray[np.intp]
    white: LinearImage
    face: DeskFace
    patches: Patches


def identify_patterns(
    recording: DeskRecording, lights: Float64Array, progress: Callable[[int, int], None] = lambda done, total: None
) -> ShownPatterns:
    """Which frames show which pattern.

    Args:
        recording: frames and setup.
        lights: (patterns, patches) of the sequence.
        progress: called with the frames read and their total.

    Raises:
        CaptureError: no face, no patterns, or not enough of them.
    """
    cells = frame_cells(recording, progress)
    setup = recording.setup
    stated = setup.shown != "unknown"
    plateaus = _stated_plateaus(recording, cells) if stated else find_plateaus(cells, setup.camera_gamma)
    white = mean_frame(recording, max(plateaus, key=lambda each: float(each.cells.mean())))
    face = find_face(_exposed(white), setup)
    on_face = _disc(recording.size, face)
    # Most plateaus light half of the screen, so the median is one of these.
    typical = sorted(plateaus, key=lambda each: float(each.cells.mean()))[len(plateaus) // 2]
    require_exposure(require_frame(recording, (typical.start + typical.stop) // 2), on_face)
    middles = [require_frame(recording, (each.start + each.stop) // 2) for each in plateaus]
    require_person(middles, np.array([each.cells.mean() for each in plateaus]), _exposed(white), face)
    patches = place_patches(setup, face.from_axis_cm(recording.size))
    patterns = match_patterns(plateaus, lights, face_cells(cells.shape[1:], recording.size, face), patches).patterns
    known = [index for index, pattern in enumerate(patterns) if pattern >= 0]
    patterns = patterns[known]
    require_patterns(patterns, lights, len(recording.frames))
    return ShownPatterns([plateaus[index] for index in known], patterns, white, face, patches)


def face_cells(cells: tuple[int, ...], size: tuple[int, int], face: DeskFace) -> FaceCells:
    """The cells (rows, columns) of a frame of this size that lie on the face, on an ellipsoid in its place."""
    rows, columns = cells
    right, down = columns / size[0], rows / size[1]
    scale = face.pixels_per_cm * right
    # Cells are as high as they are wide only by chance, so the head is made in square ones.
    height = max(1, round(size[1] * right))
    head = ellipsoid_head((face.circle.x * right, face.circle.y * right), scale, np.ones((height, columns), np.float32))
    points, normals = (
        cv2.resize(each, (columns, rows), interpolation=cv2.INTER_LINEAR) for each in (head.points_cm, head.normals)
    )
    x, y = (np.arange(columns) + 0.5) / right, (np.arange(rows)[:, None] + 0.5) / down
    inside = np.hypot(x - face.circle.x, y - face.circle.y) < face.circle.radius
    return FaceCells(inside, points[inside], normals[inside])


def _stated_plateaus(recording: DeskRecording, cells: Float32Array) -> list[Plateau]:
    """The plateaus that the setup's list of frames states."""
    shown = recording.setup.shown
    assert shown != "unknown"
    plateaus, start = [], 0
    for index in range(1, len(shown) + 1):
        if index == len(shown) or shown[index] != shown[start]:
            if shown[start] is not None:
                plateaus.append(Plateau(start, index, cells[start:index].mean(axis=0)))
            start = index
    return plateaus


def fit_field(found: DeskSamples) -> tuple[ReflectanceField, OlatSamples]:
    """The field of measured samples, and the samples in its unit and with its geometry.

    Without landmarks it is that of the pictures alone; with them it is as rendered people taught.
    """
    field, samples, skin = measured_field(found)
    if found.landmarks is None:
        return field, samples
    return with_learned_field(field, samples.directions, found.landmarks, skin, samples.matte), samples


def measured_field(found: DeskSamples) -> tuple[AppearanceField, OlatSamples, Mask]:
    """The field of the pictures alone, the samples in its unit and with its geometry, and what is skin."""
    geometry = found.samples.geometry
    skin = skin_mask(geometry.albedo, found.head.skin)
    held = hold_geometry(geometry, found.head, found.mirrored)
    field = fit_desk_field(found.samples, held, skin, found.skin_luminance)
    gain = room_gain(field, found.room, skin > 0.5, found.samples.matte) if found.room.any() else None
    pictures = found.samples.pictures
    if gain is not None:
        # Skin is fitted well by itself; there the gain would only carry the errors of the room's light.
        bare = (1 - skin).reshape(-1, 1)
        gain = np.asarray(1 + bare * (gain - 1), np.float32)
        field = field.scaled(gain)
        pictures = pictures * gain.reshape(*found.samples.matte.shape, 3)
    unit = np.float32(found.skin_luminance / _bright_skin(field, skin, found.samples.matte))
    samples = replace(found.samples, pictures=pictures * unit, known_geometry=replace(held, albedo=held.albedo * unit))
    return AppearanceField(samples, field.amounts * unit, RESIDUAL_KERNEL), samples, skin


def _bright_skin(field: DeskField, skin: Mask, matte: Mask) -> float:
    """The 75th percentile of the skin's luminance under a cosine lobe of light about the camera."""
    chosen = np.flatnonzero(certain_skin(skin, matte).ravel())
    chosen = chosen[:: max(1, len(chosen) // 2000)]
    facing = np.maximum(texel_vectors()[:, 2], 0) * texel_solid_angles().ravel()
    lobe = (facing / (facing * np.maximum(texel_vectors()[:, 2], 0)).sum()).astype(np.float32)
    lit = np.einsum("lpc,l->pc", field.at(texel_vectors(), chosen), lobe)
    return max(float(np.percentile(luminance(lit), 75)), 1e-9)


def _exposed(linear: LinearImage) -> DisplayImage:
    """A linear picture as trackers want it: its 99th percentile becomes 0.9."""
    return uint8_from_linear(linear * np.float32(0.9 / max(float(np.percentile(linear, 99)), 1e-6)))


def _disc(size: tuple[int, int], face: DeskFace) -> NDArray[np.bool_]:
    """Mask (height, width) of the face's circle in a frame."""
    x, y = np.arange(size[0]) + 0.5, np.arange(size[1])[:, None] + 0.5
    return np.asarray(np.hypot(x - face.circle.x, y - face.circle.y) < face.circle.radius)
