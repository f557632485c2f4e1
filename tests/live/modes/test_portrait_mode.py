"""Mode portrait: blending the relit source image with the captured one."""

from __future__ import annotations

import numpy as np

from relit_camera.base.images.color import linear_from_uint8
from relit_camera.live.modes.portrait_mode import blend_with_source
from tests.live.people import close_up


def test_blend_goes_from_the_captured_source_image_to_the_relit_one() -> None:
    subject = close_up()
    captured = linear_from_uint8(subject.neutral)
    relit = np.asarray(captured * 0.2 + 0.1, np.float32)
    assert blend_with_source(subject, relit, 1.0) is relit
    np.testing.assert_allclose(blend_with_source(subject, relit, 0.0), captured, atol=1e-6)
    np.testing.assert_allclose(blend_with_source(subject, relit, 0.25), 0.75 * captured + 0.25 * relit, atol=1e-6)
