"""Eyes in the face's mesh: lids that meet when an eye shuts, and the eyeball behind them, which lids hide."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.easing import smoothstep
from relit_camera.face.head_pose import HeadPose, project
from relit_camera.face.landmarks.landmark_schemes import EyeLandmarks
from relit_camera.live.reenactment.source_image import SourceFace

SHUT, AS_SEEN = 0.35, 0.65
"""Opening of an eye beside its neutral one: up to where it is shut, and from where on it is as open as the landmarks
say. Trackers leave a gap between shut lids."""
LOWER_LID_SHARE = 0.15
"""By how much of what is closed so the lower lid rises; the upper one falls by the rest."""
CLOSING = (0.8, 0.5)
"""Opening from where on lids begin to hide the eyeball, and from where on only they move: see `EyeMesh.meet_lids`."""
LEAST_GAP = 0.05
"""Least neutral gap of the lids, in widths of the eye: of one that is shut in the source image, noise would open it."""
SURROUNDINGS = 0.75
"""Skin beside the lids that may come to lie near moved ones, in widths of the eye: some of it is that of the brow."""


@dataclass(frozen=True)
class EyeMesh:
    """One eye of a source image.

    Attributes:
        face: the source image's face.
        source: (landmarks, 2) float64 source pixels: all its landmarks.
        lids: (count,) the closed outline of the opening, as `EyeLandmarks.lids`.
        upper, lower: (pairs,) points of the lids that lie over each other, from the outer to the inner corner.
        corners: (2,) the outer and the inner corner.
    """

    face: SourceFace
    source: NDArray[np.float64]
    lids: NDArray[np.intp]
    upper: NDArray[np.intp]
    lower: NDArray[np.intp]
    corners: NDArray[np.intp]

    @property
    def surroundings(self) -> NDArray[np.intp]:
        """The box (4,) of the source image, in pixels, that the eye and the skin round it lie in."""
        lids = self.source[self.lids]
        margin = SURROUNDINGS * float(np.ptp(lids[:, 0]))
        return np.concatenate([np.floor(lids.min(axis=0) - margin), np.ceil(lids.max(axis=0) + margin)]).astype(int)

    def opening(self, landmarks: NDArray[np.float64], pose: HeadPose) -> float:
        """How open the eye is: 1 as in the source image, 0 shut, below 0 with lids that have crossed.

        Args:
            landmarks: (count, 2) where all landmarks go, source pixels.
            pose: of the head that goes there: a nod does not shut an eye.
        """
        return float(self._gaps(landmarks).mean()) / self._neutral_gap(pose)

    def meet_lids(self, landmarks: NDArray[np.float64], pose: HeadPose) -> float:
        """Let lids meet that nearly do, and those that have crossed.

        Args:
            landmarks: as in `opening`; they are changed in place.
            pose: the same.

        Returns:
            The closing of the eye then, 0..1: how far lids that move over the eyeball take the place of a flow that
            moves both and the skin round them.
        """
        opening = self.opening(landmarks, pose)
        if opening < AS_SEEN:
            gaps, kept = self._gaps(landmarks), max((opening - SHUT) / (AS_SEEN - SHUT), 0.0)
            closed = (gaps - kept * np.maximum(gaps, 0))[:, None] * _axes(landmarks[self.corners])[:, 1]
            landmarks[self.upper] += (1 - LOWER_LID_SHARE) * closed
            landmarks[self.lower] -= LOWER_LID_SHARE * closed
            opening = self.opening(landmarks, pose)
        return float(smoothstep(opening, *CLOSING))

    def _gaps(self, landmarks: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distance (pairs,) of the lids, down the face, pixels; below 0 where they have crossed."""
        return np.asarray((landmarks[self.lower] - landmarks[self.upper]) @ _axes(landmarks[self.corners])[:, 1])

    def _neutral_gap(self, pose: HeadPose) -> float:
        """Mean distance of the lids of a head in this pose with the source image's expression, pixels."""
        points = np.concatenate([self.upper, self.lower, self.corners])
        seen = project(self.face.head_points[points], pose, self.face.size).astype(np.float64)
        upper, lower, corners = np.split(seen, [len(self.upper), len(self.upper) + len(self.lower)])
        axes = _axes(corners)
        least = LEAST_GAP * float(np.hypot(*axes[:, 0]))
        return max(float(((lower - upper) @ axes[:, 1]).mean()), least, 1e-6)

    def eyeball(self, landmarks: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """What is seen between moved lids, as a fan of triangles.

        The eyeball lies between the corners of the eye as it does in the source image. Where the opening is larger than
        there, it is stretched.

        Args:
            landmarks: (count, 2) where all landmarks go, source pixels.

        Returns:
            Of the triangles, (lids, 3, 2) each: where their corners go, and where these look in the source image.
        """
        moved = _along_axes(landmarks[self.lids], landmarks[self.corners])
        upper, lower = (
            _along_axes(self.source[[self.corners[0], *lid, self.corners[1]]], self.source[self.corners])
            for lid in (self.upper, self.lower)
        )
        across = np.clip(moved[:, 0], upper[0, 0], upper[-1, 0])
        top, bottom = (np.interp(across, lid[:, 0], lid[:, 1]) for lid in (upper, lower))
        seen = np.column_stack([across, np.clip(moved[:, 1], top, np.maximum(top, bottom))])
        looks = self.source[self.corners].mean(axis=0) + seen @ _axes(self.source[self.corners]).T
        return _fan(landmarks[self.lids]), _fan(looks)


def eye_mesh(face: SourceFace, eye: EyeLandmarks) -> EyeMesh:
    """An eye of a source image's face."""
    inner = eye.lids.index(eye.inner)
    lids, upper, lower, corners = (
        np.array(points) for points in (eye.lids, eye.lids[1:inner], eye.lids[:inner:-1], (eye.outer, eye.inner))
    )
    return EyeMesh(face, face.landmarks.astype(np.float64), lids, upper, lower, corners)


def _axes(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Columns (2, 2): from the outer to the inner corner of an eye, and a unit vector down the face."""
    across = corners[1] - corners[0]
    down = np.array([-across[1], across[0]]) / max(float(np.hypot(*across)), 1e-6)
    return np.column_stack([across, down if down[1] > 0 else -down])


def _along_axes(points: NDArray[np.float64], corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (count, 2) in the axes of an eye, from the middle between its corners."""
    across, down = _axes(corners).T
    length = max(float(across @ across), 1e-12)  # the axes are at right angles
    return np.asarray((points - corners.mean(axis=0)) @ np.column_stack([across / length, down]))


def _fan(outline: NDArray[np.float64]) -> NDArray[np.float64]:
    """Triangles (count, 3, 2) from the mean of an outline (count, 2) to its sides."""
    return np.stack([np.broadcast_to(outline.mean(axis=0), outline.shape), outline, np.roll(outline, -1, axis=0)], 1)
