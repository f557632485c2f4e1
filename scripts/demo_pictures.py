"""Draws the demonstration: `python scripts/demo_pictures.py [FOLDER]` (build/demo if not given), about two minutes.

sheet.jpg shows twelve frames of the bundled clip, live and under six environments; demo.jpg, the README's picture,
five of them under three. Nothing need be downloaded: the clip's own track and mattes are used.
"""

from __future__ import annotations

import sys
from pathlib import Path

from relit_camera.app.demo import demo_files
from relit_camera.app.replay.video_replay import replay
from relit_camera.app.wiring import make_pipeline, make_tracker
from relit_camera.base.config.look import EnvironmentBackground, Lighting, Look, Mode
from relit_camera.base.config.settings import RelitSettings, TrackerSettings
from relit_camera.base.images.contact_sheet import contact_sheet
from relit_camera.base.images.image_files import encode_display
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.base.storage.atomic_files import make_folder, write_atomic
from relit_camera.live.scene.scene_controller import SceneController

ENVIRONMENTS = ("studio", "window", "sunset", "night-street", "party", "overcast")
SHEET_FRAMES = 12
README_ENVIRONMENTS, README_FRAMES = ("studio", "sunset", "party"), (1, 4, 6, 8, 10)


def main() -> None:
    """Draw both pictures."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "build/demo")
    make_folder(folder)
    rows: dict[str, list[DisplayImage]] = {}
    for environment in ENVIRONMENTS:
        rows["live"], rows[environment] = relit(environment)
        print(environment)
    sheet = contact_sheet(list(rows.values()), list(rows), cell_width=320)
    write_atomic(folder / "sheet.jpg", encode_display(sheet, ".jpg"))
    chosen = ("live", *README_ENVIRONMENTS)
    small = contact_sheet([[rows[name][index] for index in README_FRAMES] for name in chosen], chosen, cell_width=240)
    write_atomic(folder / "demo.jpg", encode_display(small, ".jpg"))


def relit(environment: str) -> tuple[list[DisplayImage], list[DisplayImage]]:
    """`SHEET_FRAMES` frames of the clip as they are, and under the environment, before it."""
    settings = RelitSettings(
        subject=str(demo_files.SUBJECT),
        tracker=TrackerSettings(name=f"recorded:{demo_files.TRACK}"),
        matte=f"recorded:{demo_files.MATTES}",
    )
    scene_controller = SceneController(settings.storage)
    scene_controller.load_configured_subject(settings.subject)
    light = Lighting(environment=environment)
    scene_controller.set_look(Look(mode=Mode.LIVE, lighting=light, background=EnvironmentBackground()))
    tracker = make_tracker(settings)
    before, after = [], []

    def keep(index: int, live: DisplayImage, shown: DisplayImage) -> None:
        before.append(live)
        after.append(shown)

    replay(
        demo_files.CLIP,
        None,
        lambda size: make_pipeline(settings, tracker, size),
        lambda _: scene_controller.scene,
        keep,
    )
    indices = [int((index + 0.5) * len(after) / SHEET_FRAMES) for index in range(SHEET_FRAMES)]
    return [before[index] for index in indices], [after[index] for index in indices]


if __name__ == "__main__":
    main()
