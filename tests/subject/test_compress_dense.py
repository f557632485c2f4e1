"""Fields that are not factored, compressed: as good as what was asked, black outside, within a limit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from relit_camera.reflectance.barycentric import SphericalBarycentric
from relit_camera.reflectance.samples import Samples
from relit_camera.reflectance.visibility import Visibility
from relit_camera.subject import compress_dense as module
from relit_camera.subject.compress_dense import compress_dense
from relit_camera.subject.field import ReflectanceField
from tests.evaluate.ball import cap, shadowed

SIZE = 40


@pytest.fixture(scope="module")
def samples() -> Samples:
    return shadowed(cap(60, 60), SIZE)


@dataclass
class Counted:
    """A field that notes which pixels were asked for."""

    field: ReflectanceField
    asked: list[int]

    @property
    def size(self) -> tuple[int, int]:
        return self.field.size

    def dense(self, start: int, stop: int) -> NDArray[np.float32]:
        self.asked.append(stop - start)
        return self.field.dense(start, stop)


def test_a_field_of_low_rank_comes_back(samples: Samples) -> None:
    """Barycentric weights: no more independent pictures than lights."""
    field = Counted(SphericalBarycentric().build(samples), [])
    found = compress_dense(field, samples.pictures, samples.matte, target_db=60)
    inside = samples.matte.ravel() > 0
    restored = np.einsum("ckp,kl->plc", found.basis.reshape(3, -1, SIZE**2).astype(np.float32), found.coefficients)
    assert found.basis.shape[1] <= len(samples.directions)
    assert found.psnr_db > 55
    np.testing.assert_allclose(restored[inside], field.dense(0, SIZE**2)[inside], atol=0.01)
    assert not restored[~inside].any()
    # Never the whole at once.
    assert max(field.asked[:-1]) <= module.RUN


def test_what_the_limit_allows_is_used_and_what_was_reached_is_told(
    samples: Samples, monkeypatch: pytest.MonkeyPatch
) -> None:
    field, reached = Visibility().build(samples), []
    for components in (8, 24):
        monkeypatch.setattr(module, "MAX_COMPONENTS", components)
        found = compress_dense(field, samples.pictures, samples.matte)
        assert found.basis.shape == (3, components, SIZE, SIZE)
        assert found.basis.dtype == np.float16
        assert found.light_coefficients.shape == (components, len(samples.directions))
        reached.append(found.psnr_db)
    assert reached[0] + 3 < reached[1] < 50


def test_fewer_components_are_kept_where_less_is_asked(samples: Samples) -> None:
    field = SphericalBarycentric().build(samples)
    ranks = [compress_dense(field, samples.pictures, samples.matte, each).basis.shape[1] for each in (25, 45)]
    assert ranks[0] < ranks[1]
