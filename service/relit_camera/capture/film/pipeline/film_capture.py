"""From a film to samples, unattended: the stages of a capture in order (thesis 4.3).

The film is read five times and never held in memory.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from relit_camera.base.errors import ModelError
from relit_camera.base.images.color import Gamma
from relit_camera.base.video.video_readers import LinearVideoFrame, LinearVideoReader
from relit_camera.capture.film.ball.ball_detection import find_balls
from relit_camera.capture.film.ball.frame_sample import MAX_FRAMES, FrameSample, sample_frames
from relit_camera.capture.film.face_localization import LocatedFace, locate_face, require_face_in_picture
from relit_camera.capture.film.flash.flash_end import count_flashing_frames
from relit_camera.capture.film.flash.flash_signal import measure_brightness
from relit_camera.capture.film.flash.frame_classification import Flashes, FrameClass, detect_flashes
from relit_camera.capture.film.focal_length import known_focal_length
from relit_camera.capture.film.lamp.capture_layout import estimate_capture_layout, eye_distance_from_face
from relit_camera.capture.film.lamp.lamp_localization import locate_lamps
from relit_camera.capture.film.lamp.light_coverage import require_light_coverage
from relit_camera.capture.film.olat.camera_gains import require_uniform_gains
from relit_camera.capture.film.olat.flash_matte import estimate_flash_matte, require_face_in_matte
from relit_camera.capture.film.olat.flash_strength import (
    downsample_for_strengths,
    estimate_flash_strengths,
    misfit_under_distant_lamps,
)
from relit_camera.capture.film.olat.head_crop import place_head_crop
from relit_camera.capture.film.olat.light_clustering import (
    cluster_lights,
    merge_lights,
    subsample_cluster,
    subsample_evenly,
)
from relit_camera.capture.film.olat.olat_pictures import (
    max_pictures_in_memory,
    read_olat_pictures,
    require_size_in_memory,
)
from relit_camera.capture.film.pipeline.capture_options import CaptureOptions, Progress, no_progress
from relit_camera.capture.film.pipeline.capture_report import CaptureFindings
from relit_camera.capture.film.pipeline.film_measurement import UsableFrames, measure_film
from relit_camera.capture.film.stabilization.film_stabilization import stabilize_film
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from relit_camera.face.detection.face_detector import FaceDetector
from relit_camera.face.detection.installed_detector import open_face_detector

FLASHES = "Looking for flashes"
BALL = "Looking for the mirror ball"
FACE = "Following the face"
LIGHT = "Looking at the light"
PICTURES = "Cutting out the flash's light"
PERSON = "Finding the person"
STAGES = (FLASHES, BALL, FACE, LIGHT, PICTURES, PERSON)
"""Names of the stages that are told as progress, in their order."""

_BALL_REACH = 1.15
"""Radii about a ball within which the person cannot be."""


@dataclass(frozen=True, eq=False)
class CaptureResult:
    """What a film gave.

    Attributes:
        samples: aligned pictures of the person under one distant light each.
        findings: results of all stages, for the report.
    """

    samples: OlatSamples
    findings: CaptureFindings


def build_samples(
    video: Path, options: CaptureOptions | None = None, progress: Progress = no_progress
) -> CaptureResult:
    """Build samples from a capture film.

    Raises:
        VideoError: the film cannot be read, is cut off or damaged, or shows no face.
        CaptureError: something is missing in it; the message says what to do differently.
        InputError: an option is impossible.
    """
    options = options or CaptureOptions()
    given_balls = [ball for ball in (options.ball, options.second_ball) if ball is not None]
    require_size_in_memory(options.size)
    if options.face:
        require_face_in_picture(options.face, video)

    # Flashes: which frames the lamp lit.
    brightness = measure_brightness(
        video, options.gamma, threads=options.threads, progress=_reporter(progress, FLASHES)
    )
    flashing = count_flashing_frames(brightness)
    coda = flashing if flashing < len(brightness.times_s) else None
    if coda is not None:
        brightness = measure_brightness(video, options.gamma, threads=options.threads, most=coda)
    flashes = detect_flashes(brightness)
    total = len(flashes.frames)

    # Mirror balls, whose outlines correct the focal length.
    progress(BALL, 0, None)
    sample = _sample_frames(video, flashes, options.gamma, options.threads)
    focal = known_focal_length(video, brightness.size, options.focal_px)
    balls = find_balls(sample, focal, options.balls, given_balls)

    # Face: where it is, and how it moves.
    face = LocatedFace(options.face, "user") if options.face else locate_face(brightness, flashes)
    motion = stabilize_film(
        video,
        flashes,
        face.circle,
        threads=options.threads,
        progress=_reporter(progress, FACE, total),
    )
    usable = UsableFrames.from_flashes(flashes, motion.lost)

    # Camera gains, highlights on the balls, distance of the eyes.
    detector = _installed_detector()
    with LinearVideoReader(
        video, options.gamma, only=frozenset(usable.all.tolist()), threads=options.threads
    ) as reader:
        film = _reporting(reader, _reporter(progress, LIGHT, total))
        observed = measure_film(film, usable, flashes, balls, sample, detector)
    gains = observed.gains
    require_uniform_gains(gains.spread)
    del sample  # tens of megabytes that no later stage needs

    # Lamp: where it was, seen from the head.
    layout = estimate_capture_layout(
        [ball.view for ball in observed.balls],
        (motion.circle.x, motion.circle.y),
        observed.eyes_px or eye_distance_from_face(motion.circle.radius),
        None if options.ball_diameter_cm is None else options.ball_diameter_cm / 2,
    )
    lamps = locate_lamps(observed.balls, usable.bright, flashes.times_s, layout, options.light_distance_cm)
    require_light_coverage(lamps.directions, len(usable.bright))

    # OLAT pictures: the head under one flash each, without the room's light.
    crop = place_head_crop(motion.circle, brightness.size, options.size)
    kept = subsample_evenly(lamps.directions, max_pictures_in_memory(crop.size))
    directions, lamps_cm = lamps.directions[kept], lamps.lamps_cm[kept]
    subtract = gains.can_subtract_room if options.subtract_room is None else options.subtract_room
    olat = read_olat_pictures(
        video,
        options.gamma,
        crop,
        dict(enumerate(motion.transforms)),
        dict(zip(usable.all.tolist(), gains.rgb, strict=True)),
        lamps.index[kept],
        usable.dark,
        subtract=subtract,
        threads=options.threads,
        progress=_reporter(progress, PICTURES, total),
    )

    # Matte: the person, without the balls.
    progress(PERSON, 0, None)
    discs = [crop.disc(ball.x, ball.y, _BALL_REACH * ball.radius) for ball in (each.outline for each in balls)]
    matte = estimate_flash_matte(olat.pictures, olat.room, np.logical_or.reduce(discs))
    require_face_in_matte(matte, crop.disc(*motion.circle))

    # Strengths of the flashes, with the person's rough shape.
    small = downsample_for_strengths(olat.pictures, matte)
    x, y = crop.to_crop(motion.circle.x, motion.circle.y)
    head, pixels_per_cm = (x * small.scale, y * small.scale), layout.pixels_per_cm * crop.scale * small.scale
    evidence = (small.pictures, lamps_cm, small.matte, head, pixels_per_cm)
    strengths = estimate_flash_strengths(*evidence, measured=lamps.measured)
    misfit_if_far = misfit_under_distant_lamps(*evidence, measured=lamps.measured)
    good = strengths.consistent()
    require_light_coverage(directions[good], len(usable.bright))

    # Samples: pictures under nearly the same light merged, each as under a distant lamp.
    clusters = [subsample_cluster(good[cluster]) for cluster in cluster_lights(directions[good])]
    pictures = merge_lights(olat.pictures, strengths, clusters, matte, near_field=options.near_field)
    means = np.stack([directions[cluster].mean(axis=0) for cluster in clusters])
    means /= np.linalg.norm(means, axis=1, keepdims=True)
    findings = CaptureFindings(
        video=video.name,
        size=brightness.size,
        flashes=flashes,
        face=face,
        motion=motion,
        usable=usable,
        gains=gains,
        balls=observed.balls,
        focal=balls[-1].focal,
        detector_installed=detector is not None,
        eyes_px=observed.eyes_px,
        layout=layout,
        lamps=lamps,
        light_distance_cm=options.light_distance_cm,
        crop=crop,
        room_subtracted=subtract,
        near_field=options.near_field,
        kept=lamps.index[kept],
        strengths=strengths,
        misfit_if_far=misfit_if_far,
        good=good,
        lights=len(clusters),
        coda=coda,
    )
    return CaptureResult(OlatSamples(pictures, means, matte), findings)


def _reporter(progress: Progress, stage: str, total: int | None = None) -> Callable[[int], None]:
    """A callback of the number of frames done in a stage."""
    return lambda done: progress(stage, done, total)


def _reporting(frames: Iterable[LinearVideoFrame], report: Callable[[int], None]) -> Iterator[LinearVideoFrame]:
    """The frames, each reported as done when the next one is asked for."""
    for frame in frames:
        yield frame
        report(frame.index + 1)


def _sample_frames(video: Path, flashes: Flashes, gamma: Gamma, threads: int) -> FrameSample:
    """As many dark frames as bright ones, spread over the film."""
    half = MAX_FRAMES // 2
    picked = [
        indices[:: max(1, -(-len(indices) // half))]
        for indices in map(flashes.indices, (FrameClass.BRIGHT, FrameClass.DARK))
    ]
    only = frozenset(np.concatenate(picked).tolist())
    with LinearVideoReader(video, gamma, only=only, threads=threads) as reader:
        return sample_frames(frame.image for frame in reader)


def _installed_detector() -> FaceDetector | None:
    """The face detector; None where it is not installed, which the report's warnings say."""
    try:
        return open_face_detector()
    except ModelError:
        return None
