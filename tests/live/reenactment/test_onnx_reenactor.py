"""Reenactor `onnx`: the user's network is checked, and its flow or picture is used."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import ArrayLike
from onnx import TensorProto, helper, numpy_helper

from relit_camera.base.errors import ModelError
from relit_camera.base.images.color import srgb_decode, srgb_encode
from relit_camera.base.models.session_with_fallback import SessionOptions
from relit_camera.base.rotations import rotation_from_angles
from relit_camera.face.face_state import FaceStatus
from relit_camera.face.head_pose import project
from relit_camera.face.landmarks.rotated_crop import Crop
from relit_camera.live.reenactment.control_points import NECK_PIVOT
from relit_camera.live.reenactment.motion_transfer import rotate_about
from relit_camera.live.reenactment.onnx_network.driving_head_crop import crop_square, head_crop, tracked_head_crop
from relit_camera.live.reenactment.onnx_network.onnx_contract import ReenactorNetwork, identity_grid
from relit_camera.live.reenactment.reenactor import Reenactor, ReenactorContext, WarpedLayer, open_reenactor
from relit_camera.live.reenactment.source_image import Cutout
from relit_camera.live.reenactment.warp import Warp, source_from_output
from relit_camera.subject.subject import Subject
from tests.live.people import (
    LIVE_NEUTRAL,
    LIVE_SIZE,
    NOBODY,
    SCHEME,
    close_up,
    context_of,
    face_of,
    live_frame,
    motion,
    moved_by,
    person,
    premultiplied,
)

SIDE = 64
SIZE = (192, 256)
Node = tuple[str, list[str], str, dict[str, Any]]
"""An ONNX operator: its type, inputs, output and attributes."""
INPUTS = ("source", "driving", "driving_initial")
RED = np.broadcast_to(np.array([255, 0, 0], np.uint8), (LIVE_SIZE[1], LIVE_SIZE[0], 3))


def save(
    path: Path,
    nodes,
    outputs,
    constants=(),
    inputs=INPUTS[:2],
    shape=(1, 3, SIDE, SIDE),
    element: int = TensorProto.FLOAT,
):
    """Write a network; `outputs` are names, `constants` arrays by name."""
    values = [numpy_helper.from_array(np.asarray(array), name) for name, array in (constants or {}).items()]
    graph = helper.make_graph(
        [helper.make_node(op, list(takes), [gives], **more) for op, takes, gives, more in nodes],
        "tiny",
        [helper.make_tensor_value_info(name, element, list(shape)) for name in inputs],
        [helper.make_tensor_value_info(name, element, None) for name in outputs],
        values,
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    path.write_bytes(model.SerializeToString())
    return path


def reads_inputs(inputs: Sequence[str] = INPUTS[:2]) -> list[Node]:
    """Nodes that give `zero`, a scalar 0 that hangs on every input, so that none is dropped."""
    nodes: list[Node] = [("ReduceMean", [name], f"mean_{name}", {"keepdims": 0}) for name in inputs]
    nodes.append(("Sum", [f"mean_{name}" for name in inputs], "means", {}))
    return [*nodes, ("Sub", ["means", "means"], "zero", {})]


def flow_network(
    path: Path,
    shift: tuple[float, float] = (0.0, 0.0),
    size: int = 9,
    inputs=INPUTS[:2],
    shape=(1, 3, SIDE, SIDE),
    grid=None,
):
    """The unmoved grid, shifted by `shift` times the mean red by which the driving picture differs from its initial."""
    grid = identity_grid(size, size)[None] if grid is None else grid
    nodes: list[Node] = [
        *reads_inputs(inputs),
        ("Sub", ["driving", inputs[-1]], "change", {}),
        ("Gather", ["change", "red"], "red_change", {"axis": 1}),
        ("ReduceMean", ["red_change"], "amount", {"keepdims": 0}),
        ("Mul", ["shift", "amount"], "moved", {}),
        ("Add", ["grid", "moved"], "at", {}),
        ("Add", ["at", "zero"], "flow", {}),
    ]
    constants = {"grid": grid.astype(np.float32), "shift": np.array(shift, np.float32), "red": np.array([0], np.int64)}
    return save(path, nodes, ["flow"], constants, inputs, shape)


def mix_network(path: Path, share: float = 0.5, alpha: float | None = None, scale: float = 1.0) -> Path:
    """Source and driving mixed; with a constant alpha if given."""
    nodes: list[Node] = [
        ("Mul", ["source", "keep"], "a", {}),
        ("Mul", ["driving", "take"], "b", {}),
        ("Add", ["a", "b"], "mixed", {}),
        ("Mul", ["mixed", "scale"], "prediction", {}),
    ]
    constants: dict[str, ArrayLike] = {
        "keep": np.float32(1 - share),
        "take": np.float32(share),
        "scale": np.float32(scale),
    }
    if alpha is None:
        return save(path, nodes, ["prediction"], constants)
    constants["wanted"] = np.full((1, 1, SIDE, SIDE), alpha, np.float32)
    nodes += [*reads_inputs(), ("Add", ["wanted", "zero"], "alpha", {})]
    return save(path, nodes, ["prediction", "alpha"], constants)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "tiny.onnx"


def opened(context: ReenactorContext, network: Path) -> Reenactor:
    """The reenactor of a network, as settings name it."""
    return open_reenactor(f"onnx:{network}", context)


def texture(subject: Subject) -> np.ndarray:
    """A smooth coloured picture of the subject's size, linear."""
    height, width = subject.matte.shape
    x, y = np.meshgrid(np.linspace(0, 6, width), np.linspace(0, 8, height))
    return np.stack([0.4 + 0.3 * np.sin(x), 0.4 + 0.3 * np.cos(y), 0.4 + 0.2 * np.sin(x + y)], 2).astype(np.float32)


def unmoved(subject: Subject, relit: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The still as it stands in the output when nothing moves, through a network that is never asked."""
    person_alone = Cutout(subject)
    warp = Warp(source_from_output(subject.size, SIZE), ())
    return premultiplied(WarpedLayer(person_alone.warped(person_alone.image(relit), warp.grid((0, 0, *SIZE))), (0, 0)))


def test_a_flow_that_moves_nothing_gives_the_still(path: Path) -> None:
    subject = person()
    relit = texture(subject)
    reenactor = opened(context_of(subject, SIZE), flow_network(path))
    moved = moved_by(reenactor, relit, motion(), live_frame())
    picture, alpha = unmoved(subject, relit)
    assert moved.at == (0, 0)
    np.testing.assert_allclose(premultiplied(moved)[0], picture, atol=2e-4)
    np.testing.assert_allclose(premultiplied(moved)[1], alpha, atol=2e-4)


@pytest.mark.parametrize("shift", [(0.2, 0.0), (0.0, -0.15), (0.1, 0.1)])
def test_a_shift_of_the_flow_is_that_share_of_the_crop(path: Path, shift: tuple[float, float]) -> None:
    """A flow of +s looks s half crop sides further right or down, so what is seen moves left or up by as much."""
    subject = person()
    context = context_of(subject, SIZE)
    reenactor = opened(context, flow_network(path, shift, inputs=INPUTS))
    relit = texture(subject)
    moved_by(reenactor, relit, motion(), live_frame(np.zeros_like(RED)))  # neutral: the driving face is black
    view = moved_by(reenactor, relit, motion(), live_frame(RED, 1))
    crop = head_crop(context.face.pose, context.face.size)
    pixels = np.array(shift) * crop.width / 2 * (1 - 1 / SIDE) * SIZE[0] / subject.size[0]
    picture, _ = unmoved(subject, relit)
    expected = cv2.warpAffine(picture, np.array([[1, 0, -pixels[0]], [0, 1, -pixels[1]]], np.float64), SIZE)
    middle = np.s_[100:150, 80:112]
    assert np.abs(pixels).max() > 4
    np.testing.assert_allclose(premultiplied(view)[0][middle], expected[middle], atol=3e-3)


def test_a_flow_is_eased_by_presence(path: Path) -> None:
    context = context_of(person(), SIZE)
    relit = texture(context.subject)
    reenactor = opened(context, flow_network(path, (0.2, 0.0), inputs=INPUTS))
    half = opened(context, flow_network(path, (0.1, 0.0), inputs=INPUTS))
    for one in (reenactor, half):
        moved_by(one, relit, motion(), live_frame(np.zeros_like(RED)))
    eased = premultiplied(moved_by(reenactor, relit, motion(presence=0.5), live_frame(RED, 1)))[0]
    expected, _ = premultiplied(moved_by(half, relit, motion(), live_frame(RED, 1)))
    np.testing.assert_allclose(eased, expected, atol=0.02)


def test_a_lost_face_is_driven_by_what_was_seen_last_and_then_rests(path: Path) -> None:
    context = context_of(person(), SIZE)
    relit = texture(context.subject)
    reenactor = opened(context, flow_network(path, (0.2, 0.0), inputs=INPUTS))
    moved_by(reenactor, relit, motion(), live_frame(np.zeros_like(RED)))
    seen = premultiplied(moved_by(reenactor, relit, motion(), live_frame(RED, 1)))[0]
    noise = live_frame(index=2)
    lost = premultiplied(moved_by(reenactor, relit, motion(status=FaceStatus.LOST), noise))[0]
    np.testing.assert_array_equal(lost, seen)
    gone = premultiplied(moved_by(reenactor, relit, motion(status=FaceStatus.LOST, presence=0.0), noise))[0]
    np.testing.assert_allclose(gone, unmoved(context.subject, relit)[0], atol=1e-4)


def test_before_the_first_face_the_still_stands_unmoved(path: Path) -> None:
    context = context_of(person(), SIZE)
    relit = texture(context.subject)
    picture = premultiplied(moved_by(opened(context, mix_network(path, 1.0)), relit, NOBODY, live_frame()))[0]
    np.testing.assert_allclose(picture, unmoved(context.subject, relit)[0], atol=1e-4)


def test_a_picture_is_laid_over_the_still_in_its_place(path: Path) -> None:
    """Half source, half red: sRGB code values are mixed, inside the crop, within the still's matte."""
    context = context_of(person(), SIZE)
    relit = texture(context.subject)
    moved = moved_by(opened(context, mix_network(path)), relit, motion(), live_frame(RED))
    picture, alpha = unmoved(context.subject, relit)
    middle = np.s_[110:150, 80:112]
    expected = srgb_decode((srgb_encode(picture[middle]) + [1, 0, 0]) / 2)
    assert alpha[middle].min() == 1
    np.testing.assert_allclose(premultiplied(moved)[0][middle], expected, atol=0.02)
    np.testing.assert_allclose(premultiplied(moved)[1], alpha, atol=1e-5)
    outside = np.s_[-6:, 60:130]  # under the crop the still goes on
    np.testing.assert_allclose(premultiplied(moved)[0][outside], picture[outside], atol=1e-4)


def test_an_alpha_of_its_own_cuts_the_picture_out(path: Path) -> None:
    context = context_of(person(), SIZE)
    moved = moved_by(
        opened(context, mix_network(path, 1.0, alpha=0.25)), texture(context.subject), motion(), live_frame(RED)
    )
    middle = np.s_[110:150, 80:112]
    np.testing.assert_array_equal(moved.image[middle], np.broadcast_to([255, 0, 0, 64], (40, 32, 4)))


def test_the_body_follows_the_neck_and_never_hovers(path: Path) -> None:
    context = context_of(person(), SIZE)
    reenactor = opened(context, flow_network(path))
    relit = np.ones((*context.subject.matte.shape, 3), np.float32)
    rest = premultiplied(moved_by(reenactor, relit, motion(), live_frame()))[1]
    right = moved_by(reenactor, relit, motion(shift=(4, 0, 0)), live_frame())
    up = moved_by(reenactor, relit, motion(shift=(0, 6, 0)), live_frame())

    def column(alpha: np.ndarray, at: tuple[int, int] = (0, 0)) -> float:
        return float(at[0] + (alpha[-20:].sum(axis=0) * np.arange(alpha.shape[1])).sum() / alpha[-20:].sum())

    assert column(premultiplied(right)[1], right.at) > column(rest) + 8
    assert up.at[1] + premultiplied(up)[1].shape[0] == SIZE[1]
    assert premultiplied(up)[1][-1].max() > 0.9


def test_a_face_cut_off_by_its_border_stays_there(path: Path) -> None:
    context = context_of(close_up(), SIZE)
    relit = texture(context.subject)
    reenactor = opened(context, flow_network(path, (0.1, 0.0), 64, INPUTS))
    moved_by(reenactor, relit, motion(), live_frame(np.zeros_like(RED)))
    moved = moved_by(reenactor, relit, motion(shift=(5, 0, 0)), live_frame(RED, 1))
    rest, alpha = unmoved(context.subject, relit)
    assert moved.at == (0, 0)
    assert premultiplied(moved)[0].shape == rest.shape
    # Unheld, the left edge, which fades out, would show what lies nine pixels further in, where nothing fades.
    assert np.abs(premultiplied(moved)[1] - alpha)[:, :2].max() < 0.2
    assert np.abs(premultiplied(moved)[0] - rest)[100:150, 80:112].max() > 0.02


def test_crops_show_the_same_part_of_any_head() -> None:
    """Two cameras, distances and places: a point of the head lies in the same place of both crops."""
    face = face_of(person())
    places = []
    for pose, size in ((face.pose, face.size), (LIVE_NEUTRAL, LIVE_SIZE)):
        crop = head_crop(pose, size)
        points = project(SCHEME.canonical.copy(), pose, size)
        places.append((points - crop.center) / crop.width)
    assert np.abs(places[0] - places[1]).max() < 0.06  # perspective and four degrees of yaw differ
    assert 0.3 < np.abs(places[0]).max() < 0.4


def test_a_crop_goes_along_with_a_shift_and_stays_for_a_turn() -> None:
    shifted = motion(shift=(5, 2, -10)).pose
    turned = motion(rotation_from_angles(20)).pose
    assert shifted is not None
    assert turned is not None
    crop = head_crop(LIVE_NEUTRAL, LIVE_SIZE)
    along = tracked_head_crop(LIVE_NEUTRAL, shifted, LIVE_SIZE)
    exact = head_crop(shifted, LIVE_SIZE)
    assert along.center == pytest.approx(exact.center, abs=2.0)  # of 170; neck and face differ in depth
    assert along.width == pytest.approx(exact.width, rel=0.03)
    assert tracked_head_crop(LIVE_NEUTRAL, LIVE_NEUTRAL, LIVE_SIZE) == crop
    neck = motion(rotation_from_angles(20), shift=_neck_turn(20)).pose
    assert neck is not None
    assert tracked_head_crop(LIVE_NEUTRAL, neck, LIVE_SIZE).center == pytest.approx(crop.center, abs=0.05)
    assert tracked_head_crop(LIVE_NEUTRAL, turned, LIVE_SIZE).center != pytest.approx(crop.center, abs=2)


def _neck_turn(yaw_deg: float) -> np.ndarray:
    """Centimetres by which the head's origin moves when it turns on the neck."""
    turn = rotation_from_angles(yaw_deg)
    return rotate_about(NECK_PIVOT, LIVE_NEUTRAL, turn).translation - LIVE_NEUTRAL.translation


def test_a_large_head_is_shrunk_without_aliasing() -> None:
    stripes = np.zeros((600, 800, 3), np.uint8)
    stripes[:, ::2] = 255
    cut = crop_square(stripes, Crop((400, 300), 512, 512), 64)
    assert cut.shape == (64, 64, 3)
    assert np.abs(cut.astype(int) - 127).max() <= 2


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda p: flow_network(p, shape=(1, 1, SIDE, SIDE)), r"input 'source' is float32 \[1, 1, 64, 64\]; expected"),
        (lambda p: flow_network(p, shape=(1, 3, SIDE, 48)), r"float32 \[1, 3, 64, 48\]; expected float32 \[1, 3, side"),
        (lambda p: flow_network(p, shape=(3, SIDE, SIDE), size=2), r"is float32 \[3, 64, 64\]; expected"),
        (lambda p: flow_network(p, grid=np.zeros((1, 9, 9, 2))), r"values .* 0\.[78].* not displacements or pixels"),
        (lambda p: flow_network(p, grid=identity_grid(9, 9)[None] * 32 + 32), "not displacements or pixels"),
        (lambda p: flow_network(p, grid=np.full((1, 9, 9, 2), np.nan)), "162 values of 162 that are no numbers"),
        (lambda p: flow_network(p, grid=np.zeros((1, 2, 9, 9, 1))), "output 'flow' has shape .* expected .1, rows"),
        (lambda p: mix_network(p, scale=255.0), r"'prediction' has values .*; expected 0..1"),
        (lambda p: mix_network(p, scale=np.inf), "that are no numbers"),
        (lambda p: mix_network(p, alpha=2.0), r"'alpha' has values 2.00..2.00; expected 0..1"),
    ],
)
def test_a_network_that_breaks_the_contract_is_refused_in_one_line(
    path: Path, build: Callable[[Path], Path], message: str
) -> None:
    with pytest.raises(ModelError, match=message) as error:
        opened(context_of(person(), SIZE), build(path))
    assert str(error.value).startswith("reenactor tiny.onnx: ")
    assert "docs/reenactors.md" in error.value.cure
    assert "\n" not in str(error.value)


def test_wrong_names_are_named(path: Path) -> None:
    nodes: list[Node] = [("Add", ["image", "driving"], "prediction", {})]
    with pytest.raises(ModelError, match="its inputs are image, driving; expected are source, driving and perhaps"):
        ReenactorNetwork(save(path, nodes, ["prediction"], inputs=("image", "driving")), SessionOptions())
    nodes = [*reads_inputs((*INPUTS, "kp")), ("Add", ["source", "zero"], "prediction", {})]
    with pytest.raises(ModelError, match="its inputs are source, driving, driving_initial, kp; expected"):
        ReenactorNetwork(save(path, nodes, ["prediction"], inputs=(*INPUTS, "kp")), SessionOptions())
    nodes = [("Add", ["source", "driving"], "out", {})]
    with pytest.raises(ModelError, match="its outputs are out; one must be 'flow' or 'prediction'"):
        ReenactorNetwork(save(path, nodes, ["out"]), SessionOptions())


@pytest.mark.parametrize("element", [TensorProto.FLOAT16, TensorProto.DOUBLE])
def test_another_type_is_named(path: Path, element: int) -> None:
    nodes: list[Node] = [("Add", ["source", "driving"], "prediction", {})]
    with pytest.raises(ModelError, match=r"input 'source' is float(16|64) \[1, 3, 64, 64\]; expected float32"):
        ReenactorNetwork(save(path, nodes, ["prediction"], element=element), SessionOptions())


def test_no_network_and_a_damaged_one_are_named(path: Path) -> None:
    with pytest.raises(ModelError, match="does not exist"):
        ReenactorNetwork(path, SessionOptions())
    path.write_bytes(b"half of it")
    with pytest.raises(ModelError, match="is no ONNX model"):
        ReenactorNetwork(path, SessionOptions())


def test_open_sizes_are_fed_with_256(path: Path) -> None:
    network = ReenactorNetwork(flow_network(path, shape=("n", 3, "h", "w")), SessionOptions())
    assert network.side == 256
    assert not network.relative
    network.check_at_rest(np.full((256, 256, 3), 90, np.uint8))


def test_inputs_of_two_sizes_are_refused(path: Path) -> None:
    graph = helper.make_graph(
        [helper.make_node("Add", ["driving", "driving"], ["prediction"])],
        "tiny",
        [
            helper.make_tensor_value_info("source", TensorProto.FLOAT, [1, 3, 32, 32]),
            helper.make_tensor_value_info("driving", TensorProto.FLOAT, [1, 3, 64, 64]),
        ],
        [helper.make_tensor_value_info("prediction", TensorProto.FLOAT, None)],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    path.write_bytes(model.SerializeToString())
    with pytest.raises(ModelError, match="its inputs have the sides 32, 64; expected is one"):
        ReenactorNetwork(path, SessionOptions())
