"""Every case under tests/replay/cases comes out as it expects, and adam_talk drives what it shows.

The result follows its driver, measured by the tracker that did not drive it.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from relit_camera.base.config.settings import RelitSettings
from relit_camera.base.images.image_types import DisplayImage, Frame
from relit_camera.base.rotations import angles_from_rotation
from relit_camera.face.face_state import FaceState
from relit_camera.face.tracking.trackers import TrackerOptions, open_tracker
from tests.replay.case import CASES, case_folders, read_case
from tests.replay.expectations import differences
from tests.replay.failures import keep
from tests.replay.materials import UnavailableError
from tests.replay.play import Played, play

FPS = 24
REACH_DEG = 30
LEAST_CORRELATION = 0.9


@cache
def played(folder: Path) -> Played:
    return play(read_case(folder), folder)


@pytest.mark.slow
@pytest.mark.parametrize("folder", case_folders(), ids=lambda folder: folder.name)
def test_case(folder: Path) -> None:
    try:
        result = played(folder)
    except UnavailableError as reason:
        pytest.skip(str(reason))
    case = read_case(folder)
    wrong = differences(case, folder, result)
    assert not wrong, keep(case, folder, result, wrong)


@cache
def measured(mode: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Yaw in degrees and mouth opening, (frames, 2), of the driver and of the result; NaN where no face is found."""
    found = played(CASES / f"adam-{mode}")
    return track(found.live), track(found.relit)


def track(pictures: list[DisplayImage]) -> NDArray[np.float64]:
    assert RelitSettings().tracker.name == "mesh"  # what drives: measured is with the other
    tracker = open_tracker("openseeface", TrackerOptions(blendshapes=False))
    states = [tracker.track(Frame(picture, i, 0.0, i / FPS)) for i, picture in enumerate(pictures)]
    return np.array([yaw_and_mouth(state) for state in states])


def yaw_and_mouth(state: FaceState) -> tuple[float, float]:
    if state.pose is None:
        return np.nan, np.nan
    return angles_from_rotation(state.pose.rotation).yaw, state.mouth


def correlation(mode: str, column: int) -> float:
    try:
        driver, result = measured(mode)
    except UnavailableError as reason:
        pytest.skip(str(reason))
    both = np.isfinite(driver[:, column]) & np.isfinite(result[:, column])
    both &= np.abs(driver[:, 0] - np.nanmedian(driver[:5, 0])) < REACH_DEG
    assert both.mean() > 0.9, f"the other tracker finds a face in {both.mean():.0%} of the frames"
    x, y = driver[both, column], result[both, column]
    r = float(np.corrcoef(x, y)[0, 1])
    print(f"{mode}: r = {r:.3f}, spread {x.std():.3f} and {y.std():.3f}, {both.sum()} frames")
    return r


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["live", "portrait"])
def test_head_turns_with_the_driver(mode: str) -> None:
    assert correlation(mode, 0) >= LEAST_CORRELATION


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["live", "portrait"])
def test_mouth_opens_with_the_driver(mode: str) -> None:
    assert correlation(mode, 1) >= LEAST_CORRELATION
