"""The mannequin's whole field, and its performance truly relit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from relit_camera.base.images.tone_mapping import linear_from_display
from relit_camera.base.video.video_readers import VideoReader
from relit_camera.capture.picture_import import import_samples
from relit_camera.light.directions import texel_directions
from relit_camera.light.environments.builtin.builtin_light_maps import builtin_light_map
from relit_camera.light.exposure import auto_exposure_scale
from relit_studio.mannequin.__main__ import main
from relit_studio.mannequin.outputs.driving_clip import CLIP_SIZE, render_clip
from relit_studio.mannequin.rendering.mannequin_camera import Camera
from relit_studio.mannequin.rendering.renderer import View
from relit_studio.mannequin.shape.figure import Posture

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("truth")
    arguments = ["--size", "32", "--lights", "4", "--frames", "2", "--field-rows", "3", "--relit", "overcast"]
    assert main(["--out", str(out), "--quiet", *arguments]) == 0
    return out


def test_the_field_has_a_linear_picture_for_every_texel(made: Path) -> None:
    samples = import_samples(made / "field" / "lights.lp")
    np.testing.assert_allclose(samples.directions, texel_directions(3, 6).reshape(-1, 3), atol=1e-6)
    front = int(samples.directions[:, 2].argmax())
    expected = View(Posture(), Camera(32)).under_light(samples.directions[front])
    np.testing.assert_allclose(samples.pictures[front], expected, atol=1e-4)
    assert (made / "field" / "landmarks.json").is_file()


def test_the_relit_video_is_the_clip_under_that_light(made: Path) -> None:
    light_map = builtin_light_map("overcast")
    with VideoReader(made / "relit-overcast.mp4") as relit, VideoReader(made / "matte.mp4") as outline:
        frames = [frame.image for frame in relit]
        mattes = [frame.image[..., 0] > 250 for frame in outline]
    assert len(frames) == len(mattes) == 2
    expected = next(render_clip(light_map, Camera(CLIP_SIZE), [0.0])) * np.float32(auto_exposure_scale(light_map))
    inside = mattes[0]
    assert 0.3 < inside.mean() < 0.8
    # H.264 halves the resolution of color.
    error = linear_from_display(frames[0])[inside] - np.clip(expected[inside], 0, 2)
    assert np.sqrt(np.mean(error**2)) < 0.03
    assert frames[0][:20, :20].max() < 8


def test_an_unknown_environment_is_a_usage_error(tmp_path: Path) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(["--out", str(tmp_path / "x"), "--relit", "mars"])
    assert stopped.value.code == 2
