"""The picture of one frame, from tracking to compositing, in every mode."""

from __future__ import annotations

import gc
import threading
import weakref
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from relit_camera.app.demo import demo_files
from relit_camera.app.wiring import make_follower, make_pipeline, mode_factories
from relit_camera.base.config.look import ANYONE, ColorBackground, Lamp, Lighting, Look, Mode
from relit_camera.base.config.settings import InferenceSettings, OutputSettings, RelitSettings
from relit_camera.base.errors import ModelError
from relit_camera.base.images.image_files import write_display
from relit_camera.base.images.image_types import Alpha, Frame
from relit_camera.base.models.model_store import FOLDER_VARIABLE
from relit_camera.base.rotations import Rotation, angles_from_rotation, rotation_from_angles
from relit_camera.capture.instant.anyone import anyone
from relit_camera.face.face_state import LOST, FaceState, FaceStatus, Tracker
from relit_camera.face.head_pose import project
from relit_camera.face.identity.face_embedder import FaceEmbedder
from relit_camera.face.matting import Matting
from relit_camera.face.motion.face_follower import FaceMotion
from relit_camera.lab.bench.synthetic_tracker import SyntheticTracker
from relit_camera.light.environments.builtin.builtin_environments import builtin_environment
from relit_camera.live.modes.frame_fitting import fit_frame
from relit_camera.live.modes.mode import ModeContext, ModeFactory, RenderedFrame, RenderTask
from relit_camera.live.modes.scene_relighting import SceneRelighting
from relit_camera.live.pipeline import Pipeline, subject_troubles
from relit_camera.live.publishing.what_is_shown import Shown
from relit_camera.live.reenactment.source_image import find_source_face
from relit_camera.live.render_quality import FULL_QUALITY, QUALITY_LEVELS, RenderQuality
from relit_camera.live.scene.scene import Scene
from relit_camera.live.status.camera_status import DegradationCode
from relit_camera.subject.relighting.relighter import Relighter, open_relighter
from relit_camera.subject.subject import Subject
from relit_camera.subject.subject_file import read_subject
from tests.generated_subject import small_subject
from tests.small_camera import SIZE, Embedder, SteadyTracker, difference, grey

HIDDEN = 7
"""Of the placeholder for somebody else, in every pixel."""
CPU = RelitSettings(inference=InferenceSettings(provider="cpu"))
STUDIO = builtin_environment("studio")
LAMP_RIGHT = Lighting(environment=None, lamps=(Lamp(azimuth_deg=90, elevation_deg=0),), transition_s=0)
LAMP_LEFT = Lighting(environment=None, lamps=(Lamp(azimuth_deg=-90, elevation_deg=0),), transition_s=0)


def pipeline(tracker: Tracker | None = None, size: tuple[int, int] = SIZE) -> Pipeline:
    return make_pipeline(CPU, tracker or SteadyTracker(), size)


def whoever_comes(lighting: dict[str, object] | None = None) -> Scene:
    look = {} if lighting is None else {"lighting": lighting}
    return replace(scene(False, Mode.LIVE, False, **look), subject_name=ANYONE)


def scene(subject: bool = True, mode: Mode = Mode.PORTRAIT, unlit_allowed: bool = True, **look: object) -> Scene:
    wanted = Look.model_validate({"mode": mode, **look})
    lit = STUDIO if wanted.lighting.environment == "studio" else None
    who = small_subject() if subject else None
    return Scene(wanted, lit, None, "small" if who else None, who, unlit_allowed=unlit_allowed)


def frame(index: int = 0, image: np.ndarray | None = None) -> Frame:
    return Frame(grey() if image is None else image, index, 0.0, index / 20)


def no_embedder() -> FaceEmbedder:
    raise ModelError("model face_embedding is not pulled", "relit models pull")


def test_pictures_are_of_the_outputs_size_whatever_comes() -> None:
    for image in (grey(), grey(size=(90, 160)), grey(size=(300, 40))):
        for shown in (scene(), scene(subject=False), scene(mode=Mode.LIVE)):
            picture = pipeline(size=(160, 90)).process(frame(0, image), shown).image
            assert picture.shape == (90, 160, 3)
            assert picture.dtype == np.uint8


def test_portrait_lets_no_live_pixel_through() -> None:
    noise = np.random.default_rng(0).integers(0, 255, (SIZE[1], SIZE[0], 3), dtype=np.uint8)
    quiet, loud = (pipeline().process(frame(0, image), scene()).image for image in (grey(), noise))
    np.testing.assert_array_equal(quiet, loud)


def test_without_a_subject_the_live_picture_passes() -> None:
    rendered = pipeline().process(frame(), scene(subject=False))
    assert difference(rendered.image, grey()) <= 1
    assert rendered.unlit  # the publisher shows it only where that is allowed


def test_whoever_comes_is_relit_where_nobody_is_chosen() -> None:
    """In the light that was chosen, at once, and nothing of the head that stands for them is in the picture."""
    made, image = pipeline(), textured()
    bright, dark = (
        made.process(frame(index, image), whoever_comes(lighting=light))
        for index, light in enumerate([LAMP_LEFT.model_dump(), LAMP_RIGHT.model_dump()])
    )
    assert (bright.shown, bright.unlit) == (Shown.RELIT, False)
    half = SIZE[0] // 2
    left, right = bright.image.astype(float), dark.image.astype(float)
    assert (left - right)[20:-20, half - 24 : half - 6].mean() > 3
    assert (right - left)[20:-20, half + 6 : half + 24].mean() > 3
    fine = [each - cv2.GaussianBlur(each, (0, 0), 8) for each in (left, image.astype(float))]
    assert np.corrcoef(*(each[20:-20, half - 40 : half - 16].ravel() for each in fine))[0, 1] > 0.8


@pytest.mark.parametrize("mode", list(Mode))
def test_nobody_chosen_is_nobody_shown(mode: Mode) -> None:
    assert scene(subject=False, mode=mode, unlit_allowed=False).shows_nobody
    assert replace(whoever_comes(), look=Look(mode=Mode.PORTRAIT)).shows_nobody
    assert not whoever_comes().shows_nobody


def pipeline_of(
    tracker: Tracker,
    modes: Mapping[Mode, ModeFactory] | None = None,
    open_matte: Callable[[], Matting] = pytest.fail,
    open_embedder: Callable[[], FaceEmbedder] = no_embedder,
    is_nobodys: bool = False,
) -> Pipeline:
    """A pipeline of which some parts are given."""
    return Pipeline(
        tracker,
        partial(make_follower, CPU.tracker, tracker),
        SIZE,
        modes or mode_factories(CPU),
        partial(open_relighter, "basis"),
        open_matte,
        anyone,
        open_embedder,
        lambda _: is_nobodys,
        lambda: np.full((SIZE[1], SIZE[0], 3), HIDDEN, np.uint8),
    )


def textured() -> np.ndarray:
    """Grey with a pattern that no noise has."""
    noise = np.random.default_rng(4).normal(0, 120, (SIZE[1], SIZE[0], 1)).repeat(3, axis=2)
    return np.clip(grey(120) + cv2.GaussianBlur(noise, (0, 0), 2.5), 0, 255).astype(np.uint8)


@pytest.mark.parametrize(("distance", "other"), [(0.3, False), (0.8, True)])
def test_somebody_else_than_the_subject_is_lit_as_anybody_would_be(distance: float, other: bool) -> None:
    embedder = Embedder(distance)
    made = pipeline_of(SteadyTracker(), open_embedder=lambda: embedder)
    made._compositor.person_alpha = lambda *_: None  # type: ignore[method-assign]
    chosen = scene(mode=Mode.LIVE, lighting=LAMP_LEFT.model_dump())
    rendered = [made.process(frame(index, textured()), chosen) for index in range(60)]
    assert {each.shown for each in rendered} == {Shown.RELIT}
    assert 4 <= embedder.looks <= 9
    assert [trouble.code for trouble in made.troubles] == [DegradationCode.OTHER_PERSON] * other
    as_anybody = pipeline()
    as_anybody._compositor.person_alpha = lambda *_: None  # type: ignore[method-assign]
    unchosen = replace(chosen, subject=None, subject_name=ANYONE)
    expected = [as_anybody.process(frame(index, textured()), unchosen) for index in range(60)][-1]
    assert (difference(rendered[-1].image, expected.image) < 1) is other


class Coming(SteadyTracker):
    """Loses the face from frame 30 to 60: for longer than whoever was there is remembered."""

    def track(self, frame: Frame) -> FaceState:
        return LOST if 30 <= frame.index < 60 else super().track(frame)


def kinds(made: Pipeline, shown: Scene, frames: range) -> list[Shown]:
    return [made.process(frame(index, textured()), shown).shown for index in frames]


def test_nobody_else_moves_the_portrait() -> None:
    """A placeholder, drawn once, from when it is known to be somebody else until it is known to be the subject."""
    embedder = Embedder(0.8)
    made, chosen = pipeline_of(Coming(), open_embedder=lambda: embedder), scene()
    assert kinds(made, chosen, range(5)) == [Shown.RELIT] * 5  # not known yet
    kinds(made, chosen, range(5, 20))
    hidden = [made.process(frame(index, textured()), chosen) for index in (20, 21)]
    assert [(each.shown, each.other_person) for each in hidden] == [(Shown.PLACEHOLDER, True)] * 2
    assert hidden[0].image is hidden[1].image
    assert (hidden[0].image == HIDDEN).all()
    (trouble,) = made.troubles
    assert (trouble.code, trouble.what) == (DegradationCode.OTHER_PERSON, "a placeholder is shown")
    assert "others" in trouble.cure
    assert set(kinds(made, chosen, range(22, 62))) == {Shown.PLACEHOLDER}  # also where the face was away
    embedder.distance = 0.3
    back = kinds(made, chosen, range(62, 200))
    assert back[-1] is Shown.RELIT
    assert back == sorted(back, key=[Shown.PLACEHOLDER, Shown.RELIT].index)
    assert made.troubles == []


@pytest.mark.parametrize(
    ("embedder", "allowed", "nobodys", "known"),
    [
        (lambda: Embedder(0.3), False, False, False),
        (no_embedder, False, False, False),
        (lambda: Embedder(0.8), True, False, True),
        (lambda: Embedder(0.8), False, True, False),
    ],
    ids=["the same", "unknown", "allowed", "nobody's"],
)
def test_the_portrait_moves(embedder: Callable[[], FaceEmbedder], allowed: bool, nobodys: bool, known: bool) -> None:
    made = pipeline_of(SteadyTracker(), open_embedder=embedder, is_nobodys=nobodys)
    shown = replace(scene(), avatar_allowed=allowed)
    rendered = [made.process(frame(index, textured()), shown) for index in range(30)]
    assert {each.shown for each in rendered} == {Shown.RELIT}
    assert (rendered[-1].other_person, made.troubles) == (known, [])


def test_leave_to_move_the_portrait_counts_at_once_and_so_does_its_end() -> None:
    made, chosen = pipeline_of(SteadyTracker(), open_embedder=lambda: Embedder(0.8)), scene()
    allowed = replace(chosen, avatar_allowed=True)
    kinds(made, chosen, range(20))
    assert kinds(made, allowed, range(20, 22)) == [Shown.RELIT] * 2
    assert kinds(made, chosen, range(22, 24)) == [Shown.PLACEHOLDER] * 2


def test_somebody_else_than_one_subject_is_not_yet_somebody_else_than_another() -> None:
    made, chosen = pipeline_of(SteadyTracker(), open_embedder=lambda: Embedder(0.55)), scene()
    made._not_them = chosen.subject  # near the threshold what was known stays
    assert kinds(made, chosen, range(20)) == [Shown.PLACEHOLDER] * 20
    assert kinds(made, replace(chosen, subject=replace(small_subject())), range(20, 40)) == [Shown.RELIT] * 20


def test_the_bundled_person_is_nobodys_and_others_are_somebodys() -> None:
    is_nobodys, bundled = pipeline()._is_nobodys, read_subject(demo_files.SUBJECT)
    noted = replace(bundled, metadata=bundled.metadata.model_copy(update=demo_files.SUBJECT_NOTES))
    another = replace(bundled, metadata=bundled.metadata.model_copy(update={"created_at": "2027-01-01"}))
    people = [bundled, noted, anyone(), another, small_subject()]
    assert [is_nobodys(each) for each in people] == [True, True, True, False, False]


@pytest.mark.parametrize("own", [False, True], ids=["drawn", "a picture of the user's"])
def test_what_is_shown_in_place_of_a_portrait(own: bool, tmp_path: Path) -> None:
    picture = tmp_path / "away.png"
    write_display(picture, grey(77))
    settings = CPU.model_copy(update={"output": OutputSettings(placeholder=picture if own else None)})
    drawn = make_pipeline(settings, SteadyTracker(), SIZE)._draw_other_person()
    assert drawn.shape == (SIZE[1], SIZE[0], 3)
    assert (drawn == 77).all() == own
    assert drawn.max() > 70


@pytest.mark.parametrize(
    ("mode", "allowed", "shown"),
    [
        (Mode.PORTRAIT, True, "the live picture"),
        (Mode.PORTRAIT, False, "a placeholder"),
        (Mode.LIVE, True, "the live picture"),
        (Mode.LIVE, False, "a placeholder"),
    ],
)
def test_nobody_is_a_trouble(mode: Mode, allowed: bool, shown: str) -> None:
    (trouble,) = subject_troubles(scene(subject=False, mode=mode, unlit_allowed=allowed))
    assert trouble.code is DegradationCode.NO_SUBJECT
    assert trouble.what.startswith(shown)
    assert subject_troubles(scene()) == []


def test_live_of_a_frame_of_another_size_is_that_of_the_fitted_frame() -> None:
    """The face is tracked in the frame as it comes, the light is exchanged in the frame as it goes out."""
    size, shown = (160, 90), scene(mode=Mode.LIVE, lighting={"exposure_ev": -2})
    textured = cv2.resize(np.random.default_rng(0).integers(60, 200, (9, 16, 3), dtype=np.uint8), (320, 180))
    live = frame(0, textured)
    scaled, cut = pipeline(SyntheticTracker(), size), pipeline(SyntheticTracker(), size)
    one = scaled.process(live, shown).image
    motion = scaled.process(live, shown).motion
    assert motion is not None
    assert motion.pose is not None
    middle = motion.landmarks.mean(axis=0)
    assert np.abs(middle - np.array(live.size) / 2).max() < 0.2 * live.size[1]  # told as in mode portrait
    two = cut.process(fit_frame(live, size), shown).image
    assert difference(one, two) < 2


def test_the_light_comes_from_its_side() -> None:
    left, right = (
        pipeline().process(frame(), scene(lighting=light)).image.astype(float) for light in (LAMP_LEFT, LAMP_RIGHT)
    )
    half = SIZE[0] // 2
    assert (right - left)[:, half + 8 :].mean() > 2
    assert (left - right)[:, : half - 8].mean() > 2


def test_the_picture_moves_with_the_head() -> None:
    made = pipeline(SyntheticTracker())
    pictures = [made.process(frame(index), scene(lighting={"transition_s": 0})).image for index in range(30)]
    moved = [difference(pictures[20], picture) for picture in pictures[21:]]
    assert max(moved) > 1


class Vanishing(SteadyTracker):
    """Loses the face from frame 25 on."""

    def track(self, frame: Frame) -> FaceState:
        return super().track(frame) if frame.index < 25 else LOST


def test_a_lost_face_eases_to_neutral_and_says_so() -> None:
    made = pipeline(Vanishing())
    motions = [made.process(frame(index), scene()).motion for index in range(50)]
    assert motions[24] is not None
    assert motions[24].status is FaceStatus.FOUND
    assert motions[-1] is not None
    assert motions[-1].status is FaceStatus.LOST
    assert motions[-1].presence == 0
    assert motions[-1].rotation.magnitude() < 1e-6


@pytest.mark.slow
def test_blend_goes_from_the_live_picture_to_the_relit_one() -> None:
    image = grey(150)

    def last(blend: float) -> np.ndarray:
        made, shown = pipeline(), scene(mode=Mode.LIVE, lighting={"blend": blend, "exposure_ev": -2})
        # A face that just came is eased in.
        return [made.process(frame(index, image), shown).image for index in range(25)][-1]

    live, half, relit = (last(blend) for blend in (0.0, 0.5, 1.0))
    assert difference(live, image) <= 1
    assert live.mean() > half.mean() + 5 > relit.mean() + 10


def test_stages_are_timed() -> None:
    made = pipeline()
    made.process(frame(), scene())
    stages = made.timer.lap_ms()
    assert set(stages) == {"track", "identity", "light", "relight", "follow", "move", "compose"}
    assert all(value > 0 for value in stages.values())


def test_a_matte_that_needs_a_missing_model_says_which(tmp_path: object, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path))
    coloured = scene(mode=Mode.LIVE, background=ColorBackground())
    with pytest.raises(ModelError, match="relit models pull"):
        pipeline().process(frame(), coloured)


def test_portrait_stands_before_its_background_without_any_model() -> None:
    red = pipeline().process(frame(), scene(background=ColorBackground(color="#ff0000"))).image
    assert (red[:, 0] == [255, 0, 0]).all()


class Blind(SteadyTracker):
    """Sees no face."""

    def track(self, frame: Frame) -> FaceState:
        return LOST


def noise() -> np.ndarray:
    return np.random.default_rng(0).integers(60, 200, grey().shape, dtype=np.uint8)


@pytest.mark.parametrize("unlit_allowed", [True, False])
def test_a_live_person_whose_face_was_never_seen_has_the_tint_of_the_place(unlit_allowed: bool) -> None:
    def red(exposure_ev: float) -> Scene:
        lamp = {"lamps": [{"color": [0.8, 0.2, 0.2]}], "environment": None, "transition_s": 0}
        lighting = {**lamp, "exposure_ev": exposure_ev}
        return scene(mode=Mode.LIVE, unlit_allowed=unlit_allowed, lighting=lighting)

    first, darker = (pipeline(Blind()).process(frame(0, noise()), red(ev)) for ev in (0.0, -2.0))
    assert (first.shown, first.unlit) == (Shown.PLACE_TINT, False)
    means = first.image.reshape(-1, 3).mean(axis=0)
    assert means[0] > 1.5 * means[1]
    assert darker.image.mean() < 0.7 * first.image.mean()


class SeenFrom(SteadyTracker):
    """Sees the face from one frame on and until before another."""

    def __init__(self, first: int, end: int) -> None:
        super().__init__()
        self._seen = range(first, end)

    def track(self, frame: Frame) -> FaceState:
        return super().track(frame) if frame.index in self._seen else LOST


@pytest.mark.parametrize("unlit_allowed", [True, False])
def test_the_first_frame_with_a_face_is_relit_as_all_later_ones(unlit_allowed: bool) -> None:
    """One fit tells the room; before the first frame nothing was shown that it would have to be eased from."""
    shown = scene(mode=Mode.LIVE, unlit_allowed=unlit_allowed, lighting={"exposure_ev": -2, "transition_s": 0})
    made, live = pipeline(), grey(220)
    rendered = [made.process(frame(index, live), shown) for index in range(20)]
    assert not any(each.unlit for each in rendered)
    assert difference(rendered[0].image, live) > 20
    assert max(difference(each.image, rendered[-1].image) for each in rendered) < 1


def test_a_face_that_goes_keeps_the_mean_of_its_light_and_comes_back_into_it() -> None:
    """No step is larger than easing makes it, and the live picture is in none of them."""
    shown = scene(mode=Mode.LIVE, unlit_allowed=False, lighting={"exposure_ev": -2, "transition_s": 0})
    tracker, live = GoneFrom(20, 60), grey(220)
    made = pipeline(tracker)
    rendered = [made.process(frame(index, live), shown) for index in range(100)]
    assert {each.shown for each in rendered[:20]} == {Shown.RELIT}
    assert {each.shown for each in rendered[35:60]} == {Shown.LAST_LIGHT}
    assert rendered[-1].shown is Shown.RELIT
    assert not any(each.unlit for each in rendered)
    pictures = [each.image for each in rendered]
    steps = [difference(one, next_one) for one, next_one in pairwise(pictures)]
    assert max(steps) < 4
    assert difference(pictures[19], pictures[-1]) < 2
    assert min(difference(picture, live) for picture in pictures) > 20
    lost = pictures[50].reshape(-1, 3).astype(float)
    assert abs(np.log(lost.mean() / pictures[19].mean())) < 0.4
    assert np.ptp(lost, axis=0).max() <= 3  # of a grey picture, one factor makes one grey


def test_the_light_goes_on_changing_while_the_face_is_lost() -> None:
    made, live = pipeline(GoneFrom(10, 1000)), grey(220)
    bright, dark = (scene(mode=Mode.LIVE, lighting={"exposure_ev": ev, "transition_s": 0}) for ev in (0, -3))
    before = [made.process(frame(index, live), bright).image for index in range(40)][-1]
    after = [made.process(frame(index, live), dark).image for index in range(40, 90)][-1]
    assert after.mean() < 0.6 * before.mean()


def test_a_head_turned_from_the_source_image_is_lit_as_it_is_turned(monkeypatch: pytest.MonkeyPatch) -> None:
    """Not as it is turned from where the live person began: the subject may have been captured turned aside."""
    seen: list[Rotation] = []
    whole = SceneRelighting.compare

    def compare(self: SceneRelighting, scene: Scene, rotation: Rotation, *rest: Any) -> Any:
        seen.append(rotation)
        return whole(self, scene, rotation, *rest)

    monkeypatch.setattr(SceneRelighting, "compare", compare)
    subject = small_subject()
    face = find_source_face(subject, NotInStills())
    turned = replace(face.pose, rotation=rotation_from_angles(20, 0) * face.pose.rotation)
    landmarks = project(face.head_points, turned, subject.size).astype(np.float32)
    aside = replace(subject, landmarks={face.scheme.name: landmarks})
    for who in (subject, aside):
        pipeline(NotInStills()).process(frame(), replace(scene(mode=Mode.LIVE), subject=who))
    assert angles_from_rotation(seen[1] * seen[0].inv()).yaw == pytest.approx(-20, abs=1.5)


class NotInStills(SteadyTracker):
    """Leaves the source image to the landmarks that are stored with it."""

    def track(self, frame: Frame) -> FaceState:
        return LOST if frame.size == small_subject().size else super().track(frame)


class GoneFrom(SteadyTracker):
    """Sees no face from one frame on until before another."""

    def __init__(self, first: int, end: int) -> None:
        super().__init__()
        self._gone = range(first, end)

    def track(self, frame: Frame) -> FaceState:
        return LOST if frame.index in self._gone else super().track(frame)


@pytest.mark.parametrize(
    ("changes", "unlit"), [({}, False), ({"split": 0.5}, True), ({"blend": 0.0}, True), ({"blend": 0.5}, False)]
)
def test_a_picture_says_whether_a_part_of_it_is_as_filmed(changes: dict[str, float], unlit: bool) -> None:
    made, shown = pipeline(), scene(mode=Mode.LIVE, lighting=changes)
    assert [made.process(frame(index), shown).unlit for index in range(3)] == [unlit] * 3


class OneGrey:
    """A third mode: the whole picture in the grey of the subject's relit mean."""

    def __init__(self, context: ModeContext) -> None:
        self.context = context

    def begin(
        self, frame: Frame, motion: FaceMotion, scene: Scene, quality: RenderQuality, others: object
    ) -> RenderTask:
        relit = self.context.scene_relighting.relight(scene, motion.rotation, frame.time_s, quality.relight_every)
        width, height = self.context.size
        value = np.uint8(np.clip(255 * relit.mean(), 1, 255))
        return lambda: RenderedFrame(np.full((height, width, 3), value, np.uint8), motion, scene)


def with_third_mode(tracker: Tracker) -> Pipeline:
    """A pipeline whose mode live is another: its logic knows no mode by name."""
    modes = {**mode_factories(CPU), Mode.LIVE: OneGrey}
    return pipeline_of(tracker, modes)


def test_a_third_mode_needs_nothing_of_the_pipeline() -> None:
    made = with_third_mode(SteadyTracker())
    one, two = (
        made.process(frame(index), scene(mode=Mode.LIVE, lighting={"exposure_ev": ev, "transition_s": 0})).image
        for index, ev in enumerate((-1, 1))
    )
    assert len(np.unique(one)) == len(np.unique(two)) == 1
    assert two[0, 0, 0] > 2 * one[0, 0, 0] > 0
    assert made.troubles == []


def test_a_frame_in_which_a_subject_is_chosen_is_not_shown_unlit() -> None:
    wanted = scene()
    scenes = iter([replace(wanted, subject=None), wanted])
    rendered = pipeline().begin(frame(), lambda: next(scenes))()
    assert rendered.motion is not None
    assert difference(rendered.image, pipeline().process(frame(), wanted).image) == 0


def test_the_relighter_at_work_is_named_for_the_status() -> None:
    made = pipeline()
    assert made.providers == {}
    made.process(frame(), scene())
    assert made.providers == {"relighter basis": "cpu"}


class Everywhere:
    """A matting that sees the person in every pixel."""

    def matte(self, frame: Frame) -> Alpha:
        return np.full(frame.image.shape[:2], 255, np.uint8)


def test_it_says_when_models_are_opened() -> None:
    """For a subject, for a mode, and when a live person must first be parted from the room."""
    made, said = pipeline_of(SteadyTracker(), open_matte=Everywhere), []
    made.on_opening = lambda: said.append("opening")
    blurred, other = scene(mode=Mode.LIVE, background={"kind": "blur"}), replace(small_subject())
    live = scene(mode=Mode.LIVE)
    for wanted in (scene(), scene(), live, blurred, blurred, scene(), replace(scene(), subject=other)):
        made.process(frame(), wanted)
        said.append("picture")
    made.close()
    opened = ["opening", "picture"]
    first, first_live = ["opening", *opened], ["opening", *opened]  # who it is, the mode; the mode, the matte
    assert said == [*first, "picture", *first_live, "picture", "picture", *opened, *opened]


def test_it_starts_no_thread() -> None:
    before = set(threading.enumerate())
    made = pipeline()
    made.process(frame(), scene())
    made.process(frame(), scene(mode=Mode.LIVE))
    assert set(threading.enumerate()) <= before  # those of other tests may have ended meanwhile
    made.close()


class CountingTracker(SteadyTracker):
    """Counts the frames that it measures."""

    measured = 0

    def track(self, frame: Frame) -> FaceState:
        self.measured += 1
        return super().track(frame)


def test_each_frame_is_begun_with_the_quality_of_that_moment() -> None:
    asked: list[RenderQuality] = []

    class Noting(OneGrey):
        def begin(
            self, frame: Frame, motion: FaceMotion, scene: Scene, quality: RenderQuality, others: object
        ) -> RenderTask:
            asked.append(quality)
            return super().begin(frame, motion, scene, quality, others)

    tracker = CountingTracker()
    modes = {Mode.PORTRAIT: Noting, Mode.LIVE: Noting}
    made = pipeline_of(tracker, modes)
    noise = np.random.default_rng(0).integers(0, 255, grey().shape).astype(np.uint8)  # flow needs something to follow
    made.process(frame(0, noise), scene())
    before, made.quality = tracker.measured, QUALITY_LEVELS[-1]
    for index in range(1, 9):
        made.process(frame(index, noise), scene())
    made.close()
    assert asked == [FULL_QUALITY, *[QUALITY_LEVELS[-1]] * 8]
    assert tracker.measured - before == 4


@pytest.mark.parametrize(("mode", "measured"), [(Mode.PORTRAIT, 8), (Mode.LIVE, 4)])
def test_the_running_camera_measures_every_second_face_in_mode_live(mode: Mode, measured: int) -> None:
    tracker = CountingTracker()
    modes = {Mode.PORTRAIT: OneGrey, Mode.LIVE: OneGrey}
    made = pipeline_of(tracker, modes)
    noise = np.random.default_rng(0).integers(0, 255, grey().shape).astype(np.uint8)
    made.quality = QUALITY_LEVELS[0]
    made.process(frame(0, noise), scene(mode=mode))
    before = tracker.measured
    for index in range(1, 9):
        made.process(frame(index, noise), scene(mode=mode))
    made.close()
    assert tracker.measured - before == measured


@pytest.mark.parametrize("mode", list(Mode))
def test_a_closed_pipeline_holds_no_models_though_nobody_looks_for_cycles(mode: Mode) -> None:
    made, opened = pipeline(), list[weakref.ref[object]]()

    def open_and_note(subject: Subject) -> Relighter:
        relighter = open_relighter("basis", subject)
        opened.append(weakref.ref(relighter))
        return relighter

    made._open_relighter = open_and_note
    made.process(frame(), scene(mode=mode))
    compositor = weakref.ref(made._compositor)
    assert opened
    assert all(each() is not None for each in opened)
    gc.disable()
    try:
        made.close()
        made.close()
        assert not any(each() for each in opened)
        assert compositor() is None
    finally:
        gc.enable()
    assert made.providers == {}
