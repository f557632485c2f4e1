"""The ladder's rungs on a head whose field is a formula."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import cast

import cv2
import numpy as np
import pytest

from relit_camera.base.errors import CaptureError, NotFoundError
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from relit_camera.capture.subject_builder import build_subject
from relit_camera.lab.evaluate.ladder.known_person import KnownPerson, SubjectFolder, reduced
from relit_camera.lab.evaluate.ladder.ladder_evaluation import RoomResult, evaluate_person
from relit_camera.lab.evaluate.ladder.ladder_report import (
    ladder_json,
    ladder_page,
    ladder_text,
    room_figures,
    room_sheet,
)
from relit_camera.lab.evaluate.ladder.ladder_rungs import RUNGS, Rung, rung_names
from relit_camera.lab.evaluate.ladder.webcam_frames import RoomFrames
from relit_camera.light.environments.builtin.builtin_environments import builtin_environment
from relit_camera.subject.subject import Subject
from tests.lab.html_outline import Outline
from tests.lab.ladder.known_head import SIZE, KnownFace, head_landmarks, head_samples, known_head

pytestmark = pytest.mark.slow

ENLARGED, SHIFT = 1.5, (9.0, 4.0)


def full(person: KnownPerson, frames: RoomFrames, subjects: SubjectFolder) -> Subject:
    return person.subject


def cut_another_way(person: KnownPerson, frames: RoomFrames, subjects: SubjectFolder) -> Subject:
    """The truth, enlarged and shifted."""
    side = round(1.8 * SIZE)
    transform = np.array([[ENLARGED, 0, SHIFT[0] + (ENLARGED - 1) / 2], [0, ENLARGED, SHIFT[1] + (ENLARGED - 1) / 2]])
    known = head_samples()
    moved = [cv2.warpAffine(each, transform, (side, side)) for each in (*known.pictures, known.matte)]
    samples = OlatSamples(np.stack(moved[:-1]), known.directions, moved[-1])
    points = (head_landmarks() * ENLARGED + SHIFT).astype(np.float32)
    return build_subject(samples, "barycentric", "cut", landmarks={KnownFace.scheme: points}, with_geometry=False)


def nobody(person: KnownPerson, frames: RoomFrames, subjects: SubjectFolder) -> Subject:
    raise CaptureError("no face is found", "look into the camera")


@pytest.fixture(scope="module")
def result() -> Iterator[RoomResult]:
    """Three rungs in one room."""
    rungs = {
        "full": Rung("the truth", full),
        "cut": Rung("the truth, cut another way", cut_another_way, of_room=True, own_frame=True),
        "nobody": Rung("none", nobody, of_room=True),
    }
    environments = [builtin_environment(name) for name in ("window", "party")]
    with pytest.MonkeyPatch.context() as patch:
        for name, rung in rungs.items():
            patch.setitem(cast("dict[str, Rung]", RUNGS), name, rung)
        results = evaluate_person(
            known_head(), environments[:1], environments, list(rungs), KnownFace(), SubjectFolder(None)
        )
        yield next(iter(results))


def test_the_truth_beats_the_tint(result: RoomResult) -> None:
    figures = result.figures
    assert list(figures) == ["tint", "full", "cut", "nobody"]
    assert list(figures["full"].ratio_db) == ["party"]
    assert figures["full"].field is None  # it is the truth
    assert figures["full"].mean_ratio_db > figures["tint"].mean_ratio_db + 6
    assert figures["full"].mean_inner_db > figures["full"].mean_ratio_db
    assert figures["full"].build_s is None


def test_a_subject_cut_another_way_is_the_same_person(result: RoomResult) -> None:
    cut = result.figures["cut"]
    assert cut.field is not None
    assert cut.field.as_is_db.min() > 33  # enlarged and reduced again: edges alone differ
    assert cut.build_s is not None
    assert cut.build_s > 0


def test_a_rung_that_fails_says_why(result: RoomResult) -> None:
    assert result.figures["nobody"].failure == "no face is found; look into the camera"
    assert np.isnan(result.figures["nobody"].mean_ratio_db)


def test_reports_have_every_rung_and_no_number_that_json_does_not_know(result: RoomResult) -> None:
    rooms = [room_figures(result, room_sheet(result.pictures, result.room))]
    figures = json.loads(json.dumps(ladder_json(rooms), allow_nan=False))
    assert figures["people"]["head"]["window"]["full"]["ratio_db"].keys() == {"party"}
    assert figures["means"]["nobody"]["ratio_db"] is None
    text = ladder_text(rooms)
    assert all(name in text for name in ("tint", "full", "cut", "window: no face is found"))
    outline = Outline()
    outline.feed(ladder_page(rooms))
    assert outline.fetched == outline.open == []
    assert len(outline.images) == 1


def test_kept_subjects_are_found_again_and_only_for_the_same_pictures(tmp_path: Path) -> None:
    folder, samples = SubjectFolder(tmp_path), reduced(head_samples(), 24)
    assert samples.matte.shape == (24, 24)
    np.testing.assert_allclose(samples.pictures.mean(), head_samples().pictures.mean(), rtol=0.05)
    folder.subject("head", samples, "barycentric")
    kept = list(tmp_path.iterdir())
    assert len(kept) == 1
    before = kept[0].stat().st_mtime_ns
    folder.subject("head", samples, "barycentric")
    assert kept[0].stat().st_mtime_ns == before
    other = OlatSamples(samples.pictures * np.float32(0.9), samples.directions, samples.matte)
    folder.subject("head", other, "barycentric")
    assert len(list(tmp_path.iterdir())) == 2


def test_rungs_are_chosen_by_name() -> None:
    assert rung_names(None) == list(RUNGS)
    assert rung_names(["full", "thesis"]) == ["thesis", "full"]
    with pytest.raises(NotFoundError, match="no rung is called 'ladder'"):
        rung_names(["ladder"])
