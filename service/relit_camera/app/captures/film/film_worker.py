"""What the worker process of a capture from a film does; its imports come late, so that it starts sooner."""

from __future__ import annotations

import logging
from pathlib import Path

from relit_camera.base.concurrency.worker_process import Progress
from relit_camera.base.images.image_types import LinearImage
from relit_camera.live.status.film_status import FilmOptions, FilmReport
from relit_camera.subject.subject import Subject

log = logging.getLogger(__name__)

DRAWING = "Drawing first pictures"
ENVIRONMENTS = ("studio", "sunset", "night-street")
LAMPS = {"lamp-from-the-left": (-60.0, 20.0), "lamp-from-the-right": (60.0, 20.0)}
"""Names of pictures → azimuth and elevation of the one lamp, in degrees."""
JPEG_QUALITY = 90


def write_film_subject(
    film: Path, file_name: str, options: FilmOptions, folder: Path, path: Path, tell: Progress
) -> FilmReport:
    """Build a subject of a film and write its file, and pictures of it.

    Args:
        film: the file.
        file_name: what it was called when it was sent.
        options: how to read it.
        folder: of the checkpoint, and of a folder `pictures`.
        path: of the subject's file.
        tell: told the stage, what of it is done, and its total.

    Returns:
        What the person should know; its pictures are names of files.

    Raises:
        VideoError, CaptureError: the film does not show what is needed; the message says what to do.
        InputError: an option is impossible.
        StorageError: a file cannot be written.
    """
    from relit_camera.app.captures.film.film_coda import with_coda_stills
    from relit_camera.app.captures.film.film_report import film_report
    from relit_camera.capture.film.pipeline.checkpoint import CheckpointFolder, input_fingerprint
    from relit_camera.capture.film.pipeline.film_subject import build_film_subject
    from relit_camera.subject.subject_file import write_subject

    read = _capture_options(options)
    checkpoints = CheckpointFolder(folder / "subject.relit", input_fingerprint(film, read), log.info)
    with checkpoints.keep_until_done():
        subject, told = build_film_subject(film, read, checkpoints, tell, source=file_name)
        subject, coda = with_coda_stills(film, file_name, told, subject, tell)
        write_subject(path, subject)
    tell(DRAWING, 0, None)
    return film_report(told, subject.metadata, draw_pictures(subject, folder / "pictures"), coda)


def draw_pictures(subject: Subject, folder: Path) -> list[str]:
    """Write JPEG files of the subject in some places and under one lamp; returns their names without suffix.

    Raises:
        StorageError: they cannot be written.
    """
    from relit_camera.base.images.image_files import encode_display
    from relit_camera.base.images.tone_mapping import display_from_linear
    from relit_camera.base.storage.atomic_files import make_folder, write_atomic
    from relit_camera.capture.reflectance.directional_light import relight_from_direction
    from relit_camera.light.directions import direction_from_degrees
    from relit_camera.light.environments.builtin.builtin_light_maps import builtin_light_map
    from relit_camera.light.exposure import auto_exposure_scale
    from relit_camera.subject.relighting.basis_relighter import BasisRelighter

    make_folder(folder, private=True)
    relighter, written = BasisRelighter(subject), []

    def draw(name: str, linear: LinearImage, scale: float) -> None:
        shown = display_from_linear(linear * (scale * subject.metadata.display_gain))
        write_atomic(folder / f"{name}.jpg", encode_display(shown, ".jpg", JPEG_QUALITY))
        written.append(name)

    for name in ENVIRONMENTS:
        light = builtin_light_map(name)
        draw(name, relighter.relight(light[None])[0], auto_exposure_scale(light))
    for name, (azimuth, elevation) in LAMPS.items():
        draw(name, relight_from_direction(subject, direction_from_degrees(azimuth, elevation)), 1.0)
    return written


def _capture_options(options: FilmOptions):  # type: ignore[no-untyped-def]
    from relit_camera.capture.film.ball.sphere_projection import BallOutline
    from relit_camera.capture.film.face_circle import FaceCircle
    from relit_camera.capture.film.pipeline.capture_options import CaptureOptions

    return CaptureOptions(
        size=options.size,
        focal_px=options.focal_px,
        balls=2 if options.second_ball else options.balls,
        ball=BallOutline(*options.ball) if options.ball else None,
        second_ball=BallOutline(*options.second_ball) if options.second_ball else None,
        face=FaceCircle(*options.face) if options.face else None,
        ball_diameter_cm=options.ball_diameter_cm,
        light_distance_cm=options.light_distance_cm,
    )
