"""The tracker `openseeface`: 66 points from OpenSeeFace's light landmark network, seeded by YuNet."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_types import DisplayImage, Points
from relit_camera.base.models.model_store import model_path
from relit_camera.base.models.session_with_fallback import Session, open_session
from relit_camera.face.detection.face_detector import Detection
from relit_camera.face.detection.installed_detector import open_face_detector
from relit_camera.face.landmarks.landmark_schemes import landmark_scheme
from relit_camera.face.landmarks.rotated_crop import Crop, bounding_box
from relit_camera.face.tracking.landmark_tracker import LandmarkPrediction, LandmarkTracker
from relit_camera.face.tracking.trackers import TrackerOptions

_INPUT = 224
_GRID = 28
_MARGIN_X, _MARGIN_Y = 0.10, 0.125
# ImageNet's mean and deviation, as factor and offset on 0..255.
_SCALE = (1 / (255 * np.array([0.229, 0.224, 0.225]))).astype(np.float32)
_OFFSET = (np.array([0.485, 0.456, 0.406]) / np.array([0.229, 0.224, 0.225])).astype(np.float32)


class OpenSeeFaceTracker(LandmarkTracker):
    """66 points, no irises and no blendshapes; coarser on the lips, hardier on small and noisy faces."""

    def __init__(self, options: TrackerOptions | None = None) -> None:
        """Open the models.

        Raises:
            ModelError: a model is missing.
        """
        options = options or TrackerOptions()
        network = OpenSeeFaceNetwork(open_session(model_path("openseeface"), "openseeface", options.session))
        detector = open_face_detector(options.session)
        super().__init__("openseeface", network, detector, options.focal_px, options.check_every)


class OpenSeeFaceNetwork:
    """Heat maps with offsets on an upright box, stretched to a square."""

    threshold = 0.6

    def __init__(self, session: Session) -> None:
        self.scheme = landmark_scheme("openseeface66")
        self._session = session

    def crop_from_detection(self, detection: Detection) -> Crop:
        """Give the detection's box with the network's margins."""
        return _with_margins(*detection.box)

    def crop_from_points(self, points: Points) -> Crop:
        """Give the box around the points with the network's margins."""
        return _with_margins(*bounding_box(points))

    def read(self, image: DisplayImage, crop: Crop) -> LandmarkPrediction:
        """Place the 66 points; the confidence is the mean of the heat maps' maxima."""
        pixels = crop.cut(image, _INPUT, _INPUT) * _SCALE - _OFFSET
        maps = self._session.run({"input": np.ascontiguousarray(pixels.transpose(2, 0, 1))[None]})["output"][0]
        points, peaks = decode_heat_maps(maps)
        return LandmarkPrediction(crop.to_picture(points, _INPUT, _INPUT), float(np.clip(peaks.mean(), 0, 1)))

    def blendshapes(self, points: Points) -> Mapping[str, float]:
        """None in this network."""
        return {}


def decode_heat_maps(maps: NDArray[np.float32]) -> tuple[Points, NDArray[np.float32]]:
    """Positions (66, 2) in the 224 x 224 input, and peaks (66,), of the network's (198, 28, 28) output.

    Channels are 66 heat maps, 66 row offsets and 66 column offsets, the offsets as sigmoids of 16 times their share of
    the input's side.
    """
    heat, rows, columns = maps.reshape(3, 66, _GRID * _GRID)
    cell = heat.argmax(axis=1)[:, None]
    grid = np.concatenate([cell % _GRID, cell // _GRID], axis=1) / (_GRID - 1)
    shares = np.concatenate([np.take_along_axis(columns, cell, 1), np.take_along_axis(rows, cell, 1)], axis=1)
    shares = np.clip(shares, 1e-7, 1 - 1e-7)
    # The grid runs over pixel centres, ours over pixel edges.
    points = (_INPUT - 1) * (grid + np.log(shares / (1 - shares)) / 16) + 0.5
    return points.astype(np.float32), np.take_along_axis(heat, cell, 1)[:, 0]


def _with_margins(x: float, y: float, width: float, height: float) -> Crop:
    width, height = max(width, 1.0), max(height, 1.0)
    grown_x, grown_y = width * (1 + 2 * _MARGIN_X), height * (1 + 2 * _MARGIN_Y)
    return Crop((x + width / 2, y + height / 2), grown_x, grown_y)
