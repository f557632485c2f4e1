"""Hard lamps all round a known person, as each rung shows them: `python -m tests.lone_lamps LIGHTS.lp --out DIR`.

`LIGHTS.lp` lists pictures of a person from all directions: the truth. Subjects are made as `relit evaluate ladder`
makes them, and measured as they are, and with light from behind softened as `instant` has it. Printed is PSNR in dB:
medians of lamps by their angle from the camera; means in the built-in places, turned by eighths, by the share of their
light that comes from behind, and the rank correlation of that share with the decibels. First of displayed pictures,
with the one gain of light that brings each nearest (under a lamp the truth's 99th percentile is shown at 0.8); in
brackets of linear light, one gain a channel, the truth's 99.5th percentile as 1.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray
from scipy.stats import spearmanr

from relit_camera.base.concurrency.threads import limit_threads
from relit_camera.base.config.look import Lamp, Lighting
from relit_camera.base.images.tone_mapping import display_from_linear
from relit_camera.capture.instant import instant_capture
from relit_camera.capture.instant.back_light import soften_back_light
from relit_camera.capture.picture_import import import_samples
from relit_camera.face.tracking.trackers import TrackerOptions, open_tracker
from relit_camera.lab.evaluate.ladder.known_person import KnownPerson, SubjectFolder, known_person
from relit_camera.lab.evaluate.ladder.ladder_evaluation import in_frame_of
from relit_camera.lab.evaluate.ladder.ladder_metrics import Pictures, field_figures, shown_psnr
from relit_camera.lab.evaluate.ladder.ladder_rungs import RUNGS
from relit_camera.lab.evaluate.ladder.live_ratio import follow
from relit_camera.lab.evaluate.ladder.webcam_frames import film_in_room
from relit_camera.light.directions import spherical_from_direction, texel_directions
from relit_camera.light.environments.builtin.builtin_environments import BUILTIN_NAMES, builtin_environment
from relit_camera.light.light_map import LightMap
from relit_camera.light.scene_light import lamp_light_map
from relit_camera.live.scene.light_transition import display_light
from relit_camera.subject.measured_light import share_of_light
from relit_camera.subject.relighting.basis_relighter import BasisRelighter
from relit_camera.subject.subject import Subject

ROOM = "overcast"
"""In which the person sits who is captured instantly."""
LAMP_DEG = 2.0
BANDS = (0, 30, 60, 90, 105, 120, 150, 180)
MOSTLY = 0.6
"""Share of a place's light from behind that counts as most of it."""
WITH_OWN_FRAME = ("instant", "laptop", "desk")


def variants(name: str, subject: Subject) -> Iterator[tuple[str, Subject]]:
    """The subject of a rung, and the softened one."""
    yield name, subject
    yield f"{name}, softened", replace(subject, coefficients=soften_back_light(subject.coefficients))


def figures(pictures: Pictures, truth: Pictures, counted: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Displayed and linear PSNR (2, count) of pictures (count, height, width, 3)."""
    pairs = list(zip(pictures, truth, strict=True))
    shown = [shown_psnr(display_from_linear(picture), true, counted) for picture, true in pairs]
    linear = [field_figures(picture[None], true[None], counted).white_balanced_db[0] for picture, true in pairs]
    return np.array([shown, linear])


def lamp_maps(directions: NDArray[np.float64]) -> LightMap:
    """Light maps (lights, 32, 64, 3) of a lamp each."""
    azimuth, elevation = np.degrees(spherical_from_direction(directions))
    lamps = [
        Lamp(azimuth_deg=float(a), elevation_deg=float(e), size_deg=LAMP_DEG, intensity=1)
        for a, e in zip(azimuth, elevation, strict=True)
    ]
    return np.stack([lamp_light_map([lamp]) for lamp in lamps])


def measure(person: KnownPerson, subjects: SubjectFolder) -> None:
    """Print the figures of each rung."""
    tracker = open_tracker("mesh", TrackerOptions(blendshapes=False))
    frames = film_in_room(person, builtin_environment(ROOM), 12)
    followed = follow(frames.frames, tracker)[-1]
    turned = [
        display_light(builtin_environment(name), Lighting(yaw_deg=yaw))
        for name in BUILTIN_NAMES
        for yaw in range(-180, 180, 45)
    ]
    from_behind = np.array([share_of_light(each, texel_directions()[..., 2] < 0) for each in turned])
    maps = np.concatenate([lamp_maps(person.samples.directions), np.stack(turned)])
    truth = np.concatenate([person.samples.pictures, person.relighter.relight(np.stack(turned))])
    angle = np.degrees(np.arccos(np.clip(person.samples.directions[:, 2], -1, 1)))
    lamps = len(angle)
    bright = np.percentile(truth[:lamps, person.counted], 99, axis=(1, 2))
    # Places are in display exposure already.
    exposure = np.concatenate([0.8 / np.maximum(bright, 1e-4), np.ones(len(turned))])[:, None, None, None]
    exposure = exposure.astype(np.float32)
    bands = list(pairwise(BANDS))
    chosen = [(angle >= low) & (angle < high) for low, high in bands]
    heads = [f"{low} to {high}" for low, high in bands]
    print(
        "| | " + " | ".join([*heads, f"places, {100 * MOSTLY:.0f} % from behind", "others", "rank correlation"]) + " |"
    )
    for name in ("desk", "laptop", "instant", "film"):
        for how, subject in variants(name, RUNGS[name].build(person, frames, subjects)):
            pictures = BasisRelighter(subject).relight(maps)
            if name in WITH_OWN_FRAME:
                pictures = in_frame_of(person, subject, pictures, truth, followed, tracker.scheme)
            found = figures(pictures * exposure, truth * exposure, person.counted)
            cells = [np.median(found[:, :lamps][:, each], axis=1) for each in chosen]
            places = found[:, lamps:]
            cells += [places[:, from_behind >= MOSTLY].mean(axis=1), places[:, from_behind < MOSTLY].mean(axis=1)]
            told = [how, *(f"{shown:.1f} [{linear:.1f}]" for shown, linear in cells)]
            told.append(f"{spearmanr(from_behind, places[0]).statistic:.2f}")
            print(f"| {' | '.join(told)} |", flush=True)


def main() -> None:
    """See the module."""
    parser = argparse.ArgumentParser(prog="python -m tests.lone_lamps", description=__doc__)
    parser.add_argument("lights", type=Path)
    parser.add_argument("--out", type=Path, help="folder where subjects are kept that take long")
    parser.add_argument("--size", type=int, default=128, help="longer side to which known pictures are reduced")
    options = parser.parse_args()
    limit_threads()
    subjects = SubjectFolder(options.out and options.out / "subjects")
    name = options.lights.resolve().parent.name
    person = known_person(name, import_samples(options.lights), options.size, subjects)
    with patch.object(instant_capture, "soften_back_light", lambda coefficients: coefficients):  # softened here instead
        measure(person, subjects)


if __name__ == "__main__":
    main()
