"""Meshes and pictures that all people share, prepared once and cached: face model, registration, skin textures."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Float64Array, Indices
from relit_camera.base.images.image_files import read_display, write_display
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.base.storage.atomic_files import atomic_path, make_folder, write_atomic
from relit_studio.base.assets.store import asset, cache_folder
from relit_studio.people.face.face_model import FaceModel, read_face_model
from relit_studio.people.skin.head_scan import read_scan
from relit_studio.people.skin.scan_pictures import clean_pictures
from relit_studio.people.skin.scan_registration import register

_VERSION = 1
"""Version of the cached files; increased when their content changes."""


@dataclass(frozen=True, eq=False)
class PeopleAssets:
    """Face model, registration and skin textures.

    Attributes:
        model: the face model.
        uv: (vertices, 2) the scan's texture coordinate of each vertex, v up.
        body: (n, 3) the scan's surface in the model's axes; `body_triangles` (m, 3).
        folder: of the pictures stubble.png, clean.png and pores.png.
    """

    model: FaceModel
    uv: Float64Array
    body: Float64Array
    body_triangles: Indices
    folder: Path

    def albedo(self, shaved: bool) -> DisplayImage:
        """The cleaned photographed skin (1024, 1024, 3), sRGB."""
        return read_display(self.folder / ("stubble.png" if shaved else "clean.png"))


@lru_cache(maxsize=1)
def people_assets() -> PeopleAssets:
    """Load the shared files; prepare them first where they are missing (about a minute).

    Raises:
        NotFoundError: the raw files have not been fetched.
        StorageError: the cache cannot be written.
    """
    folder = cache_folder() / f"prepared-{_VERSION}"
    model = read_face_model(asset("ict_facekit_light.npz"))
    if not (folder / "registration.npz").is_file():
        _prepare(model, folder)
    with np.load(folder / "registration.npz") as data:
        return PeopleAssets(model, data["uv"], data["body"], data["body_triangles"], folder)


def _prepare(model: FaceModel, folder: Path) -> None:
    scan = read_scan(asset("lee_perry_smith/LeePerrySmith.glb"))
    pictures = clean_pictures(
        asset("lee_perry_smith/Map-COL.jpg"), asset("lee_perry_smith/Infinite-Level_02_Disp_NoSmoothUV-4096.jpg")
    )
    make_folder(folder)
    write_display(folder / "stubble.png", pictures.stubble)
    write_display(folder / "clean.png", pictures.clean)
    write_atomic(folder / "pores.png", _gray_png(pictures.pores))
    laid = register(model, scan)
    # Written last: its existence means that all files are complete.
    with atomic_path(folder / "registration.npz") as temporary:
        np.savez_compressed(temporary, uv=laid.uv, body=laid.body, body_triangles=scan.triangles)


def _gray_png(gray: NDArray[np.uint8]) -> bytes:
    return bytes(cv2.imencode(".png", gray)[1])
