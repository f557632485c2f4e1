"""Which frames become stills: one of each thing that the face does, sharp ones, and an error where it does little."""

from __future__ import annotations

import pytest

from relit_camera.base.errors import CaptureError
from relit_camera.capture.expressions.still_selection import select_stills
from relit_camera.subject.expression_stills import MAX_STILLS
from tests.capture.expressions.talking_film import film, moved_points, tracked

REST = [tracked(index, moved_points()) for index in range(20)]
DOING = {
    "lips apart": tracked(100, moved_points(open_cm=0.5)),
    "jaw dropped": tracked(101, moved_points(open_cm=1.6)),
    "eyes shut": tracked(102, moved_points(shut=1.0)),
    "turned right": tracked(104, moved_points(), yaw=-18),
    "turned far left": tracked(105, moved_points(), yaw=31),
}


def test_each_thing_that_the_face_does_becomes_a_still_and_rest_does_not() -> None:
    selection = select_stills(film(*REST, *DOING.values()))
    assert [face.index for face in selection.faces] == [face.index for face in DOING.values()]
    assert set(DOING) <= set(selection.covered)


def test_what_nobody_is_asked_for_becomes_a_still_too_where_it_looks_different() -> None:
    different = [tracked(110, moved_points(open_cm=1.0)), tracked(111, moved_points(shut=0.5))]
    different += [tracked(112, moved_points(), pitch=16)]
    alike = tracked(113, moved_points(open_cm=1.05))
    chosen = {face.index for face in select_stills(film(*REST, *DOING.values(), *different, alike)).faces}
    assert {110, 111, 112} <= chosen
    assert 113 not in chosen


def test_a_glance_gives_no_still() -> None:
    """Open eyes are the source image's, moved: a still of them would never show."""
    glance = tracked(150, moved_points(gaze_cm=0.3))
    assert 150 not in {face.index for face in select_stills(film(*REST, *DOING.values(), glance)).faces}


def test_what_is_missing_is_said() -> None:
    selection = select_stills(film(*REST, *(face for name, face in DOING.items() if name != "eyes shut")))
    assert "eyes shut" not in selection.covered
    assert "shut your eyes for a second" in selection.missing


def test_of_like_frames_the_sharp_one_is_taken() -> None:
    blurred = tracked(200, moved_points(open_cm=1.65), sharpness=0.5)
    hopeless = tracked(201, moved_points(open_cm=2.2), sharpness=0.1)
    selection = select_stills(film(*REST, *DOING.values(), blurred, hopeless))
    assert not {200, 201} & {face.index for face in selection.faces}


def test_a_long_film_gives_no_more_stills_than_a_subject_may_have() -> None:
    faces = [
        tracked(
            index,
            moved_points(open_cm=(index * 0.37) % 2, shut=(index * 0.61) % 1),
            yaw=(index * 7.3) % 70 - 35,
            pitch=(index * 3.1) % 40 - 20,
        )
        for index in range(600)
    ]
    assert len(select_stills(film(*REST, *faces)).faces) <= MAX_STILLS


def test_a_face_that_does_nothing_is_refused_with_what_to_do() -> None:
    with pytest.raises(CaptureError) as caught:
        select_stills(film(*REST))
    assert "does too little" in caught.value.what
    assert "open your mouth wide" in caught.value.cure


def test_what_only_a_blurred_frame_shows_is_shown_all_the_same() -> None:
    """Sharper frames that turn nearly as far are not taken instead of it."""
    near = [tracked(300 + index, moved_points(), yaw=-24.5, pitch=2 * index - 6) for index in range(7)]
    far = tracked(400, moved_points(), yaw=-26, sharpness=0.4)
    assert "turned far right" in select_stills(film(*REST, *DOING.values(), *near, far)).covered
