from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper

from relit_camera.base.errors import ModelError
from relit_camera.base.images.image_types import Frame
from relit_camera.base.models.session_with_fallback import SessionOptions
from relit_camera.face.matting import (
    LANDSCAPE_MODEL,
    SQUARE_MODEL,
    TUNABLES,
    SelfieMatting,
    refine_edges,
    smooth_over_time,
)

SIZES = {LANDSCAPE_MODEL: (18, 32), SQUARE_MODEL: (32, 32)}


def network(folder: Path, name: str, channel: int, mask_name: str = "mask") -> Path:
    """A segmentation network whose mask is one channel of the picture."""
    height, width = SIZES[name]
    image = helper.make_tensor_value_info("image", TensorProto.FLOAT, [1, height, width, 3])
    mask = helper.make_tensor_value_info(mask_name, TensorProto.FLOAT, [1, height, width, 1])
    bounds = {"start": [channel], "end": [channel + 1], "axis": [3]}
    constants = [helper.make_tensor(key, TensorProto.INT64, [1], value) for key, value in bounds.items()]
    node = helper.make_node("Slice", ["image", "start", "end", "axis"], [mask_name])
    graph = helper.make_graph([node], name, [image], [mask], constants)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    onnx.save(model, folder / f"{name}.onnx")
    return folder / f"{name}.onnx"


@pytest.fixture
def find(tmp_path: Path) -> Callable[[str], Path]:
    """Networks that take red for the person in wide frames, green in square ones."""
    files = {LANDSCAPE_MODEL: network(tmp_path, LANDSCAPE_MODEL, 0), SQUARE_MODEL: network(tmp_path, SQUARE_MODEL, 1)}
    return files.__getitem__


@pytest.fixture(scope="session")
def real(shared: Path) -> Callable[[str], Path]:
    models = {LANDSCAPE_MODEL: "selfie_segmentation_144x256.onnx", SQUARE_MODEL: "selfie_segmentation_256x256.onnx"}
    return lambda name: shared / "models" / models[name]


def framed(image: np.ndarray, index: int = 0) -> Frame:
    return Frame(np.ascontiguousarray(image), index, 0.0, index / 30)


def clip(path: Path, count: int, every: int = 1) -> list[np.ndarray]:
    import av

    with av.open(str(path)) as container:
        frames = [
            frame.to_ndarray(format="rgb24") for frame, _ in zip(container.decode(video=0), range(count), strict=False)
        ]
    return frames[::every]


def disc(height: int, width: int, x: float, radius: float) -> np.ndarray:
    """Coverage of a disc, float32."""
    rows, columns = np.mgrid[:height, :width] + 0.5
    return np.clip(radius - np.hypot(columns - x, rows - height / 2) + 0.5, 0, 1).astype(np.float32)


@pytest.mark.parametrize("size", [(1280, 720), (640, 480), (480, 480), (405, 301), (300, 500), (128, 72)])
def test_the_matte_has_the_frames_size_and_finds_the_person(size: tuple[int, int], find: Callable[[str], Path]) -> None:
    width, height = size
    person = disc(height, width, width / 2, 0.3 * min(size))
    wide = width / height >= 4 / 3
    image = np.zeros((height, width, 3), np.uint8)
    image[..., 0 if wide else 1] = np.round(person * 255)
    alpha = SelfieMatting(find_model=find).matte(framed(image))
    assert alpha.shape == (height, width)
    assert alpha.dtype == np.uint8
    inside, found = person > 0.5, alpha > 127
    assert (inside & found).sum() / (inside | found).sum() > 0.9


def test_a_missing_model_is_said_at_once_with_its_cure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RELIT_MODELS_DIR", str(tmp_path))
    with pytest.raises(ModelError, match=r"selfie_landscape .*; run `relit models pull selfie_landscape`"):
        SelfieMatting()


def test_a_network_of_another_kind_is_refused(tmp_path: Path, find: Callable[[str], Path]) -> None:
    other = network(tmp_path, LANDSCAPE_MODEL, 0, mask_name="pose")
    matte = SelfieMatting(find_model=lambda name: other if name == LANDSCAPE_MODEL else find(name))
    with pytest.raises(ModelError, match=r"selfie_landscape takes .* not image \[1, h, w, 3\]"):
        matte.matte(framed(np.zeros((90, 160, 3), np.uint8)))


def test_edges_follow_the_picture_where_the_mask_is_coarse() -> None:
    """A disc before a darker ground, its mask known at a twentieth of the size: the guided edge is nearer to truth."""
    truth = disc(360, 640, 300, 110)
    image = np.round(60 + 140 * truth[..., None] + np.zeros(3)).astype(np.uint8)
    mask = cv2.resize(truth, (32, 18), interpolation=cv2.INTER_AREA)
    enlarged = cv2.resize(mask, (640, 360), interpolation=cv2.INTER_LINEAR)
    guided = refine_edges(mask, image, (640, 360)) / 255
    assert np.abs(guided - truth).mean() < 0.5 * np.abs(enlarged - truth).mean()


def test_where_the_picture_has_no_edge_the_mask_is_kept_but_for_its_doubtful_ends() -> None:
    ramp = np.repeat(np.linspace(0, 1, 64, dtype=np.float32)[None], 36, axis=0)
    alpha = refine_edges(ramp, np.full((360, 640, 3), 128, np.uint8), (640, 360))
    middle = alpha[180, ::80] / 255
    expected = np.clip((np.linspace(0, 1, 640)[::80] - 0.25) / 0.6, 0, 1)
    np.testing.assert_allclose(middle, expected, atol=0.03)


@pytest.mark.parametrize(("x", "radius"), [(300, 90), (20, 60), (620, 40), (320, 300)])
def test_alpha_near_the_person_is_that_of_a_guided_filter_of_the_whole_picture(x: int, radius: int) -> None:
    """The same within six codes, wherever the person is; and where there is nobody, nothing."""
    random = np.random.default_rng(4)
    truth = disc(360, 640, x, radius)
    image = np.clip(60 + 90 * truth[..., None] + random.normal(0, 12, (360, 640, 3)), 0, 255).astype(np.uint8)
    mask = 0.04 + 0.92 * cv2.resize(truth, (256, 144), interpolation=cv2.INTER_AREA)
    whole = cv2.ximgproc.guidedFilter(
        cv2.medianBlur(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), 3),
        cv2.resize(mask, (640, 360)),
        TUNABLES.guide_radius_px,
        TUNABLES.guide_epsilon * 255**2,
        scale=0.5,
    )
    expected = np.clip(np.rint(255 * (whole - 0.25) / 0.6), 0, 255)
    assert np.abs(refine_edges(mask, image, (640, 360)) - expected).max() <= 6
    assert not refine_edges(np.full_like(mask, 0.04), image, (1280, 720)).any()


def test_only_doubt_is_steadied() -> None:
    previous = np.array([[1, 0, 0.2, 0.9]], np.float32)
    mask = np.array([[0, 1, 0.5, 0.5]], np.float32)
    np.testing.assert_allclose(smooth_over_time(mask, previous), [[0, 1, 0.23, 0.86]], atol=1e-6)
    assert smooth_over_time(mask, None) is mask


def test_nothing_drags_behind_a_person_who_moves(find: Callable[[str], Path]) -> None:
    """The matte of a moving disc is that of the same frame seen first, but for one cell of the mask at its edge."""
    matte = SelfieMatting(find_model=find)
    for index, x in enumerate(range(48, 208, 32)):
        image = np.zeros((144, 256, 3), np.uint8)
        image[..., 0] = np.round(disc(144, 256, x, 32) * 255)
        followed = matte.matte(framed(image, index))
        fresh = SelfieMatting(find_model=find).matte(framed(image))
        assert cv2.absdiff(followed, fresh).mean() < 0.015 * 255
        assert followed[disc(144, 256, x, 48) == 0].max() < 0.05 * 255


def test_a_frame_of_another_size_starts_anew(find: Callable[[str], Path]) -> None:
    half = np.full((90, 160, 3), 128, np.uint8)
    matte = SelfieMatting(find_model=find)
    matte.matte(framed(np.full((180, 320, 3), 255, np.uint8)))
    again = matte.matte(framed(half))
    np.testing.assert_array_equal(again, SelfieMatting(find_model=find).matte(framed(half)))


def test_a_real_person_is_cut_out_as_the_green_screen_behind_him_says(
    shared: Path, real: Callable[[str], Path]
) -> None:
    matte = SelfieMatting(SessionOptions("cpu"), real)
    for image in clip(shared / "driving" / "liveportrait_d0.mp4", 60, every=20):
        red, green, blue = (image[:486, :, i].astype(int) for i in range(3))
        person = green < 1.3 * np.maximum(red, blue)
        person = cv2.morphologyEx(person.astype(np.uint8), cv2.MORPH_OPEN, np.ones((5, 5))) > 0
        found = matte.matte(framed(image))[:486] > 127
        assert (person & found).sum() / (person | found).sum() > 0.95


def test_a_still_head_is_cut_out_without_flicker(shared: Path, real: Callable[[str], Path]) -> None:
    """Against the same mattes without memory, at the edge."""
    steady, forgetful = (SelfieMatting(SessionOptions("cpu"), real) for _ in range(2))
    mattes: tuple[list[np.ndarray], list[np.ndarray]] = ([], [])
    for index, image in enumerate(clip(shared / "driving" / "liveportrait_d19.mp4", 24)):
        forgetful.reset()
        mattes[0].append(steady.matte(framed(image, index)))
        mattes[1].append(forgetful.matte(framed(image, index)))
    flicker = [np.median([cv2.absdiff(a, b).mean() for a, b in pairwise(m)]) for m in mattes]
    assert flicker[0] < 0.75 * flicker[1]
