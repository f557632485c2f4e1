"""Face detection with BlazeFace (Bazarevsky et al. 2019), MediaPipe's network for near faces."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_types import DisplayImage
from relit_camera.base.models.session_with_fallback import Session
from relit_camera.face.detection.face_detector import Detection, FaceDetector, intersection_over_union, reduced

_INPUT = 128
_GRIDS = ((16, 2), (8, 6))
"""Cells a side, and anchors a cell, in the order of the network's rows."""
_POSSIBLE, _CERTAIN = 0.5, 0.75
"""Scores from which something is looked at again, and from which it is a face."""
_MOST_LOOKS = 4
_ONE_FACE_OVERLAP = 0.3
_TILE, _TILE_STEP = 0.5, 0.25
"""Side of the squares that are searched one by one, and the step between them, in longer sides of the picture."""

_ANCHORS = np.concatenate(
    [np.repeat((np.mgrid[:cells, :cells][::-1].reshape(2, -1).T + 0.5) / cells, each, axis=0) for cells, each in _GRIDS]
)
"""(896, 2) centres (x, y) in sides of the input."""


class BlazeFaceDetector(FaceDetector):
    """BlazeFace on the whole picture, a second look at what could be a face, or else at overlapping squares.

    By itself it finds no face under a tenth of what it is shown, and takes a skull on a sweater for one: where it is
    not certain, it looks again at the surroundings alone. The squares are searched where there is nothing: they show
    faces of a twentieth of the picture.
    """

    def __init__(self, session: Session) -> None:
        """Take the open network."""
        self._session = session
        self._input = np.empty((1, _INPUT, _INPUT, 3), np.float32)

    def _faces(self, image: DisplayImage) -> list[Detection]:
        found = self._certain_of(image, self._found(image, _POSSIBLE))
        if not found:
            tiles = _tiles(image)
            possible = [face.moved(x, y) for x, y, tile in tiles for face in self._found(tile, _POSSIBLE)]
            found = self._certain_of(image, sorted(possible, key=lambda face: -face.score))
        return found

    def _certain_of(self, image: DisplayImage, possible: list[Detection]) -> list[Detection]:
        """The faces among what could be one, each once; the most likely come first, and so many are looked at."""
        kept: list[Detection] = []
        for face in possible[:_MOST_LOOKS]:
            certain = face if face.score >= _CERTAIN else self.detect_nearby(image, face.box)
            if certain and all(intersection_over_union(certain.box, one.box) < _ONE_FACE_OVERLAP for one in kept):
                kept.append(certain)
        return kept

    def _faces_in_surroundings(self, region: DisplayImage) -> list[Detection]:
        return self._found(region, _CERTAIN)

    def _found(self, image: DisplayImage, threshold: float) -> list[Detection]:
        """The faces that the network finds in a picture of 128 px, the most certain first."""
        small = reduced(image, _INPUT)
        rows, columns = small.shape[:2]
        top, left = (_INPUT - rows) // 2, (_INPUT - columns) // 2
        self._input.fill(-1)
        self._input[0, top : top + rows, left : left + columns] = small * np.float32(2 / 255) - 1
        outputs = self._session.run({"image": self._input})
        corner = np.array([left, top], np.float32)
        scale = np.array([image.shape[1] / columns, image.shape[0] / rows], np.float32)
        found = _faces_of(outputs["regressors"][0], outputs["classificators"][0, :, 0], threshold)
        return [_in_picture(row, score, corner, scale) for row, score in found]


def _faces_of(
    rows: NDArray[np.float32], logits: NDArray[np.float32], threshold: float
) -> Iterator[tuple[NDArray[np.float32], float]]:
    """The faces: the network's rows (8, 2) in pixels of its input, and their scores.

    Rows that overlap the best one are the same face, and are averaged by their scores: a single one jitters.
    """
    chosen = np.flatnonzero(logits >= np.log(threshold / (1 - threshold)))
    chosen = chosen[np.argsort(-logits[chosen])]
    scores = 1 / (1 + np.exp(-logits[chosen]))
    found = rows[chosen].reshape(-1, 8, 2)
    found[:, [0, *range(2, 8)]] += (_ANCHORS[chosen] * _INPUT)[:, None].astype(np.float32)
    while len(found):
        same = np.array([intersection_over_union(_box(found[0]), _box(row)) > _ONE_FACE_OVERLAP for row in found])
        same[0] = True
        yield np.average(found[same], axis=0, weights=scores[same]), float(scores[0])
        found, scores = found[~same], scores[~same]


def _box(row: NDArray[np.float32]) -> tuple[float, float, float, float]:
    (x, y), (width, height) = row[0].tolist(), row[1].tolist()
    return x - width / 2, y - height / 2, width, height


def _in_picture(
    row: NDArray[np.float32], score: float, corner: NDArray[np.float32], scale: NDArray[np.float32]
) -> Detection:
    """The face in pixels of the picture, which lies at `corner` of the input and is larger by `scale`."""
    x, y, width, height = _box(row)
    left, top = ((np.array([x, y], np.float32) - corner) * scale).tolist()
    size = (np.array([width, height], np.float32) * scale).tolist()
    eyes = (row[2:4] - corner) * scale
    return Detection((left, top, size[0], size[1]), eyes.astype(np.float32), score)


def _tiles(image: DisplayImage) -> Iterator[tuple[int, int, DisplayImage]]:
    """Overlapping squares of the picture: left, top and pixels of each."""
    height, width = image.shape[:2]
    side, step = (max(round(share * max(width, height)), 1) for share in (_TILE, _TILE_STEP))
    for top in range(0, max(height - side, 0) + step, step):
        for left in range(0, max(width - side, 0) + step, step):
            y, x = min(top, max(height - side, 0)), min(left, max(width - side, 0))
            yield x, y, image[y : y + side, x : x + side]
