"""`relit evaluate`: accuracy of fields, captures and relit videos against known truth."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

    from relit_camera.base.images.image_types import Mask
    from relit_camera.capture.reflectance.olat_samples import OlatSamples

app = typer.Typer(no_args_is_help=True)

Out = Annotated[Path | None, typer.Option(help="Report to write: one .html file, pictures embedded.")]
AsJson = Annotated[bool, typer.Option("--json", help="Machine-readable figures on stdout.")]
GammaText = Annotated[str, typer.Option("--gamma", help="Curve of the pictures: srgb, linear, or an exponent.")]
WithinDegrees = Annotated[
    float | None, typer.Option(help="Use lights within this many degrees of the camera's axis.", min=1, max=180)
]
Methods = Annotated[list[str] | None, typer.Option("--method", help="Reflectance method; all that are installed.")]


@app.callback()
def group() -> None:
    """Measure fields and relit videos against truth."""


@app.command()
def field(
    context: typer.Context,
    subject_or_lights: Annotated[
        str, typer.Argument(help="Captured lights (.lp), or a subject's name or .relit file.")
    ],
    truth: Annotated[Path, typer.Option(help="Lights (.lp) from directions all round, of the same person.")],
    out: Out = None,
    as_json: AsJson = False,
    gamma: GammaText = "srgb",
    within_deg: WithinDegrees = None,
    every: Annotated[int, typer.Option(help="Use every N-th of the captured lights.", min=1)] = 1,
    method: Methods = None,
    environment: Annotated[
        list[str] | None, typer.Option(help="Stored name or panorama file; the built-in ones if none is given.")
    ] = None,
    pixel: Annotated[
        list[str] | None, typer.Option(help="NAME=X,Y: whose reflectance map is shown; five if none is given.")
    ] = None,
    film_report: Annotated[
        Path | None, typer.Option(help="Of a subject built from a film: report of `relit capture build`.")
    ] = None,
    film_truth: Annotated[
        Path | None, typer.Option(help="truth.json of that film; --truth is the field filmed.")
    ] = None,
) -> None:
    """Compare a reflectance field with pictures taken under each light (thesis 7)."""
    import json

    from relit_camera.capture.subject_builder import neutral_picture
    from relit_camera.capture.subject_landmarks import find_landmarks, read_landmarks
    from relit_camera.cli.arguments import load_command_settings
    from relit_camera.cli.progress import progress_bar
    from relit_camera.lab.evaluate.field.candidates import method_candidates, subject_candidate
    from relit_camera.lab.evaluate.field.captured_ground_truth import crop_like_capture, scale_to_truth
    from relit_camera.lab.evaluate.field.field_evaluation import evaluate_field
    from relit_camera.lab.evaluate.field.field_report import field_json, field_page, field_text
    from relit_camera.lab.evaluate.field.ground_truth import GroundTruth, sampled_region, subsample_lights
    from relit_camera.lab.evaluate.field.sample_points import face_sample_points, parse_sample_point
    from relit_camera.light.environments.builtin.builtin_environments import BUILTIN_NAMES
    from relit_camera.light.environments.environment_store import EnvironmentStore
    from relit_camera.subject.subject_store import SubjectStore

    if (film_report is None) != (film_truth is None):
        raise typer.BadParameter("give both --film-report and --film-truth, or neither")
    with _report_file(out) as report_file:
        storage = load_command_settings(context).storage
        store = EnvironmentStore(storage.environments)
        environments = {each.name: each.light_map for each in map(store.resolve, environment or BUILTIN_NAMES)}
        true_lights = _lights_file(truth)
        known = GroundTruth(_samples(true_lights, gamma))
        if film_report and film_truth:
            known = GroundTruth(crop_like_capture(known.samples, film_report, film_truth))
        matte = known.samples.matte
        if pixel:
            spots = [parse_sample_point(text, matte) for text in pixel]
        else:
            frontal = known.samples.pictures[known.directions[:, 2].argmax()]
            # Landmarks beside the truth are in its own pixels, not in those that a film's subject was cut to.
            points = None if film_report else read_landmarks(true_lights.parent / "landmarks.json", required=False)
            spots = face_sample_points(points or find_landmarks(neutral_picture(frontal, matte)), matte)
        lights = _lights_file(Path(subject_or_lights))
        samples: OlatSamples | None = None
        if lights.suffix.lower() == ".lp":
            samples = subsample_lights(_samples(lights, gamma), within_deg, every)
            _check_size(lights, samples.matte, matte)
            directions, candidates = samples.directions, method_candidates(samples, known.inside, method or ())
        else:
            if method or within_deg or every > 1:
                raise typer.BadParameter(
                    "--method, --within-deg and --every are for lights: a subject is built already"
                )
            name, subject = SubjectStore(storage.subjects).resolve(subject_or_lights)
            _check_size(lights, subject.matte, matte)
            directions = subject.light_directions.astype(float)
            candidates = [subject_candidate(name, subject, known.inside)]
            if film_report:
                region = sampled_region(directions, known.directions).nonzero()[0]
                candidates = [scale_to_truth(candidate, known, region)[0] for candidate in candidates]
        with progress_bar() as progress:
            task = progress.add_task("Comparing", total=None)
            advance = partial(_advance, progress, task)
            report = evaluate_field(candidates, directions, samples, known, environments, spots, advance)
        if report_file:
            title = f"Reflectance field of {lights.resolve().parent.name if samples else lights.stem}"
            report_file.write_text(field_page(report, title), encoding="utf-8")
    typer.echo(json.dumps(field_json(report), indent=1) if as_json else field_text(report))


def _lights_file(path: Path) -> Path:
    """The .lp file of a path: the file itself, or lights.lp in a folder."""
    from relit_camera.capture.lights_file import LIGHTS_FILE_NAME

    return path / LIGHTS_FILE_NAME if (path / LIGHTS_FILE_NAME).is_file() else path


def _check_size(name: Path, matte: Mask, truth: Mask) -> None:
    from relit_camera.base.errors import LightsError

    if matte.shape != truth.shape:
        sizes = f"{matte.shape[1]}x{matte.shape[0]}, the truth {truth.shape[1]}x{truth.shape[0]}"
        raise LightsError(f"{name} is {sizes}", "give a truth of the same person at the same size")


def _samples(path: Path, gamma: str) -> OlatSamples:
    from relit_camera.base.images.color import parse_gamma
    from relit_camera.capture.picture_import import import_samples
    from relit_camera.cli.progress import progress_bar

    with progress_bar() as progress:
        task = progress.add_task(f"Reading {path}", total=None)
        return import_samples(path, parse_gamma(gamma), partial(_advance, progress, task))


def _advance(progress: Progress, task: TaskID, done: int, total: int) -> None:
    progress.update(task, completed=done, total=total)


@contextmanager
def _report_file(out: Path | None) -> Iterator[Path | None]:
    """Open the report's file before the work, so that a report that cannot be made or written fails at once."""
    from relit_camera.base.storage.atomic_files import atomic_path
    from relit_camera.lab.evaluate.report.html_page import require_report_packages

    if out:
        if out.suffix.lower() not in (".html", ".htm"):
            raise typer.BadParameter(f"{out} is no .html file", param_hint="--out")
        require_report_packages()
    with atomic_path(out) if out else nullcontext() as temporary:
        yield temporary


@app.command()
def olat(
    lights: Annotated[list[Path], typer.Argument(help="Captured lights (.lp), one list or several.")],
    hold_out: Annotated[
        list[str] | None,
        typer.Option(help="every=N leaves out every N-th inner light; every=4 and every=2 if not given."),
    ] = None,
    out: Out = None,
    as_json: AsJson = False,
    gamma: GammaText = "srgb",
    within_deg: WithinDegrees = 75.0,
    method: Methods = None,
) -> None:
    """Leave captured lights out and predict their pictures from the others."""
    import json

    from relit_camera.cli.progress import progress_bar
    from relit_camera.lab.evaluate.field.ground_truth import subsample_lights
    from relit_camera.lab.evaluate.light_holdout import (
        evaluate_hold_out,
        holdout_json,
        holdout_page,
        holdout_text,
        parse_hold_out,
    )

    hold_outs = [parse_hold_out(text) for text in hold_out or ("every=4", "every=2")]
    results = []
    with _report_file(out) as report_file:
        for path in map(_lights_file, lights):
            samples = subsample_lights(_samples(path, gamma), within_deg)
            name = f"{path.resolve().parent.name}/{path.name}"
            for every in hold_outs:
                with progress_bar() as progress:
                    task = progress.add_task(f"{name}, every {every}", total=None)
                    advance = partial(_advance, progress, task)
                    results.append(evaluate_hold_out(name, samples, every, method or (), advance))
        if report_file:
            report_file.write_text(holdout_page(results), encoding="utf-8")
    typer.echo(json.dumps(holdout_json(results), indent=1) if as_json else holdout_text(results))


@app.command()
def ladder(
    context: typer.Context,
    lights: Annotated[list[Path], typer.Argument(help="Lights (.lp) from directions all round, a list a person.")],
    out: Annotated[
        Path, typer.Option(help="Folder for report, sheets and figures; subjects that take long are kept there.")
    ],
    as_json: AsJson = False,
    gamma: GammaText = "srgb",
    room: Annotated[
        list[str] | None, typer.Option(help="Environment the person sits in; the built-in ones if none is given.")
    ] = None,
    environment: Annotated[
        list[str] | None, typer.Option(help="Whose light the live picture is taken into; the built-in ones if none.")
    ] = None,
    rung: Annotated[list[str] | None, typer.Option(help="Rung to measure; all if none is given.")] = None,
    size: Annotated[int, typer.Option(help="Longer side to which known pictures are reduced.", min=32, max=1024)] = 128,
) -> None:
    """Compare the ways to a subject (instant, desk, film) on people whose field is known."""
    import json

    from relit_camera.base.images.image_files import encode_display
    from relit_camera.base.storage.atomic_files import write_atomic
    from relit_camera.capture.lights_file import read_lights
    from relit_camera.cli.arguments import load_command_settings
    from relit_camera.cli.progress import progress_bar
    from relit_camera.face.tracking.trackers import TrackerOptions, open_tracker
    from relit_camera.lab.evaluate.ladder.desk_rung import read_screens
    from relit_camera.lab.evaluate.ladder.known_person import SubjectFolder, known_person
    from relit_camera.lab.evaluate.ladder.ladder_evaluation import evaluate_person
    from relit_camera.lab.evaluate.ladder.ladder_report import (
        ladder_json,
        ladder_page,
        ladder_text,
        room_figures,
        room_sheet,
    )
    from relit_camera.lab.evaluate.ladder.ladder_rungs import rung_names
    from relit_camera.lab.evaluate.report.html_page import require_report_packages
    from relit_camera.light.environments.builtin.builtin_environments import BUILTIN_NAMES
    from relit_camera.light.environments.environment_store import EnvironmentStore

    require_report_packages()
    names = rung_names(rung)
    store = EnvironmentStore(load_command_settings(context).storage.environments)
    rooms, environments = (list(map(store.resolve, given or BUILTIN_NAMES)) for given in (room, environment))
    listed = {path.resolve().parent.name: path for path in map(_lights_file, lights)}
    if len(listed) < len(lights):
        raise typer.BadParameter("two lists of lights lie in folders of one name, which names the person")
    before = {}
    for name, path in listed.items():
        read_lights(path)  # what is wrong with the last is told before the first one's hour begins
        before[name] = read_screens(path.parent, names)
    subjects, tracker = SubjectFolder(out / "subjects"), open_tracker("mesh", TrackerOptions(blendshapes=False))
    results = []
    for name, path in listed.items():
        samples = _samples(path, gamma)
        with progress_bar() as progress:
            task = progress.add_task(name, total=len(rooms))
            person = known_person(name, samples, size, subjects, before[name])
            for result in evaluate_person(person, rooms, environments, names, tracker, subjects):
                sheet = room_sheet(result.pictures, result.room)
                write_atomic(out / f"{result.person}-{result.room}.jpg", encode_display(sheet, ".jpg"))
                results.append(room_figures(result, sheet))
                progress.advance(task)
    figures = json.dumps(ladder_json(results), indent=1)
    write_atomic(out / "ladder.json", figures)
    write_atomic(out / "ladder.html", ladder_page(results))
    typer.echo(figures if as_json else ladder_text(results))


@app.command()
def frontal(
    lights: Annotated[list[Path], typer.Argument(help="Captured lights (.lp) of a face, one list or several.")],
    out: Out = None,
    as_json: AsJson = False,
    gamma: GammaText = "srgb",
    size: Annotated[int, typer.Option(help="Longer side to which pictures are reduced.", min=32, max=1024)] = 96,
) -> None:
    """Predict lights from the sides from frontal ones alone, as a desk or a single picture must."""
    import json

    from relit_camera.cli.progress import progress_bar
    from relit_camera.face.tracking.trackers import TrackerOptions, open_tracker
    from relit_camera.lab.evaluate.ladder.frontal_lights import evaluate_frontal, split_frontal
    from relit_camera.lab.evaluate.ladder.frontal_report import frontal_json, frontal_page, frontal_text

    opened = partial(open_tracker, "mesh", TrackerOptions(blendshapes=False))
    results = []
    with _report_file(out) as report_file:
        for path in map(_lights_file, lights):
            known = split_frontal(path.resolve().parent.name, _samples(path, gamma), opened, size)
            with progress_bar() as progress:
                task = progress.add_task(known.name, total=None)
                results.append(evaluate_frontal(known, partial(_advance, progress, task)))
        if report_file:
            report_file.write_text(frontal_page(results), encoding="utf-8")
    typer.echo(json.dumps(frontal_json(results), indent=1) if as_json else frontal_text(results))


@app.command()
def video(
    relit: Annotated[Path, typer.Argument(help="Video made by `relit replay`.")],
    truth: Annotated[Path, typer.Option(help="Ground-truth relit video: the same frames under the same light.")],
    matte: Annotated[
        Path | None, typer.Option(help="Video whose bright pixels are the person; else the whole frame counts.")
    ] = None,
    pose: Annotated[
        Path | None, typer.Option(help="Measured motion: a replay's report, or a track of RELIT with landmarks.")
    ] = None,
    true_pose: Annotated[Path | None, typer.Option(help="True motion: truth.json or a true track.")] = None,
    out: Out = None,
    as_json: AsJson = False,
) -> None:
    """Compare a relit video with the ground-truth relit video: light, steadiness, pose."""
    import json

    from relit_camera.cli.progress import progress_bar
    from relit_camera.lab.evaluate.video.head_motion_error import read_head_motion
    from relit_camera.lab.evaluate.video.relit_video_accuracy import (
        VideoReport,
        compare_videos,
        video_json,
        video_page,
        video_text,
    )

    if (pose is None) != (true_pose is None):
        raise typer.BadParameter("give both --pose and --true-pose, or neither")
    motions = [read_head_motion(path) for path in (pose, true_pose) if path]
    with _report_file(out) as report_file, progress_bar() as progress:
        task = progress.add_task("Comparing", total=None)
        light = compare_videos(relit, truth, matte, lambda done: progress.update(task, completed=done))
        report = VideoReport(light, *motions)
        result = json.dumps(video_json(report), indent=1) if as_json else video_text(report)
        if report_file:
            report_file.write_text(video_page(report, f"Relit video {relit.name}"), encoding="utf-8")
    typer.echo(result)


@app.command()
def capture(
    report: Annotated[Path, typer.Argument(help="Report of a capture (JSON): frames, ball, directions, transforms.")],
    truth: Annotated[Path, typer.Option(help="truth.json of the rendered capture video.")],
    out: Out = None,
    as_json: AsJson = False,
) -> None:
    """Compare what a capture found in a rendered video with the truth: frames, ball, light, head motion."""
    import json

    from relit_camera.lab.evaluate.capture_accuracy import capture_json, capture_page, capture_text, compare_capture

    with _report_file(out) as report_file:
        errors = compare_capture(report, truth)
        if report_file:
            report_file.write_text(capture_page(errors, f"Capture {report.stem}"), encoding="utf-8")
    typer.echo(json.dumps(capture_json(errors), indent=1) if as_json else capture_text(errors))


@app.command()
def stabilisation(
    video: Annotated[Path, typer.Argument(help="Rendered capture video.")],
    truth: Annotated[Path, typer.Option(help="Its truth.json.")],
    out: Out = None,
    as_json: AsJson = False,
) -> None:
    """Compare ways to follow the face through a rendered capture with its true motion (thesis 4.2)."""
    import json

    from relit_camera.cli.progress import progress_bar
    from relit_camera.lab.evaluate.stabilization.stabilization_accuracy import (
        compare_stabilization,
        stabilization_json,
        stabilization_page,
        stabilization_text,
    )

    with _report_file(out) as report_file, progress_bar() as progress:
        task = progress.add_task("Stabilizing", total=None)
        report = compare_stabilization(
            video, truth, lambda what, frames: progress.update(task, description=what, completed=frames)
        )
        if report_file:
            report_file.write_text(stabilization_page(report, f"Stabilisation of {video.name}"), encoding="utf-8")
    typer.echo(json.dumps(stabilization_json(report), indent=1) if as_json else stabilization_text(report))
