"""Pictures for reports: heat maps, light maps, sampled directions."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.color import uint8_from_linear
from relit_camera.base.images.contact_sheet import contact_sheet
from relit_camera.base.images.image_types import DisplayImage, LinearImage
from relit_camera.capture.reflectance.delaunay_triangulation import spherical_delaunay
from relit_camera.lab.evaluate.field.ground_truth import GroundTruth, sampled_region
from relit_camera.lab.evaluate.field.sample_points import SamplePoint
from relit_camera.light.directions import MAP_HEIGHT, MAP_WIDTH, map_position_from_direction, texel_directions

MAP_ZOOM = 10
_GAP = 4
"""Pixels between the rows of a grid."""
_OUTSIDE, _REGION, _EDGE = (46, 46, 52), (86, 92, 104), (140, 150, 166)
_LIGHT, _RING = (90, 230, 120), (255, 210, 70)
_FONT, _TEXT_SCALE = cv2.FONT_HERSHEY_SIMPLEX, 0.45
_MARKER_COLORS = ((230, 60, 60), (60, 140, 255), (250, 180, 30), (60, 200, 90), (220, 90, 220))
"""Colours of the marked spots, in their order."""


def heat_map_picture(values: NDArray[np.floating], top: float) -> DisplayImage:
    """Values (height, width) as colours: 0 black, over red, `top` and above pale yellow; NaN is grey."""
    known = np.isfinite(values)
    levels = np.clip(np.nan_to_num(values) / (top if top > 0 else 1.0), 0, 1)
    coloured = cv2.cvtColor(
        cv2.applyColorMap(np.round(levels * 255).astype(np.uint8), cv2.COLORMAP_INFERNO), cv2.COLOR_BGR2RGB
    )
    coloured[~known] = _REGION
    return np.asarray(coloured, np.uint8)


def values_on_light_map(truth: GroundTruth, values: NDArray[np.floating]) -> NDArray[np.float64]:
    """Values (lights, ...) of the truth's lights on the light map (32, 64, ...); NaN where it has no lights."""
    chosen = np.asarray(values[np.maximum(truth.light_of_texel, 0)], np.float64)
    chosen[truth.light_of_texel < 0] = np.nan
    return chosen.reshape(MAP_HEIGHT, MAP_WIDTH, *values.shape[1:])


def reflectance_picture(values: NDArray[np.floating], peak: float) -> DisplayImage:
    """A reflectance map (32, 64, 3) of linear colours, `peak` as white; NaN is grey."""
    shown = uint8_from_linear(np.asarray(values / (peak if peak > 0 else 1.0), np.float32))
    shown[np.isnan(values).any(axis=2)] = _REGION
    return shown


def directions_picture(captured: NDArray[np.float64], ring: NDArray[np.float64]) -> DisplayImage:
    """The light map with the sampled region, its triangles, captured lights and added black ones: (320, 640, 3)."""
    height, width = MAP_HEIGHT * MAP_ZOOM, MAP_WIDTH * MAP_ZOOM
    inside = sampled_region(captured, texel_directions(height // 2, width // 2).reshape(-1, 3))
    mask = np.repeat(np.repeat(inside.reshape(height // 2, width // 2), 2, axis=0), 2, axis=1)
    image = np.full((height, width, 3), _OUTSIDE, np.uint8)
    image[mask] = _REGION
    for triangle in spherical_delaunay(captured):
        for a, b in ((0, 1), (1, 2), (2, 0)):
            _draw_arc(image, captured[triangle[a]], captured[triangle[b]])
    for directions, colour in ((ring, _RING), (captured, _LIGHT)):
        for x, y in _map_pixels(directions, image):
            cv2.circle(image, (int(x), int(y)), 3, colour, -1, cv2.LINE_AA)
    return image


def marked_picture(picture: LinearImage, spots: Sequence[SamplePoint]) -> DisplayImage:
    """The person, brightest parts as white, with each spot ringed in its colour; at least 480 pixels high."""
    zoom = max(1, -(-480 // picture.shape[0]))
    peak = float(np.percentile(picture, 99)) or 1.0
    shown = uint8_from_linear(picture / np.float32(peak))
    image = cv2.resize(shown, None, fx=zoom, fy=zoom, interpolation=cv2.INTER_CUBIC)
    for index, spot in enumerate(spots):
        centre = (round((spot.x + 0.5) * zoom), round((spot.y + 0.5) * zoom))
        colour = _MARKER_COLORS[index % len(_MARKER_COLORS)]
        cv2.circle(image, centre, 5, colour, 2, cv2.LINE_AA)
        place = (centre[0] + 8, centre[1] + 4)
        size = cv2.getTextSize(spot.name, _FONT, _TEXT_SCALE, 1)[0]
        cv2.rectangle(
            image, (place[0] - 3, place[1] - size[1] - 4), (place[0] + size[0] + 3, place[1] + 5), _OUTSIDE, -1
        )
        cv2.putText(image, spot.name, place, _FONT, _TEXT_SCALE, colour, 1, cv2.LINE_AA)
    return np.asarray(image, np.uint8)


def labeled_grid(pictures: Sequence[DisplayImage], names: Sequence[str], columns: int, cell_width: int) -> DisplayImage:
    """Pictures of one shape in rows of `columns`, each with its name above."""
    sheets = [
        contact_sheet([pictures[start : start + columns]], (), names[start : start + columns], cell_width)
        for start in range(0, len(pictures), columns)
    ]
    width = max(sheet.shape[1] for sheet in sheets)
    paper = sheets[0][0, 0].tolist()
    return np.concatenate(
        [
            cv2.copyMakeBorder(sheet, 0, _GAP, 0, width - sheet.shape[1], cv2.BORDER_CONSTANT, value=paper)
            for sheet in sheets
        ]
    )


def with_scan_line(image: DisplayImage, row: int) -> DisplayImage:
    """A copy with a thin line over pixel row `row`."""
    marked = image.copy()
    marked[row, ::2] = (255, 220, 0)
    return marked


def _map_pixels(directions: NDArray[np.float64], image: DisplayImage) -> NDArray[np.float64]:
    row, column = map_position_from_direction(directions, *image.shape[:2])
    return np.asarray(np.round(np.stack([column, row], axis=-1)).reshape(-1, 2), np.float64)


def _draw_arc(image: DisplayImage, start: NDArray[np.float64], end: NDArray[np.float64]) -> None:
    """The shortest way on the sphere, in pieces; nothing where it crosses the map's seam."""
    shares = np.linspace(0, 1, 9)[:, None]
    way = start * (1 - shares) + end * shares
    places = _map_pixels(way, image)
    for one, other in pairwise(places):
        if abs(one[0] - other[0]) < image.shape[1] / 2:
            cv2.line(image, tuple(map(int, one)), tuple(map(int, other)), _EDGE, 1, cv2.LINE_AA)
