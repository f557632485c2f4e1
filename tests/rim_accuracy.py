"""Measures the outline of a person who is parted from their room: `python -m tests.rim_accuracy [DRIVE]`.

The person is the mannequin, or that of a folder of `python -m relit_studio drive`: both are rendered with an exact
matte. They are put before a dark and a bright room, with a webcam's noise, parted from it by the matting network, and
put before four backgrounds. Printed are, as means of all frames: the matte's sum of absolute differences and its
gradient error, both in thousands of pixels (Rhemann et al., CVPR 2009), and the PSNR of sRGB codes round the outline:
of the picture that the camera makes, and of one that mixes the filmed colours by the same matte. Where `pymatting` is
installed (`pip install pymatting`; the program does not use it), also of closed-form matting (Levin et al., TPAMI 2008)
with its own estimate of the person's colours: its trimap leaves the neighborhood of the network's outline open.
"""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.config.look import Lighting
from relit_camera.base.images.color import linear_from_uint8, uint8_from_linear
from relit_camera.base.images.image_types import Alpha, DisplayImage, Frame, LinearImage, Mask
from relit_camera.base.rotations import Rotation
from relit_camera.face.matting import SelfieMatting
from relit_camera.lab.evaluate.video.moving_face_accuracy import codes_psnr
from relit_camera.light.environments.builtin.builtin_environments import builtin_environment
from relit_camera.light.exposure import auto_exposure_scale
from relit_camera.light.scene_light import scene_light_map
from relit_camera.live.compositing.alpha_compositing import over, replace_room
from relit_camera.live.compositing.environment_view import EnvironmentView
from relit_camera.live.compositing.matted_frame import MattedFrame
from relit_studio.cycles.exr import read_rgba
from relit_studio.mannequin.outputs.driving_clip import CLIP_LIGHTS, CLIP_SIZE
from relit_studio.mannequin.outputs.mannequin_performance import posture_at
from relit_studio.mannequin.rendering.distant_lights import lights_from_map
from relit_studio.mannequin.rendering.mannequin_camera import Camera
from relit_studio.mannequin.rendering.renderer import View

CLOSED_FORM = importlib.util.find_spec("pymatting") is not None
if CLOSED_FORM:
    import pymatting

TIMES_S = np.arange(8) / 2
BRIGHT = 0.8
"""What the brightest hundredth of the person's pixels is exposed to."""
SHOT, READ = 4e-4, 9e-6
"""Variance of a webcam's noise: a share of the light, and without light."""
UNKNOWN_PX = 5
"""How far on each side of the network's outline the closed form has to decide."""
OUTSIDE_PX, INSIDE_PX = 4, 6
"""How far the outline reaches."""
GRADIENT_SIGMA = 1.4
"""Of the derivatives of the matte, pixels."""


@dataclass(frozen=True)
class Person:
    """A rendered person: light (height, width, 3) linear, premultiplied, and the exact matte (height, width)."""

    light: LinearImage
    matte: Mask


def mannequin() -> Iterator[Person]:
    """Some frames of the mannequin's clip, in the studio's light."""
    lights = lights_from_map(scene_light_map(builtin_environment("studio"), Lighting()), CLIP_LIGHTS)
    for time_s in TIMES_S:
        view = View(posture_at(float(time_s)), Camera(CLIP_SIZE))
        yield exposed(view.under_lights(lights), view.matte())


def driven(folder: Path) -> Iterator[Person]:
    """The frames of a rendered driving video."""
    for path in sorted((folder / "frames").glob("*.exr")):
        yield exposed(*read_rgba(path))


def exposed(light: LinearImage, matte: Mask) -> Person:
    """A person, exposed for the webcam."""
    brightest = float(np.percentile(light[matte > 0.9], 99))
    return Person(np.asarray(np.clip(light * (BRIGHT / brightest), 0, 1), np.float32), np.clip(matte, 0, 1))


def view_of(name: str, size: tuple[int, int]) -> DisplayImage:
    """A built-in environment as it stands behind the person."""
    environment = builtin_environment(name)
    scale = auto_exposure_scale(scene_light_map(environment, Lighting(environment=name)))
    return EnvironmentView(environment.panorama, size, 50.0, 0.3).picture(Rotation.identity(), scale)


def before(person: Person, background: DisplayImage) -> LinearImage:
    """The true picture, linear."""
    return np.asarray(person.light + (1 - person.matte[..., None]) * linear_from_uint8(background), np.float32)


def outline(matte: Mask) -> NDArray[np.bool_]:
    """What is near the edge of a person, but for where the picture cuts them off."""
    some, all_of_it = (matte > 0.02).astype(np.uint8), (matte > 0.98).astype(np.uint8)
    ellipse = cv2.MORPH_ELLIPSE
    grown = cv2.dilate(some, cv2.getStructuringElement(ellipse, (2 * OUTSIDE_PX + 1,) * 2))
    shrunk = cv2.erode(all_of_it, cv2.getStructuringElement(ellipse, (2 * INSIDE_PX + 1,) * 2))
    near = (grown > 0) & (shrunk == 0)
    near[-INSIDE_PX:] = False
    return near


def slopes(matte: Mask) -> NDArray[np.float32]:
    """How steep a matte is, 1/pixel."""
    soft = cv2.GaussianBlur(np.asarray(matte, np.float32), (0, 0), GRADIENT_SIGMA)
    across, down = (cv2.Sobel(soft, cv2.CV_32F, *axis, scale=1 / 8) for axis in ((1, 0), (0, 1)))
    return np.hypot(across, down)


@dataclass(frozen=True)
class Parted:
    """A person parted from their room: the matte, and what puts them before a background."""

    alpha: Alpha
    before: Callable[[DisplayImage], DisplayImage]


def ways(live: DisplayImage, alpha: Alpha) -> dict[str, Parted]:
    """The live picture parted in each way; `alpha` is the network's."""
    frame = MattedFrame(live, alpha)
    parted = {
        "filmed colours": Parted(alpha, partial(over, live, alpha)),
        "the camera": Parted(alpha, partial(replace_room, frame)),
    }
    if CLOSED_FORM:
        colors, closed = closed_form(live, alpha)
        parted["closed form"] = Parted(closed, partial(over, colors, closed))
    return parted


def closed_form(live: DisplayImage, alpha: Alpha) -> tuple[DisplayImage, Alpha]:
    """The person's colours and matte by closed-form matting, where the network's matte is not certain."""
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * UNKNOWN_PX + 1,) * 2)
    trimap = np.full(alpha.shape, 0.5)
    trimap[cv2.dilate(alpha, kernel) < 0.1 * 255] = 0
    trimap[cv2.erode(alpha, kernel) > 0.9 * 255] = 1
    if trimap.min() > 0 or trimap.max() < 1:
        return live, alpha  # nothing is certain
    image = live / 255.0
    found = pymatting.estimate_alpha_cf(image, trimap)
    colors = pymatting.estimate_foreground_ml(image, found)
    codes = [np.clip(np.rint(255 * each), 0, 255).astype(np.uint8) for each in (colors, found)]
    return codes[0], codes[1]


def main() -> None:
    """See the module."""
    people = list(driven(Path(sys.argv[1])) if len(sys.argv) > 1 else mannequin())
    height, width = people[0].matte.shape
    size, random = (width, height), np.random.default_rng(0)
    rooms = {
        "dark": uint8_from_linear(np.full((height, width, 3), 0.05, np.float32)),
        "bright": view_of("window", size),
    }
    backgrounds = {
        "black": np.zeros((height, width, 3), np.uint8),
        "white": np.full((height, width, 3), 255, np.uint8),
        **{name: view_of(name, size) for name in ("sunset", "night-street")},
    }
    print(f"{'room':8}{'way':16}" + "".join(f"{name:>14}" for name in ("SAD", "gradient", *backgrounds)))
    for room, behind in rooms.items():
        network = SelfieMatting()
        found: dict[str, list[list[float]]] = {}
        for index, person in enumerate(people):
            seen = before(person, behind)
            noise = random.normal(size=seen.shape) * np.sqrt(SHOT * seen + READ)
            live = uint8_from_linear(np.clip(seen + noise, 0, 1).astype(np.float32))
            for repeat in range(2):  # it smooths over time, and the frames are far apart
                alpha = network.matte(Frame(live, index, 0.0, index + repeat / 30))
            near = outline(person.matte)
            for way, parted in ways(live, alpha).items():
                share = np.divide(parted.alpha, 255, dtype=np.float32)
                found.setdefault(way, []).append([
                    float(np.abs(share - person.matte).sum()) / 1e3,
                    float(((slopes(share) - slopes(person.matte)) ** 2).sum()) / 1e3,
                    *(codes_psnr(parted.before(each), uint8_from_linear(before(person, each)), near)
                      for each in backgrounds.values()),
                ])  # fmt: skip
        for way, rows in found.items():
            print(f"{room:8}{way:16}" + "".join(f"{value:14.3f}" for value in np.mean(rows, axis=0)))


if __name__ == "__main__":
    main()
