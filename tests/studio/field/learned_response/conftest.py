"""The networks that a capture needs, and a person that nothing was learned from."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.app.demo import demo_files
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from relit_camera.light.directions import fibonacci_directions, texel_directions, texel_solid_angles
from relit_camera.subject.relighting.basis_relighter import BasisRelighter
from relit_camera.subject.subject_file import read_subject
from tests.capture.instant.conftest import models, pulled_models

__all__ = ["models", "pulled_models"]

LAMP_DEG = 30.0


@pytest.fixture(scope="session")
def bundled_person() -> OlatSamples:
    """The person of the demo under wide lamps all round, by the measured field; nothing was trained on them."""
    subject = read_subject(demo_files.SUBJECT)
    toward = fibonacci_directions(48)
    lamps = texel_directions().reshape(-1, 3) @ toward.T > np.cos(np.radians(LAMP_DEG / 2))
    radiance = lamps / (lamps * texel_solid_angles().reshape(-1, 1)).sum(axis=0)
    maps = np.repeat(radiance.T.reshape(48, 32, 64, 1), 3, axis=3).astype(np.float32)
    relighter = BasisRelighter(subject)
    pictures = np.stack([relighter.relight(each[None])[0] for each in maps])
    return OlatSamples(pictures.astype(np.float32), toward, subject.matte)
