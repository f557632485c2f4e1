"""What is compared: every kind of candidate answers what its field holds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from relit_camera.base.errors import NotFoundError
from relit_camera.capture.reflectance import method_registry as methods
from relit_camera.capture.reflectance.directional_light import bilinear_map_lookup
from relit_camera.capture.reflectance.methods.barycentric_methods import SphericalBarycentric
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from relit_camera.capture.subject_builder import build_subject
from relit_camera.lab.evaluate.field.candidates import BLACK_RING_METHOD, method_candidates, subject_candidate
from relit_camera.light.directions import direction_from_spherical
from relit_camera.subject.reflectance_field import FactoredField
from tests.lab.lit_sphere import SIZE, cap, grid, lambert, shadowed

INSIDE = np.flatnonzero(lambert(cap(4, 50)).matte.ravel() > 0.5)


class TexelsOnly:
    """Barycentric, but known at texels alone, as a method of somebody else's may be."""

    def build(self, samples: OlatSamples) -> TexelField:
        return TexelField(SphericalBarycentric().build(samples))


@dataclass
class TexelField:
    exact: FactoredField

    @property
    def size(self) -> tuple[int, int]:
        return self.exact.size

    def dense(self, start: int, stop: int) -> NDArray[np.float32]:
        return self.exact.dense(start, stop)


@pytest.fixture
def dense_method(monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setattr("relit_camera.lab.evaluate.field.candidates.open_method", lambda name: TexelsOnly())
    return "texels"


def test_every_installed_method_and_the_ring_are_candidates() -> None:
    names = [each.name for each in method_candidates(lambert(cap(60, 50)), INSIDE)]
    assert names == [*methods.method_names(), BLACK_RING_METHOD]
    with pytest.raises(NotFoundError, match="no-such"):
        method_candidates(lambert(cap(60, 50)), INSIDE, ["no-such"])


def test_a_captured_direction_comes_back() -> None:
    samples = lambert(cap(60, 50))
    expected = samples.pictures.reshape(len(samples.pictures), -1, 3)[:, INSIDE]
    # Polynomials and harmonics smooth; a process does as far as it finds noise, and the model has one for its residual.
    interpolating = set(methods.method_names()) - {"ptm", "sh3", "gp", "model", "blend"}
    for candidate in method_candidates(samples, INSIDE, [*sorted(interpolating), BLACK_RING_METHOD]):
        np.testing.assert_allclose(candidate.pictures_at(samples.directions), expected, atol=2e-3)


def test_a_method_of_texels_answers_at_their_centres_as_its_field(dense_method: str) -> None:
    samples = lambert(cap(60, 50))
    candidate = method_candidates(samples, INSIDE, [dense_method])[0]
    field = SphericalBarycentric().build(samples).dense(0, SIZE * SIZE)
    np.testing.assert_allclose(candidate.pictures_at(grid(32)), field[INSIDE].transpose(1, 0, 2), atol=1e-6)
    places = np.array([7, 3])
    np.testing.assert_allclose(candidate.maps_at(grid(32), places), field[INSIDE[places]], atol=1e-6)


def test_the_map_is_read_bilinearly_across_the_seam_and_held_at_the_poles() -> None:
    rows, columns = np.indices((32, 64))
    # Steps of θ and φ, so that interpolation in either is exact.
    step = 2 * np.pi / 64

    def read(values: NDArray, azimuth: float, elevation: float) -> float:
        return float((bilinear_map_lookup(direction_from_spherical([azimuth], [elevation])) @ values.ravel())[0])

    assert read(rows, 0.1, np.pi / 2 - 3.75 * step) == pytest.approx(3.25)
    assert read(columns, -np.pi + 2.75 * step, 0.2) == pytest.approx(2.25)
    assert read(columns, np.pi, 0.2) == pytest.approx(63 / 2)
    assert read(rows, 1.0, np.pi / 2) == 0
    assert read(rows, 1.0, -np.pi / 2) == 31


def test_a_subject_answers_as_the_method_that_built_it() -> None:
    samples = lambert(cap(60, 50))
    subject = build_subject(samples, "barycentric", "lights.lp", landmarks={})
    query = direction_from_spherical([0.2, -0.4], [0.1, 0.3])
    expected = method_candidates(samples, INSIDE, ["barycentric"])[0].pictures_at(query)
    answered = subject_candidate("me", subject, INSIDE)
    seen = answered.pictures_at(query)
    # It is compressed to 43 dB and more.
    assert np.sqrt(np.mean((seen - expected) ** 2)) < 10 ** (-43 / 20)
    np.testing.assert_allclose(answered.maps_at(query, np.array([5])), seen[:, [5]].transpose(1, 0, 2), rtol=1e-5)


@pytest.mark.slow
def test_a_subject_of_a_method_with_shadows_answers_from_its_map() -> None:
    samples = shadowed(cap(60, 50), SIZE)
    subject = build_subject(samples, "thesis", "lights.lp", landmarks={})
    assert subject.metadata.method == "thesis"
    inside = np.flatnonzero(samples.matte.ravel() > 0.5)
    expected = method_candidates(samples, inside, ["thesis"])[0].pictures_at(grid(32))
    seen = subject_candidate("me", subject, inside).pictures_at(grid(32))
    assert np.sqrt(np.mean((seen - expected) ** 2)) < 10 ** (-40 / 20)
