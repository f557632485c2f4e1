"""Weights of expression stills: none at rest, the right one in an expression, and never a jump."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.base.rotations import Rotation, rotation_from_angles
from relit_camera.live.reenactment.stills.still_weights import SMOOTHING_S, Doing, StillWeights
from tests.live.people import SCHEME, close_up, face_of
from tests.live.reenactment.stills.made_stills import LOWER, expression, soft_light, still, with_stills

OPEN, SHUT, RIGHT, LEFT = range(4)


@pytest.fixture
def weights() -> StillWeights:
    return StillWeights(with_stills().stills, face_of(close_up()))


def settled(weights: StillWeights, moved: np.ndarray, turn: Rotation | None = None) -> dict[str, dict[int, float]]:
    """What shows after a second of the same."""
    doing = weights.doing(moved.astype(np.float64), turn or Rotation.identity())
    for index in range(31):
        shown = weights.update(doing, index / 30)
    return {region: dict(chosen) for region, chosen in shown.items()}


def test_at_rest_the_source_image_shows(weights: StillWeights) -> None:
    assert settled(weights, expression()) == {region: {} for region in SMOOTHING_S}


def test_an_open_mouth_is_the_open_stills(weights: StillWeights) -> None:
    shown = settled(weights, expression(open_cm=0.9))
    assert shown["mouth"][OPEN] > 0.98
    assert not shown["right_eye"]
    assert not shown["left_turn"]


def test_shut_eyes_are_the_shut_stills_and_one_eye_may_wink(weights: StillWeights) -> None:
    moved = expression(shut=1.0)
    assert settled(weights, moved)["right_eye"][SHUT] > 0.98
    wink = np.where((face_of(close_up()).head_points[:, :1] > 0), 0, moved)
    shown = settled(weights, wink)
    assert shown["right_eye"][SHUT] > 0.98
    assert not shown["left_eye"]


@pytest.mark.parametrize("shut", [0.0, 0.4])
def test_a_still_of_an_open_eye_is_not_laid_over_a_shut_one(shut: float) -> None:
    """Where no still shows shut lids the source image's own shut."""
    only = with_stills(still(soft_light(), expression(open_cm=1.0)), still(soft_light(), expression(shut=shut)))
    shown = settled(StillWeights(only.stills, face_of(close_up())), expression(shut=1.0))
    assert not shown["right_eye"]
    assert not shown["left_eye"]


@pytest.mark.parametrize(("yaw", "region", "turned", "other"), [(25, "left_turn", RIGHT, "right_turn"),
                                                               (-25, "right_turn", LEFT, "left_turn")])  # fmt: skip
def test_a_turned_face_is_the_still_that_is_turned_there(
    weights: StillWeights, yaw: float, region: str, turned: int, other: str
) -> None:
    shown = settled(weights, expression(), rotation_from_angles(yaw))
    assert shown[region][turned] > 0.98
    assert not shown[other]


def test_a_turned_face_without_a_still_that_is_turned_there_stays() -> None:
    only = with_stills(still(soft_light(), expression(), rotation_from_angles(25)))
    shown = settled(StillWeights(only.stills, face_of(only)), expression(), rotation_from_angles(-25))
    assert not shown["right_turn"]


def drawn(weights: StillWeights, doing: Doing, time_s: float, count: int) -> dict[str, np.ndarray]:
    """Weight of each still in each region."""
    result = {}
    for region, chosen in weights.update(doing, time_s).items():
        result[region] = np.zeros(count)
        for index, weight in chosen:
            result[region][index] = weight
    return result


def test_no_weight_jumps_and_few_stills_show_at_once() -> None:
    """A mouth that opens slowly past many stills: the shown weights change little from step to step."""
    light = soft_light()
    subject = with_stills(*(still(light, expression(open_cm=cm)) for cm in (0.4, 0.6, 0.8, 1.0, 1.6)))
    weights = StillWeights(subject.stills, face_of(subject))
    before = np.zeros(5)
    for step, cm in enumerate(np.linspace(0, 1.8, 400)):
        doing = weights.doing(expression(open_cm=cm).astype(float), Rotation.identity())
        shown = drawn(weights, doing, step, 5)["mouth"]
        assert (shown > 0).sum() <= 3
        assert np.abs(shown - before).max() < 0.12, cm
        assert shown.sum() <= 1 + 1e-9
        before = shown
    assert before.sum() > 0.99


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_weights_are_continuous_along_random_paths(seed: int) -> None:
    """Ten seconds of a driver who moves smoothly: what is drawn changes as slowly, also past ties between stills.

    The same path is taken at 30 and at 120 frames a second: a jump stays as large, a slope gets smaller.
    """
    rng = np.random.default_rng(seed)
    light = soft_light()
    opens, shuts, yaws = rng.uniform(0, 1.6, 8), rng.uniform(0, 1, 8), rng.uniform(-35, 35, 8)
    subject = with_stills(
        *(
            still(light, expression(open_cm, shut), rotation_from_angles(yaw))
            for open_cm, shut, yaw in zip(opens, shuts, yaws, strict=True)
        )
    )
    knots = rng.uniform(0, 1, (3, 12))

    def largest_change(rate: int) -> float:
        weights, before, largest = StillWeights(subject.stills, face_of(subject)), None, 0.0
        for step in range(10 * rate):
            place = 11 * step / (10 * rate)
            left, part = int(place), place - int(place)
            eased = part * part * (3 - 2 * part)
            opened, shut, turn = knots[:, left] + eased * (knots[:, left + 1] - knots[:, left])
            moved = expression(1.5 * opened, shut).astype(float)
            doing = weights.doing(moved, rotation_from_angles(60 * turn - 30))
            now = drawn(weights, doing, step / rate, 8)
            if before is not None:
                largest = max(largest, *(float(np.abs(now[region] - before[region]).max()) for region in now))
            before = now
        return largest

    assert largest_change(30) < 0.5
    assert largest_change(120) < 0.15


def test_three_stills_that_are_equally_near_all_show() -> None:
    same = still(soft_light(), expression(open_cm=1.0))
    subject = with_stills(same, same, same)
    weights = StillWeights(subject.stills, face_of(subject))
    shown = settled(weights, expression(open_cm=1.0))["mouth"]
    assert shown == pytest.approx({0: 1 / 3, 1: 1 / 3, 2: 1 / 3}, abs=0.01)


@pytest.mark.parametrize("own_cm", [0.0, 0.03])
def test_noise_does_not_bring_a_still_whose_mouth_is_nearly_neutral(own_cm: float) -> None:
    """Fractions of a millimetre are the tracker's: the mouth stays the source image's."""
    light = soft_light()
    slight = expression()
    slight[LOWER, 1] -= own_cm
    subject = with_stills(
        still(light, expression(open_cm=1.0)),
        still(light, slight, rotation_from_angles(25)),
        still(light, expression(), rotation_from_angles(-25)),
    )
    weights = StillWeights(subject.stills, face_of(subject))
    for cm in (0.01, 0.02, 0.03, 0.04):
        moved = expression()
        moved[LOWER, 1] -= cm
        moved[SCHEME.upper_lip_outer[1:-1], 1] -= cm
        moved[SCHEME.upper_lip_inner[1:-1], 1] -= cm
        assert not settled(weights, moved)["mouth"], cm


@pytest.mark.slow
def test_weights_follow_time_and_not_the_number_of_frames(weights: StillWeights) -> None:
    rest, opened = (weights.doing(expression(open_cm=cm).astype(float), Rotation.identity()) for cm in (0.0, 1.0))

    def after(frames: int) -> float:
        fresh = StillWeights(with_stills().stills, face_of(close_up()))
        fresh.update(rest, 0.0)
        for index in range(frames):
            shown = fresh.update(opened, 0.1 * (index + 1) / frames)
        return sum(weight for _, weight in shown["mouth"])

    assert 0.5 < after(3) < 0.95
    assert after(3) == pytest.approx(after(12), abs=0.01)


def test_a_clock_that_begins_anew_shows_what_is_wanted_at_once(weights: StillWeights) -> None:
    rest, opened = (weights.doing(expression(open_cm=cm).astype(float), Rotation.identity()) for cm in (0.0, 1.0))
    weights.update(rest, 100.0)
    assert sum(weight for _, weight in weights.update(opened, 0.0)["mouth"]) > 0.98
