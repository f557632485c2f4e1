"""Imported sets: what lies well is left alone, what does not is aligned, and what is corrupt is left out by name."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from relit_camera.base.errors import LightsError
from relit_camera.capture.alignment.picture_set_alignment import align_if_better
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from tests.capture.alignment.test_picture_set_alignment import BLACK, DIRECTIONS, TORN, disc, off, scene
from tests.cli.relit_command import call
from tests.lab.lit_sphere import cap, lambert, shadowed
from tests.synthetic import sphere_samples, write_lights

NAMES = [f"{index:03d}.png" for index in range(len(DIRECTIONS))]


def corrupt() -> OlatSamples:
    pictures = scene()[2].copy()
    pictures[BLACK] = 0.002
    pictures[TORN, ::2] *= 0.1
    return OlatSamples(pictures, DIRECTIONS, disc())


@pytest.mark.slow
@pytest.mark.parametrize(
    "make",
    [
        lambda: OlatSamples(scene()[3], DIRECTIONS, disc()),
        lambda: shadowed(cap(60, 60), 48),
        lambda: lambert(cap(60, 60), 48),
        lambda: sphere_samples(30, 24),
        lambda: sphere_samples(30, 64),
    ],
    ids=["face", "shadowed", "lambert", "tiny", "few lights and no features"],
)
def test_exact_pictures_are_left_alone(make: Callable[[], OlatSamples]) -> None:
    samples = make()
    names = [str(index) for index in range(len(samples.directions))]
    found = align_if_better(samples, names)
    assert found.samples is samples
    assert len(found.messages) == 1
    assert found.messages[0].startswith("pictures left as they are")


@pytest.mark.slow
def test_what_moved_is_aligned_and_what_is_corrupt_left_out() -> None:
    still = scene()[3]
    samples = corrupt()
    found = align_if_better(samples, NAMES)
    kept = np.setdiff1d(np.arange(28), [BLACK, TORN])
    np.testing.assert_array_equal(found.samples.directions, DIRECTIONS[kept])
    assert off(found.samples.pictures, still[kept]) < 0.5 * off(samples.pictures[kept], still[kept])
    assert found.messages[0].startswith("26 of 28 pictures aligned: motion ")
    motion, spread = found.messages[0].split("motion ")[1].split(" px RMS, strobes' strength spread by ")
    assert float(motion) == pytest.approx(0.7, abs=0.3)
    assert float(spread.rstrip("%")) == pytest.approx(7, abs=2)
    assert [line.split(":")[1].strip() for line in found.messages[1:]] == ["003.png", "010.png"]
    assert "black" in found.messages[1]
    assert "torn" in found.messages[2]


@pytest.mark.slow
def test_of_still_pictures_the_corrupt_ones_alone_go() -> None:
    pictures = scene()[3].copy()
    pictures[BLACK] = 0.002
    found = align_if_better(OlatSamples(pictures, DIRECTIONS, disc()), NAMES)
    np.testing.assert_array_equal(found.samples.pictures, np.delete(pictures, BLACK, axis=0))
    assert found.messages[0].startswith("pictures left as they are")
    assert found.messages[1].startswith("left out: 003.png: black")


@pytest.mark.slow
def test_who_wants_it_as_is_gets_it_and_who_wants_it_aligned_too() -> None:
    samples = corrupt()
    assert align_if_better(samples, NAMES, False).samples is samples
    still = OlatSamples(scene()[3], DIRECTIONS, disc())
    assert align_if_better(still, NAMES, True).messages[0].startswith("28 of 28 pictures aligned")


def test_few_pictures_are_left_alone_or_refused() -> None:
    few = OlatSamples(scene()[2][:5], DIRECTIONS[:5], disc())
    assert align_if_better(few, NAMES[:5]).samples is few
    with pytest.raises(LightsError, match="5 pictures are too few to align; give 8"):
        align_if_better(few, NAMES[:5], True)


def test_the_command_tells_what_it_did(tmp_path: Path) -> None:
    lights = write_lights(tmp_path, sphere_samples(30, 16))
    answer = call("capture", "import", lights, "--out", tmp_path / "s.relit", "--as-is", "--method", "barycentric")
    assert answer.code == 0, answer.err
    assert answer.out.splitlines()[0] == "pictures left as they are"
