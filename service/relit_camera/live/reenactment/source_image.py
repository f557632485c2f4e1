"""The source image, the subject's captured picture: the face in it, and the person cut out of it.

Of the face the landmarks and the head's pose are found; of the person the matte, whose edges are feathered and which is
warped together with the picture.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from relit_camera.base.easing import smoothstep
from relit_camera.base.errors import SubjectError
from relit_camera.base.images.image_types import LinearImage, Mask, Points, RgbaImage
from relit_camera.base.images.tone_mapping import display_from_linear
from relit_camera.face.face_state import Tracker
from relit_camera.face.head_pose import HeadPose, fit_pose, unproject
from relit_camera.face.landmarks.landmark_schemes import LandmarkScheme, landmark_scheme
from relit_camera.face.tracking.track_recording import RecordedTracker
from relit_camera.face.tracking.trackers import open_tracker, track_still
from relit_camera.live.reenactment.warp import PositionGrid
from relit_camera.subject.subject import Subject

SCHEME_TRACKERS = {"mesh478": "mesh", "openseeface66": "openseeface"}
"""Name of the tracker that finds the landmarks of a scheme in a picture."""


@dataclass(frozen=True)
class SourceFace:
    """The face in the source image.

    Attributes:
        scheme: the landmark scheme.
        landmarks: (count, 2) float32 pixels of the source image.
        pose: of the head in the source image, relative to the camera.
        head_points: (count, 3) float64 centimetres: the landmarks in head axes.
        size: (width, height) of the source image.
    """

    scheme: LandmarkScheme
    landmarks: Points
    pose: HeadPose
    head_points: NDArray[np.float64]
    size: tuple[int, int]


def find_source_face(subject: Subject, tracker: Tracker) -> SourceFace:
    """Find the face in the subject's source image, with the tracker that also finds the live face.

    Models, and people who mark faces, do not mean quite the same points, so both should come from one. Where `tracker`
    is a recording, or finds no face, the landmarks stored with the subject are taken.

    Raises:
        SubjectError: the subject keeps no landmarks of the tracker's scheme and the tracker finds no face in it.
        ModelError: a recorded track is played back, the subject keeps no landmarks, and the models are missing.
    """
    scheme = landmark_scheme(tracker.scheme)
    recorded = isinstance(tracker, RecordedTracker)
    landmarks = None if recorded else _tracked_landmarks(subject, tracker)
    if landmarks is None:
        landmarks = subject.landmarks.get(scheme.name)
    if landmarks is None and recorded:
        # A recording has not seen the source image; the tracker that gives such landmarks finds them.
        landmarks = _tracked_landmarks(subject, open_tracker(SCHEME_TRACKERS[scheme.name]))
    if landmarks is None:
        raise SubjectError(
            f"tracker '{tracker.name}' finds no face in the subject's source image",
            "choose a subject whose face looks into the camera, or another tracker",
        )
    if len(landmarks) != scheme.count:
        raise SubjectError(
            f"the subject keeps {len(landmarks)} landmarks of scheme '{scheme.name}', which has {scheme.count}",
            "build the subject again",
        )
    pose = fit_pose(landmarks, scheme, subject.size)
    if pose is None:
        raise SubjectError("no head pose fits the landmarks of the subject's face", "build the subject again")
    return SourceFace(scheme, landmarks, pose, unproject(landmarks, pose, scheme, subject.size), subject.size)


def _tracked_landmarks(subject: Subject, tracker: Tracker) -> Points | None:
    state = track_still(subject.neutral, tracker)
    return state.landmarks if state.visible else None


UPSAMPLING = 2
"""Factor of a bicubic enlargement before the bilinear warp: as sharp as a bicubic warp, and quicker."""
FEATHER_WIDTH = 0.06
"""Share of the source image's width over which a person who is cut off by its side fades out."""
COLORED = 0.7
"""Matte from which a pixel's own color counts; others have that of the nearest such pixel. Where less of a pixel is the
person, what the matte or the capture got wrong there shows as a dark or jagged outline."""
BEYOND = cv2.BORDER_REPLICATE
"""The lower edge goes on below, where shoulders are cut off; the others are feathered to nothing."""
REACH = 4
"""Pixels beyond the matte that have a color: the enlargement and the warp look that far."""


class Cutout:
    """The person of one subject, cut out of the source image.

    Attributes:
        alpha: (height, width) float32 straight alpha of the source image, faded out at the sides and the top.
        whole: see `shows_whole_head`.
    """

    def __init__(self, subject: Subject) -> None:
        self.alpha = feather_edges(subject.matte)
        self.whole = shows_whole_head(subject.matte)
        self._edge = _edge_colors(subject.matte, subject.metadata.over_black)
        large = cv2.resize(self.alpha, None, fx=UPSAMPLING, fy=UPSAMPLING, interpolation=cv2.INTER_CUBIC)
        self._large_alpha = cv2.convertScaleAbs(np.maximum(large, 0), alpha=255)
        # Around it too, so that a strand of hair between the middles of the warp's cells is not left out.
        self._around = _around(self.alpha)

    def image(self, relit: LinearImage) -> RgbaImage:
        """The person in the relit source image, as the display shows it, enlarged by `UPSAMPLING`; for warping.

        Colors go on beyond the edge, for a warp that mixes neighbors. They are coded before they are enlarged: there
        are few pixels then, and an overshoot in codes is less visible in dark places than one in light.
        """
        colors, edge = relit.copy(), self._edge
        colors.reshape(-1, 3)[edge.pixels] = relit.reshape(-1, 3).take(edge.colored, axis=0) * edge.gain
        size = (UPSAMPLING * relit.shape[1], UPSAMPLING * relit.shape[0])
        large = cv2.resize(display_from_linear(colors), size, interpolation=cv2.INTER_CUBIC)
        image: RgbaImage = cv2.cvtColor(large, cv2.COLOR_RGB2RGBA)
        cv2.insertChannel(self._large_alpha, image, 3)
        return image

    def warped(self, relit: LinearImage, grid: PositionGrid, half_size: bool = False) -> RgbaImage:
        """The person in the relit source image (height, width, 3) at the positions of `grid`.

        With `half_size`, for which the step must be even, every second pixel is sampled and the others interpolated.
        """
        seen = cv2.remap(self._around, grid.nodes() - np.float32(0.5), None, cv2.INTER_LINEAR, borderMode=BEYOND) > 0
        if not half_size:
            return grid.sample(self.image(relit), UPSAMPLING, BEYOND, seen)
        half = grid.halved().sample(self.image(relit), UPSAMPLING, BEYOND, seen)
        (left, top, right, bottom), (rows, columns) = grid.box, half.shape[:2]
        whole: RgbaImage = cv2.resize(half, (2 * columns, 2 * rows), interpolation=cv2.INTER_LINEAR)
        return np.ascontiguousarray(whole[: bottom - top, : right - left])


@dataclass(frozen=True)
class _EdgeColors:
    """Where the pixels at the edge of the person, and next to it, take their colors from.

    Attributes:
        pixels: (count,) flat indices of those pixels.
        colored: (count,) flat index of the pixel whose color each of them has: its own, or the nearest.
        gain: (count, 1) float32 factor of that color.
    """

    pixels: NDArray[np.intp]
    colored: NDArray[np.intp]
    gain: NDArray[np.float32]


def _edge_colors(matte: Mask, over_black: bool) -> _EdgeColors:
    """`over_black`: whether the picture has the matte as a factor."""
    colored = matte >= COLORED
    if not colored.any():
        return _EdgeColors(np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros((0, 1), np.float32))
    row, column = distance_transform_edt(~colored, return_distances=False, return_indices=True)
    pixels = np.flatnonzero((matte < 1) & (_around(matte) > 0))
    nearest = (row * matte.shape[1] + column).reshape(-1)[pixels]
    gain = 1 / matte.reshape(-1, 1)[nearest] if over_black else np.ones((len(pixels), 1), np.float32)
    return _EdgeColors(pixels, nearest, gain.astype(np.float32))


def _around(matte: Mask) -> Mask:
    """The largest value of the matte within `REACH` of each pixel."""
    return np.asarray(cv2.dilate(matte, np.ones((2 * REACH + 1, 2 * REACH + 1), np.uint8)), np.float32)


def shows_whole_head(matte: Mask) -> bool:
    """Whether there is background beside the head; else the picture's border cuts the face off."""
    return bool(matte[: len(matte) // 2, [0, -1]].mean() < 0.5)


def feather_edges(matte: Mask) -> Mask:
    """The matte, faded out toward the sides and the top of the picture where it would be cut off hard."""
    height, width = matte.shape
    reach = max(FEATHER_WIDTH * width, 1.0)
    across = np.clip((np.minimum(np.arange(width), np.arange(width)[::-1]) + 0.5) / reach, 0, 1)
    down = np.clip((np.arange(height) + 0.5) / reach, 0, 1)
    smooth = np.minimum.outer(down, across)
    return np.asarray(matte * smoothstep(smooth), dtype=np.float32)
