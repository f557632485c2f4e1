"""Reenactor `first-order`, the default: first-order motion of the relit source image (thesis 6.3).

The source image's landmarks are moved as the driver's moved since neutral, a dense flow is mixed from local affine maps
round them, and the relit picture is warped at full output resolution.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.easing import smoothstep
from relit_camera.base.images.image_types import Frame, LinearImage
from relit_camera.face.head_pose import HeadPose
from relit_camera.face.motion.face_follower import FaceMotion
from relit_camera.live.reenactment.control_points import (
    COARSE_GRID,
    ControlPoints,
    control_points,
    feature_landmarks,
    fine_regions,
    head_and_shoulder_anchors,
)
from relit_camera.live.reenactment.dense_motion import DenseMotion, region_around
from relit_camera.live.reenactment.face_mesh import FaceMesh, triangulate_face
from relit_camera.live.reenactment.motion_transfer import transfer_motion, transfer_motion_in_place
from relit_camera.live.reenactment.mouth_interior import MouthInterior
from relit_camera.live.reenactment.reenactor import ReenactorContext, WarpedLayer, WarpTask
from relit_camera.live.reenactment.source_image import Cutout
from relit_camera.live.reenactment.warp import (
    FlowPatch,
    Warp,
    inverse_affine,
    move_body,
    source_from_output,
    visible_box,
)

BORDER_FADE = 0.08
"""Share of the source image's shorter side over which the flow of a face that is cut off by the border fades to 0."""


class FirstOrderReenactor:
    """See `Reenactor`."""

    def __init__(self, context: ReenactorContext) -> None:
        self._face = context.face
        self._size = context.size
        self._person = Cutout(context.subject)
        anchors = (
            head_and_shoulder_anchors(context.face.pose, context.face.size) if self._person.whole else np.zeros((0, 2))
        )
        self._points = control_points(context.face, anchors)
        self._mesh = triangulate_face(context.face)
        self._motion = DenseMotion(context.session)
        self._mouth = MouthInterior(context.face, context.subject.neutral)
        self._placed = source_from_output(context.subject.size, context.size)

    def plan_warp(self, motion: FaceMotion, frame: Frame) -> WarpTask:
        """See `Reenactor.plan_warp`."""
        face = self._face
        target = (transfer_motion if self._person.whole else transfer_motion_in_place)(face, self._points, motion)
        patches = face_and_head_flow(
            self._motion, self._mesh, self._points, target.points, target.landmarks, target.pose
        )
        if not self._person.whole:
            patches = tuple(fade_flow_at_border(patch, face.size) for patch in patches)
        placed = move_body(self._placed, target.pivot, target.shift, target.scale, face.size[1])
        box = visible_box(placed, face.size, self._size)
        positions = self._person.positions(Warp(placed, patches), box)
        to_box = inverse_affine(placed)
        to_box[:, 2] -= box[:2]

        def warp(relit: LinearImage) -> WarpedLayer:
            picture, alpha = self._person.sampled(relit, positions)
            self._mouth.draw(picture, alpha, relit, target.landmarks, target.pose, to_box)
            return WarpedLayer(picture, alpha, box[:2])

        return warp


def face_and_head_flow(
    motion: DenseMotion,
    mesh: FaceMesh,
    points: ControlPoints,
    target: NDArray[np.float64],
    landmarks: NDArray[np.float64],
    pose: HeadPose,
    fine: bool = True,
) -> tuple[FlowPatch, ...]:
    """The flow that brings the source image's control points to `target`: over the head, the face, then eyes and mouth.

    Args:
        motion: the graph.
        mesh: of the source image's face.
        points: its control points.
        target: (count, 2) where they must go, source pixels.
        landmarks: (count, 2) where all landmarks go, source pixels.
        pose: of the head that goes there.
        fine: eyes and mouth too: they open and close, as the mesh's seams cannot.
    """
    face = mesh.face
    head = region_around(np.vstack([points.source, target]), 0.6 * points.unit, *COARSE_GRID)
    regions = [head, *(fine_regions(face, landmarks) if fine else ())]
    scheme = face.scheme
    up = scheme.eye_centers(landmarks.astype(np.float32)).mean(axis=0) - landmarks[list(scheme.lips)].mean(axis=0)
    influence = points.influence(target, up / max(float(np.linalg.norm(up)), 1e-6))
    whole, *features = motion.flow(points.source, influence, points.radius, points.unit, regions)
    surface_flow = mesh.surface_flow(whole, landmarks, pose)
    groups = feature_landmarks(face.scheme) if fine else ()
    source = face.landmarks.astype(np.float64)
    return (
        whole,
        surface_flow,
        *(mesh.occlude_feature(p, surface_flow, source[list(g)]) for p, g in zip(features, groups, strict=True)),
    )


def fade_flow_at_border(patch: FlowPatch, size: tuple[int, int]) -> FlowPatch:
    """The flow, faded to 0 at the border of a source image of `size` (width, height), which must not come into view."""
    rows, columns = patch.flow.shape[:2]
    x, y = (np.linspace(patch.region[i], patch.region[i + 2], n) for i, n in ((0, columns), (1, rows)))
    inward = np.minimum.outer(np.minimum(y, size[1] - y), np.minimum(x, size[0] - x))
    fade = smoothstep(inward, 0, BORDER_FADE * min(size)).astype(np.float32)
    return FlowPatch(patch.flow * fade[..., None], patch.region)
