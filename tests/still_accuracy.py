"""Measures mode portrait with a subject's expression stills and without, and mode live beside it, against the same
performance rendered in that light: `python -m tests.still_accuracy SUBJECT DRIVER TRUTH --environment NAME [--sheet
FILE.png]`.

DRIVER is the clip that drives, TRUTH a clip of the same frames in the light of the environment, with `matte.mp4` beside
it. The reenacted head is placed by relative motion, so each region is aligned by its landmarks before it is compared,
where the truth shows the person. One gain a frame.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.app.wiring import make_pipeline, make_tracker
from relit_camera.base.concurrency.threads import limit_threads
from relit_camera.base.config.look import Look, Mode
from relit_camera.base.config.settings import RelitSettings, TrackerSettings
from relit_camera.base.images.image_files import write_display
from relit_camera.base.images.image_quality import ssim
from relit_camera.base.images.image_types import DisplayImage, Frame
from relit_camera.base.images.resize import letterbox
from relit_camera.base.rotations import angles_from_rotation
from relit_camera.base.video.video_readers import VideoReader
from relit_camera.cli.arguments import parse_background, parse_lighting
from relit_camera.face.face_state import FaceState
from relit_camera.face.landmarks.landmark_schemes import LandmarkScheme, landmark_scheme
from relit_camera.face.tracking.trackers import open_tracker
from relit_camera.lab.evaluate.video.moving_face_accuracy import codes_psnr, with_best_gain
from relit_camera.live.modes.ratio_relighting import fit_similarity
from relit_camera.live.scene.scene_controller import SceneController
from relit_camera.subject.subject import Subject
from relit_camera.subject.subject_file import read_subject, write_subject

OPEN_MOUTH, SHUT_EYE, TURNED_DEG = 0.1, 0.13, (22.0, 40.0)
"""What the truth must show for a frame to count: least opening of the mouth, most of the eyes, and yaw."""
RIMS = {"open mouth": 0.1, "shut eyes": 0.3, "far half": -0.06, "near half": -0.06, "face": -0.06}
"""By how much each region reaches beyond the hull of its landmarks, in parts of its smaller side. Where it ends at the
face's outline, that does not count: outlines that differ by a pixel would be all of the error."""
IDENTITY = "face, SSIM"
"""Whether it is still the same person: how alike the structure of the aligned face is, in luma."""
SIDE_PX = 200
"""Width of a face in which regions are compared."""
PERSON = 200
"""Code of the truth's matte, of 255, from which a pixel counts: behind the far cheek a turned face's regions take in
some of the background, which in TRUTH is the environment."""
WAYS = ("plain", "stills", "live")
"""Mode portrait without stills and with them, and mode live."""


@dataclass(frozen=True)
class Run:
    """One way of showing a clip.

    Attributes:
        pictures: of all frames.
        states: the face in each, as the public tracker finds it there.
    """

    pictures: list[DisplayImage]
    states: list[FaceState]


def track(pictures: list[DisplayImage]) -> list[FaceState]:
    """The face in each picture; each is looked at twice, for slow clips jump."""
    tracker = open_tracker("mesh")
    states = []
    for index, picture in enumerate(pictures):
        for repeat in range(2):
            state = tracker.track(Frame(picture, index, index / 30, (2 * index + repeat) / 60))
        states.append(state)
    return states


def relit(subject: Path, clip: Path, environment: str, mode: Mode) -> list[DisplayImage]:
    """The clip in a mode, no background."""
    settings = RelitSettings().model_copy(update={"tracker": TrackerSettings(name="mesh")})
    controller = SceneController(settings.storage)
    controller.load_configured_subject(str(subject))
    controller.set_avatar_allowed(True)
    lighting = parse_lighting(controller.register_temporary_environment(environment), "0,0,0", 0.0)
    controller.set_look(Look(lighting=lighting, background=parse_background("none"), mode=mode))
    tracker = make_tracker(settings)
    pictures = []
    with VideoReader(clip) as frames:
        pipeline = make_pipeline(settings, tracker, (frames.info.width, frames.info.height))
        try:
            pictures = [pipeline.process(frame, controller.scene).image for frame in frames]
        finally:
            pipeline.close()
    return pictures


def regions(state: FaceState, scheme: LandmarkScheme) -> dict[str, list[int]]:
    """The regions that count in a frame of the truth, as landmarks."""
    assert state.pose is not None
    yaw = angles_from_rotation(state.pose.rotation).yaw
    found: dict[str, list[int]] = {"face": list(range(468))}
    if state.mouth > OPEN_MOUTH:
        found["open mouth"] = list(scheme.lips)
    if max(state.eyes) < SHUT_EYE:
        found["shut eyes"] = [*scheme.right_eye.lids, *scheme.left_eye.lids]
    if TURNED_DEG[0] <= abs(yaw) <= TURNED_DEG[1]:
        far = scheme.canonical[:468, 0] * np.sign(yaw)
        found["far half"] = list(np.flatnonzero(far > 0.3))
        found["near half"] = list(np.flatnonzero(far < -0.3))
    return found


def crop(
    picture: DisplayImage, landmarks: NDArray[np.floating], onto: NDArray[np.floating], size: tuple[int, int]
) -> DisplayImage:
    """A picture, moved so that its landmarks come to lie on others of a crop of `size` (width, height)."""
    affine = fit_similarity(landmarks.astype(np.float64), onto)
    return np.asarray(
        cv2.warpAffine(picture, affine, size, flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE), np.uint8
    )


def compare(
    truth: Run, mattes: list[DisplayImage], runs: dict[str, Run]
) -> tuple[dict[tuple[str, str], list[float]], list[NDArray[np.uint8]]]:
    """PSNR in dB by region and way, a value a frame, and the SSIM of the face; and rows of a contact sheet.

    A row shows the truth, then each way.
    """
    scheme = landmark_scheme(truth.states[0].scheme)
    found: dict[tuple[str, str], list[float]] = {}
    rows = []
    for index, state in enumerate(truth.states):
        if not (state.visible and all(run.states[index].visible for run in runs.values())):
            continue
        scale = SIDE_PX / float(np.ptp(state.landmarks[:, 0]))
        for name, members in regions(state, scheme).items():
            place = scale * state.landmarks[members]
            margin = 0.15 * float(np.ptp(place[:, 0]))
            low = place.min(axis=0) - margin
            width, height = (int(side) for side in np.ceil(place.max(axis=0) + margin - low))
            onto = place - low
            want, matte = (
                crop(each[index], state.landmarks[members], onto, (width, height)) for each in (truth.pictures, mattes)
            )
            mask = np.zeros((height, width), np.uint8)
            cv2.fillConvexPoly(mask, cv2.convexHull(np.round(onto).astype(np.int32)), 1)
            side = RIMS[name] * min(width, height)
            reach = max(round(abs(side)), 1)
            grown = (cv2.dilate if side > 0 else cv2.erode)(mask, np.ones((2 * reach + 1, 2 * reach + 1), np.uint8))
            inside = (grown > 0) & (matte[..., 0] > PERSON)
            if not inside.any():
                continue
            shown = [want]
            for way, run in runs.items():
                got = crop(run.pictures[index], run.states[index].landmarks[members], onto, (width, height))
                got = with_best_gain(got, want, inside)
                found.setdefault((name, way), []).append(codes_psnr(got, want, inside))
                if name == "face":
                    found.setdefault((IDENTITY, way), []).append(ssim(got, want, inside.astype(np.float32)))
                shown.append(got)
            if name != "face":
                pieces = [letterbox(each, (240, 160), (0, 0, 0), cv2.INTER_CUBIC) for each in shown]
                row = np.hstack(pieces)
                values = " ".join(f"{found[name, way][-1]:.1f}" for way in runs)
                cv2.putText(row, f"{index} {name} {values}", (4, 14), cv2.FONT_HERSHEY_SIMPLEX, 0.45, (255, 255, 0))
                rows.append(row)
    return found, rows


def clip_pictures(clip: Path) -> list[DisplayImage]:
    """All pictures of a clip."""
    with VideoReader(clip) as frames:
        return [frame.image for frame in frames]


def following(driver: list[FaceState], run: Run) -> tuple[float, float]:
    """Correlation with the driver's of the opening of mouth and eyes, as the tracker finds them."""
    pairs = [(a, b) for a, b in zip(driver, run.states, strict=True) if a.visible and b.visible]
    mouth = np.corrcoef([a.mouth for a, _ in pairs], [b.mouth for _, b in pairs])[0, 1]
    eyes = np.corrcoef([sum(a.eyes) for a, _ in pairs], [sum(b.eyes) for _, b in pairs])[0, 1]
    return float(mouth), float(eyes)


def main() -> None:
    """See the module."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("subject", type=Path)
    parser.add_argument("driver", type=Path)
    parser.add_argument("truth", type=Path)
    parser.add_argument("--environment", default="sunset")
    parser.add_argument("--sheet", type=Path)
    args = parser.parse_args()
    limit_threads()
    plain = args.subject.with_suffix(".plain.relit")
    whole: Subject = read_subject(args.subject)
    write_subject(plain, replace(whole, stills=()))
    try:
        truth, driver = (clip_pictures(clip) for clip in (args.truth, args.driver))
        mattes = clip_pictures(args.truth.with_name("matte.mp4"))
        subjects, modes = (plain, args.subject, args.subject), (Mode.PORTRAIT, Mode.PORTRAIT, Mode.LIVE)
        shown = {
            way: relit(subject, args.driver, args.environment, mode)
            for way, subject, mode in zip(WAYS, subjects, modes, strict=True)
        }
    finally:
        plain.unlink(missing_ok=True)
    runs = {way: Run(pictures, track(pictures)) for way, pictures in shown.items()}
    found, rows = compare(Run(truth, track(truth)), mattes, runs)
    print(f"{'region':12s} frames {'  '.join(f'{way:>6s}' for way in WAYS)}")
    for name in (*RIMS, IDENTITY):
        if (name, "plain") in found:
            digits = 3 if name == IDENTITY else 2
            means = "  ".join(f"{np.mean(found[name, way]):6.{digits}f}" for way in WAYS)
            print(f"{name:12s} {len(found[name, 'plain']):6d} {means}")
    driven = track(driver)
    for way, run in runs.items():
        mouth, eyes = following(driven, run)
        print(f"{way}: follows the driver's mouth with r = {mouth:.3f}, eyes {eyes:.3f}")
    if args.sheet and rows:
        columns = 2
        rows += [np.zeros_like(rows[0])] * (-len(rows) % columns)
        write_display(args.sheet, np.vstack([np.hstack(rows[i : i + columns]) for i in range(0, len(rows), columns)]))


if __name__ == "__main__":
    main()
