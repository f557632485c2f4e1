"""Draws docs/pictures/ladder.jpg: `python scripts/ladder_pictures.py LIGHTS.lp [OUT.jpg]`.

One person whose reflectance field is known sits before a webcam by a window; below, the live picture in other places
by the subject of each rung, and the truth. LIGHTS.lp are pictures from directions all round: the person of `relit demo`
as `python -m relit_studio field --person adam --out adam` renders them. Public models must be installed.
"""

from __future__ import annotations

import sys
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
SIZE = 192
CELL_PX = 240
QUALITY = 85


def main() -> None:
    """Draw the picture."""
    lights, out = Path(sys.argv[1]), Path(sys.argv[2] if len(sys.argv) > 2 else "docs/pictures/ladder.jpg")
    subjects = SubjectFolder(Path("build/ladder"))
    person = known_person(lights.parent.name, import_samples(lights), SIZE, subjects)
    tracker = open_tracker("mesh", TrackerOptions(blendshapes=False))
    room, environments = builtin_environment(ROOM), [builtin_environment(name) for name in ENVIRONMENTS]
    result = next(iter(evaluate_person(person, [room], environments, SHOWN, tracker, subjects)))
    write_atomic(out, encode_display(ladder_sheet(result, environments), ".jpg", QUALITY))


def ladder_sheet(result: RoomResult, environments: list[Environment]) -> DisplayImage:
    """The live picture, and rows of the rungs and the truth, each in front of the environment that lights it."""
    pictures, behind = result.pictures, [view_of(each) for each in environments]
    rows: list[list[DisplayImage | None]] = []
    for name in (*SHOWN, "truth"):
        relit = pictures.truths if name == "truth" else pictures.relit[name]
        before = pictures.live if name == SHOWN[0] else None
        shown = [
            put_before(relit[each.name], view, pictures.matte, name == "truth")
            for each, view in zip(environments, behind, strict=True)
        ]
        rows.append([before, *shown])
    return contact_sheet(rows, [*SHOWN, "truth"], ["webcam", *ENVIRONMENTS], CELL_PX)


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
