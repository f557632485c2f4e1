"""Draws the pictures of the ladder: `python scripts/ladder_pictures.py LIGHTS.lp [LIGHTS.lp …] --out OUT.jpg`.

People whose reflectance field is known sit before a webcam by a window. Of one person the live picture is shown in
other places by the subject of each rung, and the truth (docs/pictures/ladder.jpg); of several, side by side, in two
places (docs/pictures/ladder-people.jpg). LIGHTS.lp are pictures from directions all round, as
`python -m relit_studio field --person adam --out adam` renders them. Public models must be installed.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
import numpy as np

from relit_camera.base.images.contact_sheet import contact_sheet
from relit_camera.base.images.image_files import encode_display
from relit_camera.base.images.image_types import DisplayImage, Mask
from relit_camera.base.rotations import Rotation
from relit_camera.base.storage.atomic_files import write_atomic
from relit_camera.capture.picture_import import import_samples
from relit_camera.face.tracking.trackers import TrackerOptions, open_tracker
from relit_camera.lab.evaluate.ladder.known_person import SubjectFolder, known_person
from relit_camera.lab.evaluate.ladder.ladder_evaluation import RoomResult, evaluate_person
from relit_camera.lab.evaluate.ladder.ladder_rungs import RUNGS
from relit_camera.lab.evaluate.ladder.webcam_frames import WEBCAM
from relit_camera.light.environments.builtin.builtin_environments import builtin_environment
from relit_camera.light.environments.environment_panorama import Environment
from relit_camera.light.exposure import auto_exposure_scale
from relit_camera.live.compositing.environment_view import EnvironmentView

ROOM = "window"
ENVIRONMENTS = ("studio", "sunset", "night-street", "party", "overcast")
SHOWN = tuple(name for name in ("instant", "desk", "film") if name in RUNGS)
PLACES_OF_PEOPLE = ("sunset", "studio")
SIZE = 192
CELL_PX = 240
QUALITY = 85


def main() -> None:
    """Draw the picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("lights", type=Path, nargs="+")
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    several = len(arguments.lights) > 1
    environments = [builtin_environment(name) for name in (PLACES_OF_PEOPLE if several else ENVIRONMENTS)]
    results = {lights.parent.name: by_the_window(lights, environments) for lights in arguments.lights}
    sheet = people_sheet(results, environments) if several else ladder_sheet(next(iter(results.values())), environments)
    write_atomic(arguments.out, encode_display(sheet, ".jpg", QUALITY))


def by_the_window(lights: Path, environments: list[Environment]) -> RoomResult:
    """A person before their webcam, and in the environments by every rung."""
    subjects = SubjectFolder(Path("build/ladder"))
    person = known_person(lights.parent.name, import_samples(lights), SIZE, subjects)
    tracker = open_tracker("mesh", TrackerOptions(blendshapes=False))
    return next(iter(evaluate_person(person, [builtin_environment(ROOM)], environments, SHOWN, tracker, subjects)))


def people_sheet(results: dict[str, RoomResult], environments: list[Environment]) -> DisplayImage:
    """A column a person: the live picture, then in each environment the rungs and the truth."""
    rows: list[list[DisplayImage | None]] = [[result.pictures.live for result in results.values()]]
    names = ["webcam"]
    for each in environments:
        behind = view_of(each)
        for rung in (*SHOWN, "truth"):
            names.append(f"{each.name}: {rung}")
            rows.append([shown_in(result, each, behind, rung) for result in results.values()])
    return contact_sheet(rows, names, list(results), CELL_PX)


def ladder_sheet(result: RoomResult, environments: list[Environment]) -> DisplayImage:
    """The live picture, and rows of the rungs and the truth, each in front of the environment that lights it."""
    behind = [view_of(each) for each in environments]
    rows: list[list[DisplayImage | None]] = []
    for name in (*SHOWN, "truth"):
        before = result.pictures.live if name == SHOWN[0] else None
        rows.append([before, *(shown_in(result, *place, name) for place in zip(environments, behind, strict=True))])
    return contact_sheet(rows, [*SHOWN, "truth"], ["webcam", *ENVIRONMENTS], CELL_PX)


def shown_in(result: RoomResult, environment: Environment, behind: DisplayImage, name: str) -> DisplayImage:
    """The person in an environment and before it, by the subject of a rung or in "truth"."""
    pictures = result.pictures
    relit = pictures.truths if name == "truth" else pictures.relit[name]
    return put_before(relit[environment.name], behind, pictures.matte, name == "truth")


def view_of(environment: Environment) -> DisplayImage:
    """The environment as the camera sees it behind the person."""
    view = EnvironmentView(environment.panorama, (WEBCAM.side_px,) * 2, WEBCAM.height_deg, WEBCAM.room_blur)
    return view.picture(Rotation.identity(), auto_exposure_scale(environment.light_map))


def put_before(person: DisplayImage, behind: DisplayImage, matte: Mask, over_black: bool) -> DisplayImage:
    """The person before a background, by the true matte; a picture over black has the matte as a factor already."""
    share = np.clip((matte[..., None] - 0.1) / 0.85, 0, 1)
    front = person if over_black else person * share
    mixed = np.rint(front + behind * (1 - share)).astype(np.float32)
    return np.asarray(cv2.convertScaleAbs(mixed), np.uint8)


if __name__ == "__main__":
    main()
