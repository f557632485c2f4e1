"""Reenactor `first-order`, the default: first-order motion of the relit source image (thesis 6.3).

The source image's landmarks are moved as the driver's moved since neutral, a dense flow is mixed from local affine maps
round them, and the relit picture is warped at full output resolution.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_types import Frame, LinearImage
from relit_camera.face.head_pose import HeadPose
from relit_camera.face.motion.face_follower import FaceMotion
from relit_camera.live.reenactment.control_points import (
    ControlPoints,
    control_points,
    feature_boxes,
    feature_landmarks,
    head_and_shoulder_anchors,
)
from relit_camera.live.reenactment.dense_motion import DenseMotion, box_around
from relit_camera.live.reenactment.mesh.eye_drawing import plan_closing_eyes
from relit_camera.live.reenactment.mesh.face_mesh import FaceMesh, SurfacePatch
from relit_camera.live.reenactment.mesh.far_outline import plan_far_outline
from relit_camera.live.reenactment.mesh.head_mesh import HeadMesh, triangulate_head
from relit_camera.live.reenactment.motion_transfer import transfer_motion, transfer_motion_in_place
from relit_camera.live.reenactment.mouth.mouth_interior import MouthInterior
from relit_camera.live.reenactment.reenactor import ReenactorContext, WarpedLayer, WarpTask
from relit_camera.live.reenactment.source_image import Cutout, SourceFace
from relit_camera.live.reenactment.stills.still_drawing import StillDrawing
from relit_camera.live.reenactment.warp import (
    FixedBorder,
    FlowPatch,
    Patch,
    Warp,
    inverse_affine,
    move_body,
    source_from_output,
    visible_box,
)
from relit_camera.live.render_quality import RenderQuality
from relit_camera.subject.expression_stills import STILL_SCHEME

NODE_SPACING = 0.0145
"""Eye distances between computed positions. With 0.02 the outline of a turned nose is seen as a staircase."""
HEAD_MARGIN = 0.6
"""Eye distances round all control points, over which the flow fades out."""


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
        self._mesh = triangulate_head(context.face, anchors)
        self._motion = DenseMotion(context.session)
        self._mouth = MouthInterior(context.face, context.subject.neutral)
        with_stills = context.subject.stills and context.face.scheme.name == STILL_SCHEME
        self._stills = StillDrawing(context.subject, context.face) if with_stills else None
        self._placed = source_from_output(context.subject.size, context.size)
        # Of the body at rest: a step that changed as the body grows would be seen.
        self._step = max(round(NODE_SPACING * self._points.unit / self._placed[0, 0]), 1)

    def plan_warp(self, motion: FaceMotion, frame: Frame, quality: RenderQuality) -> WarpTask:
        """See `Reenactor.plan_warp`."""
        face = self._face
        target = (transfer_motion if self._person.whole else transfer_motion_in_place)(face, self._points, motion)
        landmarks, closing = self._mesh.with_lids_that_meet(target.landmarks, target.pose)
        patches = whole_flow(self._motion, self._mesh, self._points, target.points, landmarks, target.pose, closing)
        surface = patches[1]
        fixed = () if self._person.whole else (FixedBorder(face.size),)
        placed = move_body(self._placed, target.pivot, target.shift, target.scale, face.size[1])
        box = visible_box(placed, face.size, self._size)
        grid = Warp(placed, (*patches, *fixed)).grid(box, 2 * self._step if quality.half_size else self._step)
        to_box = inverse_affine(placed)
        to_box[:, 2] -= box[:2]
        size = (box[2] - box[0], box[3] - box[1])
        stills = self._stills and self._stills.plan(
            landmarks,
            target.pose,
            motion.expression,
            frame.time_s,
            to_box,
            size,
            self._step,
            quality.half_size,
        )
        eyes = plan_closing_eyes(self._mesh.eyes, closing, surface, landmarks, to_box, size, quality.half_size)
        silhouette = self._mesh.silhouette(landmarks, target.pose, to_box)
        outline = plan_far_outline(silhouette, grid, quality.half_size)

        def warp(relit: LinearImage) -> WarpedLayer:
            person = self._person.image(relit)
            image = self._person.warped(person, grid, quality.half_size)
            if outline:
                outline.draw(image, person)
            for eye in eyes:
                eye.draw(image, relit)
            if not (stills and stills.has_mouth):
                self._mouth.draw(image, relit, landmarks, target.pose, to_box)
            if stills:
                stills.draw(image, relit)
            return WarpedLayer(image, box[:2])

        return warp


def face_and_head_flow(
    motion: DenseMotion,
    mesh: FaceMesh,
    points: ControlPoints,
    target: NDArray[np.float64],
    landmarks: NDArray[np.float64],
    pose: HeadPose,
) -> tuple[Patch, Patch]:
    """The flow that brings the source image's control points to `target`: over the head, and over the face.

    Eyes and mouth do not open and close in it, for the mesh has no seams there.

    Args:
        motion: the graph.
        mesh: of the source image's face.
        points: its control points.
        target: (count, 2) where they must go, source pixels.
        landmarks: (count, 2) where all landmarks go, source pixels.
        pose: of the head that goes there.
    """
    (head,) = _flows(motion, mesh.face, points, target, landmarks, [])
    return head, mesh.surface(landmarks, pose)


def whole_flow(
    motion: DenseMotion,
    mesh: HeadMesh,
    points: ControlPoints,
    target: NDArray[np.float64],
    landmarks: NDArray[np.float64],
    pose: HeadPose,
    closing: tuple[float, float],
) -> tuple[Patch, SurfacePatch, *tuple[Patch, ...]]:
    """As `face_and_head_flow`, with eyes and mouth, and with the far side of a turned head hidden by the face.

    `closing` is that of the eyes: over one that closes its lids move, which are the mesh's.
    """
    face = mesh.face.face
    boxes = feature_boxes(face, landmarks)
    head, *features = _flows(motion, face, points, target, landmarks, boxes)
    surface = mesh.surface(landmarks, target[len(points.chosen) :], pose, closing)
    source = face.landmarks.astype(np.float64)
    shares = (*(1 - share for share in closing), 1.0)
    parts = zip(features, feature_landmarks(face.scheme), shares, strict=True)
    return head, surface, *(mesh.face.feature_patch(flow, source[list(part)], share) for flow, part, share in parts)


def _flows(
    motion: DenseMotion,
    face: SourceFace,
    points: ControlPoints,
    target: NDArray[np.float64],
    landmarks: NDArray[np.float64],
    features: list[NDArray[np.float64]],
) -> tuple[FlowPatch, ...]:
    """The first-order flow over the head, then over boxes of `features`; see `face_and_head_flow`."""
    head = box_around(np.vstack([points.source, target]), HEAD_MARGIN * points.unit)
    lips = landmarks[list(face.scheme.lips)].mean(axis=0)
    up = face.scheme.eye_centers(landmarks.astype(np.float32)).mean(axis=0) - lips
    influence = points.influence(target, up / max(float(np.linalg.norm(up)), 1e-6))
    return motion.flow(points.source, influence, points.radius, points.unit, head, features)
