"""The tracker `mesh`: the 478-point face mesh of MediaPipe's face landmarker, with irises and blendshapes."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from relit_camera.face.blendshapes import BLENDSHAPE_NAMES, BLENDSHAPE_POINTS
from relit_camera.face.crop import Crop, bounds
from relit_camera.face.detector import Detection, FaceDetector
from relit_camera.face.landmark_tracker import LandmarkTracker, Reading
from relit_camera.face.schemes import landmark_scheme
from relit_camera.face.trackers import TrackerOptions
from relit_camera.models.registry import model_path
from relit_camera.models.session import Session, open_session
from relit_camera.space.images import DisplayImage, Points

_INPUT = 256
_MARGIN = 1.5
_RIGHT_EYE, _LEFT_EYE = 33, 263


class MeshTracker(LandmarkTracker):
    """478 points and, if asked for, 52 blendshapes; follows turns to about 50° and any roll."""

    def __init__(self, options: TrackerOptions | None = None) -> None:
        """Open the models.

        Raises:
            ModelError: a model is missing.
            InputError: the options carry an argument.
        """
        options = options or TrackerOptions()
        options.no_argument("mesh")
        network = MeshNetwork(
            open_session(model_path("face_mesh"), "face_mesh", options.session),
            open_session(model_path("face_blendshapes"), "face_blendshapes", options.session)
            if options.blendshapes
            else None,
        )
        detector = FaceDetector(model_path("face_detector_yunet"))
        super().__init__("mesh", network, detector, options.focal_px, options.check_every)


class MeshNetwork:
    """The mesh on a square crop, turned so that the eyes are level."""

    threshold = 0.5

    def __init__(self, mesh: Session, blendshapes: Session | None = None) -> None:
        self.scheme = landmark_scheme("mesh478")
        self._mesh = mesh
        self._blendshapes = blendshapes

    def crop_from_detection(self, detection: Detection) -> Crop:
        """Give a square of 1.5 times the box's longer side about its centre."""
        x, y, width, height = detection.box
        side = _MARGIN * max(width, height)
        across = detection.eyes[1] - detection.eyes[0]
        return Crop((x + width / 2, y + height / 2), side, side, float(np.arctan2(across[1], across[0])))

    def crop_from_points(self, points: Points) -> Crop:
        """Give a square of 1.5 times the longer side of the box around the levelled points."""
        across = points[_LEFT_EYE] - points[_RIGHT_EYE]
        angle = float(np.arctan2(across[1], across[0]))
        cos, sin = np.cos(angle), np.sin(angle)
        picture_from_level = np.array([[cos, -sin], [sin, cos]], dtype=np.float32)
        x, y, width, height = bounds(points @ picture_from_level)
        centre = picture_from_level @ np.array([x + width / 2, y + height / 2], dtype=np.float32)
        side = _MARGIN * max(width, height, 1.0)
        return Crop((float(centre[0]), float(centre[1])), side, side, angle)

    def read(self, image: DisplayImage, crop: Crop) -> Reading:
        """Place the 478 points; the confidence is the network's presence."""
        pixels = np.multiply(crop.cut(image, _INPUT, _INPUT), np.float32(1 / 255), dtype=np.float32)
        outputs = self._mesh.run({"image": pixels[None]})
        points = outputs["landmarks"].reshape(-1, 3)[:, :2]
        presence = 1 / (1 + np.exp(-float(outputs["presence_logit"].ravel()[0])))
        return Reading(crop.to_picture(points, _INPUT, _INPUT), presence)

    def blendshapes(self, points: Points) -> Mapping[str, float]:
        """Scores 0..1 by ARKit name; {} without the blendshape model."""
        if self._blendshapes is None:
            return {}
        scores = self._blendshapes.run({"points": points[list(BLENDSHAPE_POINTS)][None]})["scores"].ravel()
        return dict(zip(BLENDSHAPE_NAMES, scores.tolist(), strict=True))
