"""The converted public networks against another converter's result, in values and in time."""

from __future__ import annotations

import time
import zipfile
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from relit_camera.base.images.image_files import read_display
from relit_camera.base.models.model_manifest import public_manifest
from relit_camera.base.models.session_with_fallback import Session, SessionOptions, open_session
from relit_camera.base.models.tflite.tflite_converter import convert_tflite_to_onnx

REFERENCES = {
    "face_mesh": ("face_landmarks_478.onnx", {"landmarks": 1e-2, "presence_logit": 1e-3, "aux": 1e-4}),
    "face_blendshapes": ("face_blendshapes_52.onnx", {"scores": 1e-4}),
    "face_detector_short_range": ("face_detector_short_range.onnx", {"regressors": 1e-2, "classificators": 1e-3}),
    "selfie_landscape": ("selfie_segmentation_144x256.onnx", {"mask": 1e-3}),
    "selfie_square": ("selfie_segmentation_256x256.onnx", {"mask": 1e-3}),
}
"""Another converter's result (tf2onnx) and the tolerance of each output; landmarks are in pixels of 256."""


def both(name: str, folder: Path) -> tuple[Session, Session]:
    """Our conversion of a public model and the reference, on one thread."""
    model = public_manifest().models[name]
    assert model.download is not None
    source = folder / model.download
    if model.member:
        with zipfile.ZipFile(source) as archive:
            data = archive.read(model.member.name)
    else:
        data = source.read_bytes()
    assert model.convert is not None
    options = SessionOptions("cpu", threads=1)
    ours = open_session(convert_tflite_to_onnx(data, name, model.convert.inputs, model.convert.outputs), name, options)
    return ours, open_session(folder / REFERENCES[name][0], f"{name} reference", options)


def portrait(folder: Path, height: int, width: int) -> NDArray[np.float32]:
    """A person's head and shoulders, RGB 0..1, stretched to (1, height, width, 3)."""
    picture = read_display(folder / "portraits" / "astronaut.png")[:300, 80:380]
    return cv2.resize(picture.astype(np.float32) / 255, (width, height))[None]


@pytest.mark.parametrize("name", REFERENCES)
def test_a_public_network_computes_what_another_conversion_does(name: str, shared: Path) -> None:
    ours, reference = both(name, shared / "models")
    assert (ours.inputs, ours.outputs) == (reference.inputs, reference.outputs)
    if name == "face_blendshapes":
        feed = {"points": np.random.default_rng(0).normal(240, 60, (1, 146, 2)).astype(np.float32)}
    else:
        _, height, width, _ = ours.inputs["image"].shape
        assert height is not None
        assert width is not None
        feed = {"image": portrait(shared, height, width)}
    found, expected = ours.run(feed), reference.run(feed)
    for output, tolerance in REFERENCES[name][1].items():
        if expected[output].size > 1:
            assert np.ptp(expected[output]) > 0.1  # it has seen something
        np.testing.assert_allclose(found[output], expected[output], rtol=0, atol=tolerance)


@pytest.mark.slow
def test_our_mesh_is_as_fast_as_the_other(shared: Path) -> None:
    sessions = both("face_mesh", shared / "models")
    feed = {"image": np.random.default_rng(0).random((1, 256, 256, 3), np.float32)}
    times: tuple[list[float], list[float]] = ([], [])
    for _ in range(40):  # in turn, so that other work on the machine meets both
        for session, spent in zip(sessions, times, strict=True):
            start = time.perf_counter()
            session.run(feed)
            spent.append(time.perf_counter() - start)
    assert np.median(times[0]) <= 1.2 * np.median(times[1])
