"""The tracker `mesh`: the 478-point face mesh of MediaPipe's face landmarker, with irises and blendshapes.

The tables hold the points that the blendshape network takes, and the names of its scores.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from relit_camera.base.images.image_types import DisplayImage, Points
from relit_camera.base.models.model_store import installed_model, model_path
from relit_camera.base.models.session_with_fallback import Session, open_session
from relit_camera.face.detection.face_detector import Detection
from relit_camera.face.detection.installed_detector import open_face_detector
from relit_camera.face.landmarks.landmark_schemes import landmark_scheme
from relit_camera.face.landmarks.rotated_crop import Crop, bounding_box
from relit_camera.face.tracking.landmark_tracker import LandmarkPrediction, LandmarkTracker
from relit_camera.face.tracking.mesh_refinement import mesh_points
from relit_camera.face.tracking.trackers import TrackerOptions

# fmt: off
BLENDSHAPE_POINTS = (
    0, 1, 4, 5, 6, 7, 8, 10, 13, 14, 17, 21, 33, 37, 39, 40, 46, 52, 53, 54, 55, 58, 61, 63, 65, 66, 67, 70, 78,
    80, 81, 82, 84, 87, 88, 91, 93, 95, 103, 105, 107, 109, 127, 132, 133, 136, 144, 145, 146, 148, 149, 150,
    152, 153, 154, 155, 157, 158, 159, 160, 161, 162, 163, 168, 172, 173, 176, 178, 181, 185, 191, 195, 197,
    234, 246, 249, 251, 263, 267, 269, 270, 276, 282, 283, 284, 285, 288, 291, 293, 295, 296, 297, 300, 308,
    310, 311, 312, 314, 317, 318, 321, 323, 324, 332, 334, 336, 338, 356, 361, 362, 365, 373, 374, 375, 377,
    378, 379, 380, 381, 382, 384, 385, 386, 387, 388, 389, 390, 397, 398, 400, 402, 405, 409, 415, 454, 466,
    468, 469, 470, 471, 472, 473, 474, 475, 476, 477,
)
"""The 146 points of `mesh478` that the network takes, in its order."""

BLENDSHAPE_NAMES = (
    "_neutral", "browDownLeft", "browDownRight", "browInnerUp", "browOuterUpLeft", "browOuterUpRight",
    "cheekPuff", "cheekSquintLeft", "cheekSquintRight", "eyeBlinkLeft", "eyeBlinkRight", "eyeLookDownLeft",
    "eyeLookDownRight", "eyeLookInLeft", "eyeLookInRight", "eyeLookOutLeft", "eyeLookOutRight", "eyeLookUpLeft",
    "eyeLookUpRight", "eyeSquintLeft", "eyeSquintRight", "eyeWideLeft", "eyeWideRight", "jawForward", "jawLeft",
    "jawOpen", "jawRight", "mouthClose", "mouthDimpleLeft", "mouthDimpleRight", "mouthFrownLeft",
    "mouthFrownRight", "mouthFunnel", "mouthLeft", "mouthLowerDownLeft", "mouthLowerDownRight",
    "mouthPressLeft", "mouthPressRight", "mouthPucker", "mouthRight", "mouthRollLower", "mouthRollUpper",
    "mouthShrugLower", "mouthShrugUpper", "mouthSmileLeft", "mouthSmileRight", "mouthStretchLeft",
    "mouthStretchRight", "mouthUpperUpLeft", "mouthUpperUpRight", "noseSneerLeft", "noseSneerRight",
)
"""The 52 scores in the network's order; "left" and "right" are the subject's."""
# fmt: on


MESHES = ("face_mesh", "face_mesh_attention")
"""Networks of the tracker; the first one that is installed is used."""

_MARGIN = 1.5
_RIGHT_EYE, _LEFT_EYE = 33, 263


class MeshTracker(LandmarkTracker):
    """478 points and, if asked for, 52 blendshapes; follows turns to about 50° and any roll."""

    def __init__(self, options: TrackerOptions | None = None) -> None:
        """Open the models.

        Raises:
            ModelError: a model is missing.
        """
        options = options or TrackerOptions()
        mesh = installed_model(MESHES) or MESHES[0]
        network = MeshNetwork(
            open_session(model_path(mesh), mesh, options.session),
            open_session(model_path("face_blendshapes"), "face_blendshapes", options.session)
            if options.blendshapes
            else None,
        )
        detector = open_face_detector(options.session)
        super().__init__("mesh", network, detector, options.focal_px, options.check_every)


class MeshNetwork:
    """The mesh on a square crop, turned so that the eyes are level."""

    threshold = 0.5

    def __init__(self, mesh: Session, blendshapes: Session | None = None) -> None:
        self.scheme = landmark_scheme("mesh478")
        self._mesh = mesh
        self._blendshapes = blendshapes
        self._side = mesh.inputs["image"].shape[1] or 0
        self._input = np.empty((1, self._side, self._side, 3), np.float32)

    def crop_from_detection(self, detection: Detection) -> Crop:
        """Give a square of 1.5 times the box's longer side about its centre."""
        x, y, width, height = detection.box
        side = _MARGIN * max(width, height)
        across = detection.eyes[1] - detection.eyes[0]
        return Crop((x + width / 2, y + height / 2), side, side, float(np.arctan2(across[1], across[0])))

    def crop_from_points(self, points: Points) -> Crop:
        """Give a square of 1.5 times the longer side of the box around the levelled points."""
        across_x, across_y = (points[_LEFT_EYE] - points[_RIGHT_EYE]).tolist()
        angle = math.atan2(across_y, across_x)
        cos, sin = math.cos(angle), math.sin(angle)
        x, y, width, height = bounding_box(points @ np.array([[cos, -sin], [sin, cos]], dtype=np.float32))
        level_x, level_y = x + width / 2, y + height / 2
        side = _MARGIN * max(width, height, 1.0)
        return Crop((cos * level_x - sin * level_y, sin * level_x + cos * level_y), side, side, angle)

    def read(self, image: DisplayImage, crop: Crop) -> LandmarkPrediction:
        """Place the 478 points; the confidence is the network's presence."""
        side = self._side
        np.multiply(crop.cut(image, side, side), np.float32(1 / 255), out=self._input[0], dtype=np.float32)
        outputs = self._mesh.run({"image": self._input})
        presence = 1 / (1 + math.exp(-outputs["presence_logit"].item()))
        return LandmarkPrediction(crop.to_picture(mesh_points(outputs), side, side), presence)

    def blendshapes(self, points: Points) -> Mapping[str, float]:
        """Scores 0..1 by ARKit name; {} without the blendshape model."""
        if self._blendshapes is None:
            return {}
        scores = self._blendshapes.run({"points": points[list(BLENDSHAPE_POINTS)][None]})["scores"].ravel()
        return dict(zip(BLENDSHAPE_NAMES, scores.tolist(), strict=True))
