"""A good film of four seconds, and what people do wrong with it: each function takes good frames and spoils them."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np

from tests.capture.film.blinking_film import Blinking
from tests.capture.film.blinking_film import film as blinking
from tests.capture.film.generated_film import FOCAL_PX, HEAD, PX_PER_CM, SIZE, Film, write_film
from tests.made_once import made_once

GAMMA = 2.2
FACE = (*HEAD, 9.5 * PX_PER_CM)
NAMED_BALL = f"{SIZE[0] / 2 + 70},{SIZE[1] / 2 - 80},30"
"""Nearly: a sphere off the picture's middle is seen as an ellipse. It need not be looked for then."""
GOOD = Film(frames=120)
LIT = np.array([GOOD.lit(index) for index in range(GOOD.frames)])


def good_film() -> Path:
    """The good film, written once in a test run."""
    return made_once("good-film.mp4", lambda path: write_film(path, GOOD.codes()))


Codes = np.ndarray
"""Frames (frames, height, width, 3), uint8."""


def _options() -> dict[str, object]:
    return {"face": ",".join(map(str, FACE)), "focal-px": FOCAL_PX, "gamma": GAMMA, "size": 64}


@dataclass(frozen=True)
class Shot:
    """A film, and the options that its owner gives; None leaves one out."""

    codes: Codes
    options: dict[str, object] = field(default_factory=dict)

    @property
    def arguments(self) -> list[object]:
        """Of the command line."""
        given = (_options() | self.options).items()
        return [part for name, value in given if value is not None for part in (f"--{name}", value)]


def circle(x: float, y: float, radius: float) -> np.ndarray:
    """Mask (height, width)."""
    rows, columns = np.mgrid[: SIZE[1], : SIZE[0]]
    return np.asarray(np.hypot(columns + 0.5 - x, rows + 0.5 - y) < radius)


def brighter(codes: Codes, factor: np.ndarray | float) -> Codes:
    """With so much more light, all over or (frames, …)."""
    return np.asarray(np.clip(codes * np.asarray(factor) ** (1 / GAMMA), 0, 255).round().astype(np.uint8))


def partly_lit(codes: Codes, fraction: np.ndarray) -> Codes:
    """Of a bright frame this fraction (frames, rows or 1), the rest of a dark one."""
    bright, dark = ((codes[kind][0] / 255) ** GAMMA for kind in (LIT == 1, LIT == 0))
    light = dark + fraction[..., None, None] * (bright - dark)
    return np.asarray(np.round(255 * light.clip(0, 1) ** (1 / GAMMA)).astype(np.uint8))


def lamp_off(codes: Codes) -> Shot:
    return Shot(np.repeat(codes[LIT == 0][:1], 60, axis=0))


def lamp_on_all_the_time(codes: Codes) -> Shot:
    swing = 0.6 + 0.4 * np.sin(2 * np.pi * 0.3 * np.arange(100) / 30)
    return Shot(brighter(np.repeat(codes[LIT == 1][:1], 100, axis=0), swing[:, None, None, None]))


def too_short(codes: Codes) -> Shot:
    return Shot(codes[:24])


def too_fast(codes: Codes) -> Shot:
    """Twelve flashes a second, each exposing some rows only."""
    _, fractions = blinking(Blinking(hz=12, seconds=3))
    return Shot(partly_lit(codes, fractions[:, np.arange(SIZE[1]) * fractions.shape[1] // SIZE[1]]))


def mostly_weak(codes: Codes) -> Shot:
    """The lamp mostly points elsewhere."""
    strength = np.repeat([1, 1, 0.1, 1, 0.1, 1, 0.1, 1, 0.1, 1], 6)
    return Shot(partly_lit(codes, (strength * np.tile([1, 0.4, 0, 0, 0, 0], 10))[:, None]))


def no_ball(codes: Codes) -> Shot:
    without = codes[:60].copy()
    without[:, 30:110, 150:240] = codes[:60, 30:110, 0:90]
    return Shot(without)


def ball_cut_off(codes: Codes) -> Shot:
    return Shot(codes[:60, :, :194])


def named_ball_cut_off(codes: Codes) -> Shot:
    return Shot(codes[:60], {"ball": f"{SIZE[0] - 10},70,30"})


def ball_over_exposed(codes: Codes) -> Shot:
    white = codes[:60].copy()
    white[:, circle(190.6, 69, 30)] = 255
    return Shot(white)


def one_ball_of_two(codes: Codes) -> Shot:
    return Shot(codes[:60], {"balls": 2})


def lamp_of_the_phone(codes: Codes) -> Shot:
    return Shot(Film(frames=60, azimuth=(-8, 8), elevation=(-8, 8)).codes(), {"ball": NAMED_BALL})


def lamp_on_one_side(codes: Codes) -> Shot:
    return Shot(Film(frames=60, azimuth=(50, 66), elevation=(-8, 8)).codes(), {"ball": NAMED_BALL})


def few_directions(codes: Codes) -> Shot:
    return Shot(codes[:75], {"ball": NAMED_BALL})


def narrow_sweep(codes: Codes) -> Shot:
    return Shot(Film(frames=170, azimuth=(-25, 25), elevation=(-9, 9)).codes(), {"ball": NAMED_BALL})


def enhanced(codes: Codes) -> Shot:
    """Now the left is made brighter, now the right."""
    swing = 0.6 * np.sin(np.arange(60) / 7)[:, None] * np.linspace(-1, 1, SIZE[0])
    return Shot(brighter(codes[:60], np.exp(swing)[:, None, :, None]), {"ball": NAMED_BALL})


def walked_away(codes: Codes) -> Shot:
    gone = codes.copy()
    gone[70:, 90:] = np.median(codes[70:, 20:60, :60], axis=(1, 2))[:, None, None]
    return Shot(gone, {"ball": NAMED_BALL})


def _black_when_dark(codes: Codes, since: int = 0) -> Codes:
    """The person is black in the dark frames from that index on."""
    black = codes.copy()
    for index in np.flatnonzero(LIT == 0):
        if index >= since:
            black[index] *= ~GOOD.surface[2][..., None]
    return black


def black_without_the_flash(codes: Codes) -> Shot:
    """But for the first three dark frames."""
    return Shot(_black_when_dark(codes, since=6), {"ball": NAMED_BALL})


def black_about_a_small_circle(codes: Codes) -> Shot:
    """The film begins without the flash; the circle that is given holds nothing but black."""
    black = _black_when_dark(codes)[int(np.argmin(LIT)) :][:60]
    return Shot(black, {"ball": NAMED_BALL, "face": f"{HEAD[0]},{HEAD[1]},30"})


def nobody(codes: Codes) -> Shot:
    """The lamp lights a strip along the floor; nobody names the face's place."""
    floor = codes.copy()
    floor[:, 90:] = np.median(codes[LIT == 0][:, 90:, :60], axis=(0, 2))[:, None]
    floor[LIT == 1, 285:] = 150
    return Shot(floor[:60], {"ball": NAMED_BALL, "face": None})


def drop_before_the_ball(codes: Codes) -> Shot:
    """Water on the lens blurs the ball's lower third; the camera's focal length is not known.

    So the ball is found without doubt, while the evidence of its outline is well below what is enough.
    """
    wet = codes.copy()
    for frame in wet:
        frame[80:120, 150:] = cv2.GaussianBlur(frame, (0, 0), 4)[80:120, 150:]
    return Shot(wet, {"focal-px": None, "method": "nearest"})


def sun_on_the_face(codes: Codes) -> Shot:
    """The face is white by the room's light, but for brows and eyes; the camera opens up a little at each flash."""
    sunny = brighter(codes, np.where(LIT > 0, 1.1, 1.0)[:, None, None, None])
    sunny[:, circle(*FACE)] = 255
    for row in (135, 147, 162):
        for column in (85, 98, 112, 125):
            sunny[:, circle(column, row, 2.5)] = 20
    return Shot(sunny, {"ball": NAMED_BALL, "face": f"{HEAD[0]},{HEAD[1]},26"})
