"""A known person as the simulation of desk recordings wants them, with pictures before screens where there are any."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from relit_camera.base.errors import LightsError
from relit_camera.base.images.image_files import write_display
from relit_camera.capture.desk.person.patch_light import place_patches
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from relit_camera.lab.evaluate.desk_simulation import LAPTOP, MONITOR
from relit_camera.lab.evaluate.ladder.desk_rung import filmed_before, read_screens, simulated_person
from relit_camera.lab.evaluate.ladder.known_person import SubjectFolder, known_person
from tests.lab.ladder.known_head import PIXELS_PER_CM, head_samples, known_head

pytestmark = pytest.mark.slow


def test_the_simulated_person_has_the_known_field_and_the_heads_scale() -> None:
    simulated, samples = simulated_person(known_head()), head_samples()
    assert simulated.pixels_per_cm == pytest.approx(PIXELS_PER_CM, rel=0.03)
    pixels = np.flatnonzero(samples.matte.ravel() > 0.99)
    lit = np.flatnonzero(samples.directions[:, 2] > 0.5)
    found = simulated.field.at(samples.directions[lit], pixels)
    np.testing.assert_allclose(found, samples.pictures.reshape(len(samples.pictures), -1, 3)[lit][:, pixels], atol=0.02)
    assert simulated.field.size == samples.matte.shape


def test_rendered_pictures_before_a_screen_take_the_place_of_the_simulated_ones() -> None:
    person = known_head()
    rendered = simulated_person(person).patch_pictures(MONITOR)
    rendered[:, :, :32] = 0  # nobody would simulate that
    before = replace(person, screens={"desk": rendered})
    frames, simulated = (filmed_before(each, "desk").frames for each in (before, person))
    left, right = np.s_[200:280, 250:300], np.s_[200:280, 340:390]
    white = 13
    assert frames[white][left].mean() < 0.7 * frames[white][right].mean()
    assert simulated[white][left].mean() > 0.8 * simulated[white][right].mean()
    assert len(filmed_before(before, "laptop").frames) == len(frames)


def test_a_subject_before_other_pictures_is_another_one(tmp_path: Path) -> None:
    person, subjects = known_head(), SubjectFolder(tmp_path)
    rendered = simulated_person(person).patch_pictures(MONITOR)
    for screens in ({}, {"desk": rendered}, {"desk": 2 * rendered}, {"desk": rendered}):
        subjects.made_of(replace(person, screens=screens), "desk", lambda: person.subject)
    assert len(list(tmp_path.iterdir())) == 3


def test_pictures_before_a_screen_are_as_large_as_the_others() -> None:
    samples = head_samples()
    smaller = OlatSamples(samples.pictures[:15, ::2, ::2], samples.directions[:15], samples.matte[::2, ::2])
    with pytest.raises(LightsError, match="another size"):
        known_person("head", samples, 64, SubjectFolder(None), {"desk": smaller})


def test_pictures_before_screens_are_read_where_they_lie_beside_the_lights(tmp_path: Path) -> None:
    (tmp_path / "desk").mkdir()
    pictures = np.full((15, 32, 32, 3), 90, np.uint8)
    for index, picture in enumerate(pictures):
        write_display(tmp_path / "desk" / f"{index:02d}.png", picture)
    for setup in (MONITOR, LAPTOP):
        lines = [f"{n:02d}.png {x} {y} {z}" for n, (x, y, z) in enumerate(place_patches(setup).directions)]
        (tmp_path / "desk" / "lights.lp").write_text("\n".join(["15", *lines]))
        if setup is MONITOR:
            found = read_screens(tmp_path, ["desk", "laptop", "film"])
            assert list(found) == ["desk"]
            assert found["desk"].pictures.shape == (15, 32, 32, 3)
            assert read_screens(tmp_path, ["laptop", "film"]) == {}
    with pytest.raises(LightsError, match="does not list the patches of the desk"):
        read_screens(tmp_path, ["desk"])
