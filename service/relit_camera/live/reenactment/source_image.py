"""The source image, the subject's captured picture: the face in it, and the person cut out of it.

Of the face the landmarks and the head's pose are found; of the person the matte, whose edges are feathered and which is
warped together with the picture.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.easing import smoothstep
from relit_camera.base.errors import SubjectError
from relit_camera.base.images.image_types import LinearImage, Mask, Points, RgbaImage
from relit_camera.base.images.tone_mapping import display_from_linear
from relit_camera.base.rotations import Rotation
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

    def turn_to(self, pose: HeadPose) -> Rotation:
        """The rotation from the head in the source image to one of that pose, both before the camera."""
        return pose.rotation * self.pose.rotation.inv()


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
    # The head that is nobody's is no picture of a face: a tracker would find nothing in it, or something wrong.
    landmarks = None if recorded or subject.is_anyone else _tracked_landmarks(subject, tracker)
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


def half_size_face(face: SourceFace) -> SourceFace:
    """The face in the source image at half its size, see `subject.half_size`."""
    width, height = (-(-side // 2) for side in face.size)
    pose = replace(face.pose, focal_px=face.pose.focal_px / 2)
    return replace(face, landmarks=face.landmarks / np.float32(2), pose=pose, size=(width, height))


def _tracked_landmarks(subject: Subject, tracker: Tracker) -> Points | None:
    state = track_still(subject.neutral, tracker)
    return state.landmarks if state.visible else None


UPSAMPLING = 2
"""Factor of a bicubic enlargement before the bilinear warp: as sharp as a bicubic warp, and quicker."""
FEATHER_WIDTH = 0.06
"""Share of the source image's width over which a person who is cut off by its side fades out."""
COLORED = 0.5
"""Matte from which a pixel's color counts for its neighbors at the edge."""
TRUST_POWER = 4
"""The power of the matte with which it counts: where less of a pixel is the person, what the matte or the capture got
wrong there shows as a dark or jagged outline."""
EDGE_SIGMA, EDGE_GROWTH = 0.5, 0.5
"""Sigma, in pixels, of the Gaussian over which such colors are averaged: the first, and the second for each pixel that
the nearest of them is away."""
EDGE_NEIGHBORS, NEGLIGIBLE = 9, 0.02
"""How many colors are averaged at most, and the share of the largest weight below which one does not count."""
EDGE_COLUMNS = 256
FLANN_INDEX_KDTREE_SINGLE, FLANN_CHECKS_UNLIMITED = 4, -1
"""FLANN's names, which OpenCV does not export, for a search that is exact."""
BEYOND = cv2.BORDER_REPLICATE
"""The lower edge goes on below, where shoulders are cut off; the others are feathered to nothing."""
PINHOLE_SIDE = 0.02
"""Side, as a share of the source image's width, of a square as large as the largest hole that is filled."""
PINHOLE_BOUNDS = (0.9, 0.99)
"""Mattes from which a pixel bounds such a hole, one after the other: single hairs at the outline do not, and a lamp
shines through a twentieth."""
REACH = 4
"""Pixels beyond the matte that have a color: the enlargement and the warp look that far."""


class Cutout:
    """The person of one subject, cut out of the source image.

    Attributes:
        alpha: (height, width) float32 straight alpha of the source image, faded out at the sides and the top.
        whole: see `shows_whole_head`.
    """

    def __init__(self, subject: Subject) -> None:
        self.alpha = feather_edges(fill_pinholes(subject.matte))
        self.whole = shows_whole_head(subject.matte)
        self._edge = _edge_colors(subject.matte, subject.metadata.over_black)
        self._alpha_codes = np.rint(self.alpha * 255).astype(np.uint8)
        # Around it too, so that a strand of hair between the middles of the warp's cells is not left out.
        self._around = (_around(self.alpha) > 0).astype(np.uint8)

    def image(self, relit: LinearImage) -> RgbaImage:
        """The person in the relit source image, as the display shows it, enlarged by `UPSAMPLING`; for warping.

        Colors go on beyond the edge, for a warp that mixes neighbors. They are coded before they are enlarged: there
        are few pixels then, and an overshoot in codes is less visible in dark places than one in light.
        """
        codes, edge = display_from_linear(relit), self._edge
        if edge.pixels.size:
            codes.reshape(-1, 3)[edge.pixels] = display_from_linear(edge.averaged(relit)[np.newaxis])[0]
        colored = cv2.cvtColor(codes, cv2.COLOR_RGB2RGBA)
        cv2.insertChannel(self._alpha_codes, colored, 3)
        size = (UPSAMPLING * relit.shape[1], UPSAMPLING * relit.shape[0])
        image: RgbaImage = cv2.resize(colored, size, interpolation=cv2.INTER_CUBIC)
        return image

    def warped(self, image: RgbaImage, grid: PositionGrid, half_size: bool = False) -> RgbaImage:
        """The person, as `image` gives them, at the positions of `grid`.

        With `half_size`, for which the step must be even, every second pixel is sampled and the others interpolated.
        """
        near = cv2.remap(self._around, grid.nodes() - np.float32(0.5), None, cv2.INTER_NEAREST, borderMode=BEYOND)
        seen = near.view(np.bool_)
        if not half_size:
            return grid.sample(image, UPSAMPLING, BEYOND, seen)
        half = grid.halved().sample(image, UPSAMPLING, BEYOND, seen)
        (left, top, right, bottom), (rows, columns) = grid.box, half.shape[:2]
        whole: RgbaImage = cv2.resize(half, (2 * columns, 2 * rows), interpolation=cv2.INTER_LINEAR)
        return np.ascontiguousarray(whole[: bottom - top, : right - left])


@dataclass(frozen=True)
class _EdgeColors:
    """The colors of the pixels at the edge of the person, and next to it, as averages of colors nearby.

    Attributes:
        pixels: (count,) flat indices of those pixels.
        nearby: (`EDGE_NEIGHBORS` · rows, columns, 2) int16: x and y of what is averaged, the first of all pixels, then
            the second; as rows of `EDGE_COLUMNS`, because OpenCV limits the sides of what it samples.
        weights: (`EDGE_NEIGHBORS`, rows · columns · 3) float32 of it, the same for each channel: straight colors of the
            pixels from the picture's.
    """

    pixels: NDArray[np.intp]
    nearby: NDArray[np.int16]
    weights: NDArray[np.float32]

    def averaged(self, picture: LinearImage) -> NDArray[np.float32]:
        """The colors (count, 3) from a picture (height, width, 3)."""
        colors = cv2.remap(picture, self.nearby, None, cv2.INTER_NEAREST).reshape(self.weights.shape)
        sums = cv2.reduce(cv2.multiply(colors, self.weights, dst=colors), 0, cv2.REDUCE_SUM)
        return np.asarray(sums.reshape(-1, 3)[: len(self.pixels)], np.float32)


def _edge_colors(matte: Mask, over_black: bool) -> _EdgeColors:
    """Normalised convolution (Knutsson and Westin 1993) with powers of the matte as certainty.

    Args:
        matte: (height, width).
        over_black: whether the picture has the matte as a factor.
    """
    sure = np.flatnonzero(matte >= min(COLORED, float(matte.max())))
    pixels = np.flatnonzero((matte < 1) & (_around(matte) > 0))
    count = min(EDGE_NEIGHBORS, sure.size)
    index, distance = _nearest(_places(sure, matte), _places(pixels, matte), count)
    near = sure[index]
    share = matte.ravel()[near]
    nearest = distance[:, :1]
    sigma = EDGE_SIGMA + EDGE_GROWTH * nearest
    weight = share**TRUST_POWER * np.exp((nearest**2 - distance**2) / (2 * sigma**2))
    weight[weight < NEGLIGIBLE * weight.max(axis=1, keepdims=True)] = 0
    weight /= (weight * (share if over_black else 1)).sum(axis=1, keepdims=True)
    rows = -(-len(pixels) // EDGE_COLUMNS)
    nearby = np.zeros((EDGE_NEIGHBORS, rows * EDGE_COLUMNS, 2), np.int16)
    weights = np.zeros((EDGE_NEIGHBORS, rows * EDGE_COLUMNS, 3), np.float32)
    nearby[:count, : len(pixels), 1], nearby[:count, : len(pixels), 0] = np.divmod(near.T, matte.shape[1])
    weights[:count, : len(pixels)] = weight.T[..., None]
    return _EdgeColors(pixels, nearby.reshape(-1, EDGE_COLUMNS, 2), weights.reshape(EDGE_NEIGHBORS, -1))


def _places(pixels: NDArray[np.intp], matte: Mask) -> NDArray[np.float32]:
    """Rows and columns (count, 2) of flat indices."""
    return np.column_stack(np.unravel_index(pixels, matte.shape)).astype(np.float32)


def _nearest(
    points: NDArray[np.float32], around: NDArray[np.float32], count: int
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """The `count` of `points` (some, 2) that are nearest to each of `around` (others, 2), nearest first.

    Indices and distances, (others, count) each. By OpenCV: SciPy's tree would cost the camera 16 MB.
    """
    if not len(around):
        return np.zeros((0, count), np.int32), np.zeros((0, count))
    tree = cv2.flann.Index(points, {"algorithm": FLANN_INDEX_KDTREE_SINGLE})
    indices, squares = tree.knnSearch(around, count, params={"checks": FLANN_CHECKS_UNLIMITED})
    return np.asarray(indices, np.int32), np.sqrt(np.asarray(squares, np.float64))


def _around(matte: Mask) -> Mask:
    """The largest value of the matte within `REACH` of each pixel."""
    return np.asarray(cv2.dilate(matte, np.ones((2 * REACH + 1, 2 * REACH + 1), np.uint8)), np.float32)


def shows_whole_head(matte: Mask) -> bool:
    """Whether there is background beside the head; else the picture's border cuts the face off."""
    return bool(matte[: len(matte) // 2, [0, -1]].mean() < 0.5)


def fill_pinholes(matte: Mask) -> Mask:
    """The matte without holes of a few pixels, as between hair and ear.

    What is seen through them lies there only while the head looks ahead. Moved with the picture, they are dots of the
    background that glide along with the face.
    """
    for bound in PINHOLE_BOUNDS:
        matte = np.where(_small_holes(matte < bound), 1, matte)
    return np.asarray(matte, np.float32)


def _small_holes(thin: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which pixels (height, width) lie in pieces of a few thin ones, off the picture's border."""
    height, width = thin.shape
    _, labels, stats, _ = cv2.connectedComponentsWithStats(thin.astype(np.uint8), connectivity=8)
    left, top, across, down, area = stats[:, : cv2.CC_STAT_MAX].T
    inside = (left > 0) & (top > 0) & (left + across < width) & (top + down < height)
    holes = inside & (area <= (PINHOLE_SIDE * width) ** 2)
    holes[0] = False  # what is not thin
    return np.asarray(holes[labels], np.bool_)


def feather_edges(matte: Mask) -> Mask:
    """The matte, faded out toward the sides and the top of the picture where it would be cut off hard."""
    height, width = matte.shape
    reach = max(FEATHER_WIDTH * width, 1.0)
    across = np.clip((np.minimum(np.arange(width), np.arange(width)[::-1]) + 0.5) / reach, 0, 1)
    down = np.clip((np.arange(height) + 0.5) / reach, 0, 1)
    smooth = np.minimum.outer(down, across)
    return np.asarray(matte * smoothstep(smooth), dtype=np.float32)
