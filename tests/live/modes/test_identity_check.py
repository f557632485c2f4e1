"""A stranger before the camera is told from the subject, after a while."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from relit_camera.live.modes.identity_check import IdentityCheck, IdentityTunables, shape_distance_cm
from relit_camera.live.modes.mode import FaceMismatch
from tests.live.people import close_up, face_of
from tests.live.rooms import before_the_camera

NO_LIGHT_EXPLAINS = 0.75
"""A residual of the fit of the room's light: 0.1 to 0.3 is usual for the subject."""


def stranger_points() -> np.ndarray:
    """A face of quite another shape: longer, narrower, with a chin aside."""
    points = face_of(close_up()).head_points.copy()
    points[:, 0] *= np.where(points[:, 1] < -2, 0.75, 1.1)
    points[:, 1] *= 1.12
    return points


def test_a_stranger_is_found_out_after_a_while_and_not_before() -> None:
    check, stranger = IdentityCheck(face_of(close_up())), before_the_camera(points=stranger_points())
    delay_s = IdentityTunables().delay_s
    for time_s in (0.0, 0.5 * delay_s, 0.99 * delay_s):
        assert check.check(stranger, NO_LIGHT_EXPLAINS, time_s) is None
    found = check.check(stranger, NO_LIGHT_EXPLAINS, 1.01 * delay_s)
    assert isinstance(found, FaceMismatch)
    assert "the live face is not the subject's" in found.why
    assert "deviation 0.75" in found.why
    assert "mode portrait" in found.cure


def test_the_subject_is_not_taken_for_a_stranger_even_in_odd_light() -> None:
    check, person = IdentityCheck(face_of(close_up())), before_the_camera()
    assert all(check.check(person, NO_LIGHT_EXPLAINS, time_s) is None for time_s in np.arange(0, 10, 0.5))


def test_a_person_who_grimaces_is_not_taken_for_a_stranger() -> None:
    """The neutral face may have been taken while they did; what counts is that they ever look like themselves."""
    check, person = IdentityCheck(face_of(close_up())), before_the_camera(points=stranger_points())
    assert person.neutral is not None
    relaxed = replace(person, expression=face_of(close_up()).head_points - person.neutral.points)
    assert check.check(person, NO_LIGHT_EXPLAINS, 0.0) is None
    assert check.check(relaxed, NO_LIGHT_EXPLAINS, 1.0) is None
    assert all(check.check(person, NO_LIGHT_EXPLAINS, time_s) is None for time_s in np.arange(1.5, 10, 0.5))


def test_a_stranger_who_takes_the_persons_place_is_found_out() -> None:
    check, stranger = IdentityCheck(face_of(close_up())), before_the_camera(points=stranger_points())
    times = iter(np.arange(0, 60, 0.5))
    assert all(check.check(before_the_camera(), NO_LIGHT_EXPLAINS, next(times)) is None for _ in range(20))
    assert check.check(replace(stranger, presence=0.0), NO_LIGHT_EXPLAINS, next(times)) is None
    found = [check.check(stranger, NO_LIGHT_EXPLAINS, next(times)) for _ in range(10)]
    assert found[0] is None
    assert isinstance(found[-1], FaceMismatch)


def test_a_stranger_is_found_out_though_no_frame_was_without_a_face() -> None:
    """What tells that somebody else came is then only that the neutral face was measured anew."""
    check, stranger = IdentityCheck(face_of(close_up())), before_the_camera(points=stranger_points())
    person, times = before_the_camera(), iter(np.arange(0, 60, 0.5))
    assert all(check.check(person, NO_LIGHT_EXPLAINS, next(times)) is None for _ in range(20))
    found = [check.check(stranger, NO_LIGHT_EXPLAINS, next(times)) for _ in range(10)]
    assert isinstance(found[-1], FaceMismatch)


def test_a_mismatch_is_over_when_the_subject_is_back_and_not_before() -> None:
    check, stranger = IdentityCheck(face_of(close_up())), before_the_camera(points=stranger_points())
    found = [check.check(stranger, NO_LIGHT_EXPLAINS, time_s) for time_s in (0.0, 1.9)][-1]
    assert isinstance(found, FaceMismatch)
    assert not found.is_over(stranger)
    assert not found.is_over(replace(before_the_camera(), presence=0.5))
    assert not found.is_over(replace(before_the_camera(), neutral=None))
    assert found.is_over(before_the_camera())


def test_when_a_stranger_is_gone_whoever_comes_next_is_judged_anew() -> None:
    """Else somebody whose shape is never quite their subject's, refused for a grimace, would be refused for ever."""
    check, stranger = IdentityCheck(face_of(close_up())), before_the_camera(points=stranger_points())
    found = [check.check(stranger, NO_LIGHT_EXPLAINS, time_s) for time_s in (0.0, 1.9)][-1]
    assert isinstance(found, FaceMismatch)
    assert found.is_over(replace(stranger, presence=0.0))


def test_one_measure_alone_decides_only_when_it_is_far_off() -> None:
    """A beard changes the shape, a cap the light: only the product of both counts."""
    check, stranger = IdentityCheck(face_of(close_up())), before_the_camera(points=stranger_points())
    shape = shape_distance_cm(stranger_points(), face_of(close_up())) / IdentityTunables().shape_cm
    limit = IdentityTunables().residual / shape
    check.check(stranger, 1.1 * limit, 0.0)
    assert check.check(stranger, 1.01 * limit, 1.9) is not None
    assert check.check(stranger, 0.99 * limit, 2.2) is None


def test_the_subject_is_recognized_from_the_first_frame_and_a_stranger_never() -> None:
    check, ease_s = IdentityCheck(face_of(close_up())), IdentityTunables().ease_s
    assert check.recognized(0.0) == 0
    check.check(before_the_camera(presence=0.9), NO_LIGHT_EXPLAINS, 0.0)
    assert check.recognized(0.5) == 0, "the expression is not the face's own yet"
    check.check(before_the_camera(), np.nan, 0.2)
    assert check.recognized(0.5) == 0, "nobody knows yet how it looks"
    check.check(before_the_camera(), NO_LIGHT_EXPLAINS, 0.4)
    assert [check.recognized(0.4 + share * ease_s) for share in (0.0, 0.5, 1.5, 9.0)] == [0, pytest.approx(0.5), 1, 1]
    stranger = before_the_camera(points=stranger_points())
    for time_s in np.arange(10, 20, 0.4):
        check.check(stranger, NO_LIGHT_EXPLAINS, time_s)
        assert check.recognized(time_s) == 0, "after a gap nobody is known"
    check.check(before_the_camera(), NO_LIGHT_EXPLAINS, 20.0)
    assert check.recognized(21.0) == 1
    assert check.recognized(3.0) == 1, "the film begins anew"


def test_who_passes_in_the_first_frame_is_shown_at_once_and_after_a_gap_eased_in() -> None:
    """Before the first frame nothing was shown; in a gap the subject at rest was."""
    check, tunables = IdentityCheck(face_of(close_up())), IdentityTunables()
    check.check(before_the_camera(), NO_LIGHT_EXPLAINS, 5.0)
    assert check.recognized(5.0) == 1
    back_s = 5.0 + 2 * tunables.gap_s
    check.check(before_the_camera(), NO_LIGHT_EXPLAINS, back_s)
    assert check.recognized(back_s) == 0
    assert check.recognized(back_s + 1.5 * tunables.ease_s) == 1


def test_one_who_comes_after_the_subject_with_its_neutral_face_is_not_recognized() -> None:
    """The neutral face stays the subject's until it is taken anew; the stranger's expression is eased from it."""
    check, subject = IdentityCheck(face_of(close_up())), before_the_camera()
    assert subject.neutral is not None
    check.check(subject, NO_LIGHT_EXPLAINS, 0.0)
    check.check(replace(subject, presence=0.0), NO_LIGHT_EXPLAINS, 0.1)
    shape = stranger_points() - subject.neutral.points
    for index in range(1, 41):
        presence = min(index / 10, 1.0)
        stranger = replace(subject, presence=presence, expression=presence * shape)
        check.check(stranger, NO_LIGHT_EXPLAINS, 0.1 + index / 30)
        assert check.recognized(0.1 + index / 30) == 0


def test_a_face_that_has_passed_goes_on_to_pass_in_a_hard_room_and_no_further() -> None:
    tunables = IdentityTunables()
    shape = shape_distance_cm(stranger_points(), face_of(close_up())) / tunables.shape_cm
    residual = tunables.residual / shape  # at which its unlikeness is 1
    for first, later, passes in (
        (0.6, 1.9, True),
        (0.6, 2.1, False),
        (0.8, 0.9, True),
        (0.8, 1.9, True),
        (1.1, 1.2, False),
    ):
        check, person = IdentityCheck(face_of(close_up())), before_the_camera(points=stranger_points())
        check.check(person, first * residual, 0.0)
        assert (check.recognized(1.0) > 0) is (first == 0.6)
        assert (check.check(person, later * residual, 1.9) is None) is passes
        assert (check.recognized(3.0) > 0) is passes


def test_one_moment_in_which_it_is_alike_is_enough() -> None:
    """A turned or talking face is less like its subject's than it was a moment before."""
    check, person = IdentityCheck(face_of(close_up())), before_the_camera(points=stranger_points())
    shape = shape_distance_cm(stranger_points(), face_of(close_up())) / IdentityTunables().shape_cm
    for time_s, unlike in ((0.0, 1.8), (0.5, 0.9), (1.0, 1.8), (1.6, 1.8)):
        assert check.check(person, unlike * IdentityTunables().residual / shape, time_s) is None
        assert (check.recognized(time_s + 0.1) > 0) is (time_s == 1.6), "it was watched for long enough"


def test_a_face_that_is_not_tracked_with_confidence_is_not_judged() -> None:
    check, stranger = IdentityCheck(face_of(close_up())), before_the_camera(points=stranger_points(), presence=0.9)
    check.check(stranger, NO_LIGHT_EXPLAINS, 0.0)
    assert check.check(stranger, NO_LIGHT_EXPLAINS, 1.9) is None


def test_shape_difference_is_of_shape_only() -> None:
    face = face_of(close_up())
    points = face.head_points
    assert shape_distance_cm(points, face) == pytest.approx(0, abs=1e-9)
    assert shape_distance_cm(points * 1.3 + [5, -2, 1], face) == pytest.approx(0, abs=1e-6)
    too_near = points * np.stack([1 + 0.02 * points[:, 2], 1 + 0.02 * points[:, 2], np.ones(len(points))], axis=1)
    assert shape_distance_cm(too_near, face) < 0.05  # as a wrong focal length has it
    speaking = points.copy()
    speaking[list(face.scheme.lips)] += [0, -1.5, 0]
    assert shape_distance_cm(speaking, face) == pytest.approx(0, abs=1e-9)
    assert shape_distance_cm(stranger_points(), face) > 0.4
