"""Samples to subject: the person's shape in the file, and what the header says of the field."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.capture.reflectance.olat_samples import OlatSamples
from relit_camera.capture.subject_builder import build_subject
from relit_camera.subject.subject import HORIZON_STEP_RAD, Subject
from tests.lab.lit_sphere import cap, shadowed
from tests.synthetic import sphere_surface

SIZE = 40


@pytest.fixture(scope="module")
def samples() -> OlatSamples:
    return shadowed(cap(50, 60), SIZE)


@pytest.fixture(scope="module")
def subject(samples: OlatSamples) -> Subject:
    return build_subject(samples, "barycentric", "ball", landmarks={})


@pytest.mark.slow
def test_the_shape_is_in_the_subject_whatever_the_method(samples: OlatSamples, subject: Subject) -> None:
    truth, inside = sphere_surface(SIZE)
    assert subject.normals is not None
    assert subject.albedo is not None
    assert subject.depth is not None
    facing = inside & (truth[..., 2] > 0.6)
    cosines = np.sum(subject.normals.astype(np.float64) * truth, axis=2)[facing]
    assert np.degrees(np.arccos(np.clip(np.median(cosines), -1, 1))) < 3
    assert np.median(subject.albedo[facing]) == pytest.approx(1, abs=0.05)
    # A ball of 20 pixels' radius.
    relative = (subject.depth - truth[..., 2] * SIZE / 2)[facing]
    assert np.std(relative) < 2
    assert not subject.depth[~inside].any()
    assert subject.normals.dtype == subject.albedo.dtype == np.float16


@pytest.mark.slow
def test_horizons_come_back_within_half_a_step(samples: OlatSamples, subject: Subject) -> None:
    assert subject.horizons is not None
    assert subject.horizons.dtype == np.uint8
    heights = subject.horizons * HORIZON_STEP_RAD - np.pi / 2
    known = samples.geometry.horizon.heights.astype(np.float64)
    assert np.abs(heights - known).max() < HORIZON_STEP_RAD / 2 + 1e-3
    assert np.ptp(known) > 1


def test_the_header_says_how_much_was_measured(subject: Subject) -> None:
    """The cap of lights reaches 60 degrees from the camera: a quarter of the sphere."""
    assert subject.metadata.rung == "pictures"
    assert subject.metadata.measured_fraction == pytest.approx((1 - np.cos(np.radians(60))) / 2, abs=0.02)


def test_the_header_says_what_was_reached(subject: Subject) -> None:
    meta = subject.metadata
    assert meta.format_version == 2
    assert meta.components == subject.basis.components
    assert meta.psnr_db > 45
    assert meta.texel_psnr_db is not None
    assert meta.texel_psnr_db > 42
    assert meta.map_psnr_db is not None
    assert meta.map_psnr_db > 45
    assert meta.bytes_share is not None
    assert 0 < meta.bytes_share < 1


@pytest.mark.slow
def test_the_shape_can_be_left_out(samples: OlatSamples) -> None:
    told: list[tuple[int, int]] = []
    subject = build_subject(
        samples,
        "nearest",
        "ball",
        landmarks={},
        with_geometry=False,
        progress=lambda done, total: told.append((done, total)),
    )
    assert subject.normals is None
    assert subject.horizons is None
    assert told[-1] == (5, 5)
