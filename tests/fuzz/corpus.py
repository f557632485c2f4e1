"""What mutations begin with: small sound files of every kind, and the finds that are small."""

from __future__ import annotations

import functools
import json
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.config.look import Lamp, Lighting, Look, Preset
from relit_camera.base.config.preset_store import preset_text
from relit_camera.subject.compression.webp_packing import pack_subject
from relit_camera.subject.subject_file import write_subject
from tests import bad_pictures as bad
from tests.fuzz.lying_files import (
    FINDS,
    exr_of_channels,
    gif_of_size,
    sound_matte,
    sound_video,
    subject,
    subject_with_still,
    webp_of_side,
)

MAX_BYTES = 1 << 16
"""Larger finds are not changed: each change would take as long as they do."""


@functools.cache
def corpus() -> dict[str, tuple[tuple[str, bytes], ...]]:
    """Kind of file → suffixes and contents."""
    noise = np.random.default_rng(0).integers(0, 255, (16, 32, 3), np.uint8)

    def coded(suffix: str, picture: NDArray[Any], *options: int) -> bytes:
        return bytes(cv2.imencode(suffix, picture, options)[1])

    pictures = [(suffix, coded(suffix, noise)) for suffix in (".png", ".jpg", ".webp", ".bmp", ".tif")]
    deep, fractions = noise.astype(np.uint16) * 257, noise.astype(np.float32) / 255
    pictures += [
        (".png", coded(".png", deep)),
        (".png", coded(".png", np.dstack([noise, noise[..., 0]]))),
        (".png", coded(".png", noise[..., 0])),
        (".tif", coded(".tif", deep)),
        (".tif", coded(".tif", fractions)),
        (".jpg", coded(".jpg", noise, cv2.IMWRITE_JPEG_PROGRESSIVE, 1)),
        (".webp", coded(".webp", noise, cv2.IMWRITE_WEBP_QUALITY, 101)),
        (".webp", bad.animated_webp(3)),
        (".png", bad.png_of_size(64, 32)),
        (".webp", bad.webp_of_size(64, 32)),
        (".bmp", bad.bmp_of_size(64, 32)),
        (".tif", bad.tiff_of_size(64, 32)),
    ]
    hdr = coded(".hdr", fractions)
    found = {
        "picture": pictures,
        "panorama": [each for each in pictures if each[0] in (".png", ".jpg")],
        "hdr": [(".hdr", hdr), (".hdr", bad.hdr_of_size(64, 32))],
        "exr": [
            (".exr", bad.exr()),
            (".exr", bad.exr(64, 32, 5)),
            (".exr", exr_of_channels({"R": (1, 1), "G": (1, 1), "B": (1, 1)})),
            (".exr", exr_of_channels({"Y": (1, 1)})),
        ],
        "subject": [
            (".relit", subject()),
            (".relit", _packed_subject()),
            (".relit", subject_with_still(webp_of_side(24))),
            (".relit", subject_with_still(webp_of_side(641))),
            (".relit", subject_with_still(coded(".tif", noise))),
            (".relit", subject_with_still(webp_of_side(24), (8.0, 1e7))),
        ],
        "matte": [(".npz", sound_matte())],
        "video": [(suffix, sound_video(suffix)) for suffix in (".mp4", ".mkv", ".avi", ".mov")]
        + [(".gif", bad.gif()), (".gif", gif_of_size(64, 32, 2))],
        "yaml": [(".yaml", text.encode()) for text in _settings()],
        "track": [(".json", _track())],
        "lights": [(".lp", b"4\na.png 0 0 1\nb.png 0 1 0\nc.png 1 0 0\nd.png 0.6 0.8 0\n")],
        "landmarks": [(".json", json.dumps({"openseeface66": [[1.5, 2.5]] * 66}).encode())],
    }
    for find in FINDS.values():
        if not find.is_large and len(data := find.make()) <= MAX_BYTES:
            found[find.kind].append((find.suffix, data))
    return {kind: tuple(files) for kind, files in found.items()}


def _packed_subject() -> bytes:
    from tests.generated_subject import small_subject

    with TemporaryDirectory() as folder:
        path = Path(folder) / "a.relit"
        write_subject(path, pack_subject(small_subject(), 4), small=True)
        return path.read_bytes()


def _settings() -> list[str]:
    look = Look(lighting=Lighting(lamps=(Lamp(kelvin=3000, name="key"), Lamp(color=(1, 0.5, 0.2)))))
    return [
        preset_text(Preset(**dict(look), subject="me")),
        "output:\n  width: 640\n  fps: 29.97\nsubject: 'me'\nlook:\n  lighting: {yaw_deg: 3, lamps: [{kelvin: 3000}]}\n"
        "server:\n  names: [a, b]  # names\nlog_level: info\n",
    ]


def _track() -> bytes:
    frame = {
        "time_s": 0.0, "found": True, "status": "found", "confidence": 0.9,
        "pose": {"yaw": 1.0, "pitch": 2.0, "roll": 3.0}, "translation": [0.0, 0.0, -40.0],
        "landmarks": [[float(index), 2.5] for index in range(66)], "eyes": [1.0, 1.0], "mouth": 0.2,
    }  # fmt: skip
    track = {
        "version": 1, "tracker": "openseeface", "scheme": "openseeface66", "size": [64, 48], "fps": 30.0,
        "focal_px": 60.0, "frames": [frame, {"time_s": 0.04, "found": False, "status": "lost"}],
    }  # fmt: skip
    return json.dumps(track).encode()
