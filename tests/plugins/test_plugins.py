"""A package of somebody else's brings one plug-in of each kind; settings select each of them, and it runs."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import httpx
import numpy as np
import pytest

from relit_camera import plugins
from relit_camera.app.wiring import make_pipeline, make_tracker, require_plugins
from relit_camera.base.config.settings import RelitSettings
from relit_camera.base.config.settings_loader import load_settings
from relit_camera.base.errors import ConfigError, InputError, NotFoundError, PluginError
from relit_camera.base.images.image_types import Frame
from relit_camera.base.plugin_groups import PluginGroup
from relit_camera.capture.reflectance.method_registry import METHODS
from relit_camera.capture.subject_builder import build_subject
from relit_camera.devices.sinks.sink_factory import SINKS, open_sink
from relit_camera.devices.sources.source_factory import SOURCES, open_source
from relit_camera.face.tracking.trackers import TRACKERS, open_tracker
from relit_camera.live.reenactment.reenactor import REENACTORS
from relit_camera.live.scene.scene import Scene
from relit_camera.live.status.camera_status import DegradationCode
from relit_camera.live.status.event_hub import EventHub
from relit_camera.live.status.status_board import StatusBoard
from relit_camera.subject.relighting.relighter import RELIGHTERS
from tests.cli.relit_command import Material, call, start
from tests.generated_subject import small_subject
from tests.small_camera import wait_until
from tests.synthetic import sphere_samples

FOLDER = Path(__file__).parent
PACKAGE = "relit_example_plugin"
GROUPS: list[PluginGroup] = [TRACKERS, METHODS, RELIGHTERS, REENACTORS, SOURCES, SINKS]
CONFIG = """
source: {source: "example:77", width: 320, height: 240, fps: 100}
output: {sink: "example:shelf", width: 160, height: 90}
tracker: {name: "example:120"}
relight: {name: "example:2"}
reenact: {name: example}
look: {mode: portrait, lighting: {environment: null, lamps: [{azimuth_deg: 0, elevation_deg: 0}]}}
"""


@pytest.fixture
def installed(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The package as it is found after `pip install`."""
    monkeypatch.syspath_prepend(FOLDER)
    yield
    sys.modules.pop(PACKAGE, None)


@pytest.fixture
def settings(tmp_path: Path) -> RelitSettings:
    path = tmp_path / "config.yaml"
    path.write_text(CONFIG)
    return load_settings(path)


@pytest.mark.usefixtures("installed")
def test_a_camera_of_nothing_but_plug_ins(settings: RelitSettings) -> None:
    source, sink = open_source(settings.source), open_sink(settings.output)
    size = (settings.output.width, settings.output.height)
    pipeline = make_pipeline(settings, make_tracker(settings), size)
    scene = Scene(settings.look, None, None, "small", small_subject())
    frame = source.read(1.0)
    assert frame is not None
    assert frame.size == (320, 240)
    assert (frame.image == 77).all()
    rendered = pipeline.process(frame, scene)
    sink.write(rendered.image)

    assert (sink.describe().kind, sink.describe().id, sink.describe().size) == ("example", "shelf", size)
    (picture,) = sys.modules[PACKAGE].Collector.made[-1].pictures
    assert rendered.motion is not None
    assert np.ptp(rendered.motion.landmarks[:, 0]) == pytest.approx(120, rel=0.01)
    assert pipeline.providers == {"relighter example": "numpy"}
    # The reenactor's corner shows the relighter's one color; the rest is the background.
    width, height = small_subject().size
    inside = small_subject().matte == 1
    corner = picture[:height, :width][inside]
    assert (corner == corner[0]).all()
    assert corner[0, 0] > picture[:, width + 1 :].max() + 50


@pytest.mark.usefixtures("installed")
def test_a_subject_is_built_by_a_plug_in_method() -> None:
    samples = sphere_samples(40, 16)
    subject = build_subject(samples, "example", "sphere", landmarks={"none": np.zeros((1, 2), np.float32)})
    assert subject.metadata.method == "example"
    assert "example" in METHODS.names()


@pytest.mark.slow
@pytest.mark.usefixtures("installed")
def test_relit_run_takes_plug_ins_from_its_configuration(
    material: Material, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONPATH", str(FOLDER))
    config = tmp_path / "config.yaml"
    config.write_text(CONFIG)
    process = start("--config", config, "run", "--port", 0, "--subject", material.subject, folder=tmp_path)
    try:
        assert process.stdout is not None
        line = process.stdout.readline()
        assert "the panel is at " in line, process.stderr and process.stderr.read()
        with httpx.Client(base_url=line.split()[-1] + "api/v1/", timeout=60) as http:
            wait_until(lambda: http.get("status").json()["state"] == "live")
            status = http.get("status").json()
        assert (status["source"], status["sink"]) == ("example example:77", "example shelf")
        assert status["tracker"] == {"name": "example", "state": "found"}
        assert status["providers"]["relighter example"] == "numpy"
        assert status["degraded"] == []
    finally:
        process.terminate()
        process.communicate()


def test_without_the_package_its_names_are_unknown(settings: RelitSettings, tmp_path: Path) -> None:
    for group in GROUPS:
        assert not group.has("example")
        with pytest.raises(NotFoundError, match=f"no {group.kind} is called 'example'; there are: "):
            group.load("example:1")
    with pytest.raises(NotFoundError, match="tracker"):
        require_plugins(settings)
    call("track", tmp_path, "--out", tmp_path / "t.json", "--tracker", "example").complains("example", "mesh")


CHOICES: list[tuple[str, dict[str, str]]] = [
    ("relighter", {"relight": "sun"}),
    ("reenactor", {"reenact": "puppet"}),
    ("tracker", {"tracker": "eyes"}),
]


@pytest.mark.parametrize(("kind", "chosen"), CHOICES, ids=[kind for kind, _ in CHOICES])
def test_an_unknown_name_is_found_before_anything_is_opened(kind: str, chosen: dict[str, str]) -> None:
    wrong = RelitSettings.model_validate({section: {"name": name} for section, name in chosen.items()})
    with pytest.raises(NotFoundError, match=f"no {kind} is called"):
        require_plugins(wrong)


@pytest.mark.usefixtures("installed")
def test_a_package_that_cannot_be_imported_is_named() -> None:
    with pytest.raises(ConfigError, match="tracker 'broken' of the package relit-example-plugin cannot be"):
        open_tracker("broken")


@pytest.mark.usefixtures("installed")
def test_two_packages_with_one_name_are_both_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    other = tmp_path / "other_package-2.0.dist-info"
    other.mkdir()
    (other / "METADATA").write_text("Metadata-Version: 2.1\nName: other-package\nVersion: 2.0\n")
    (other / "entry_points.txt").write_text("[relit_camera.trackers]\nexample = relit_example_plugin:CentralFace\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ConfigError, match="several packages have a tracker 'example': other-package, relit-example"):
        TRACKERS.load("example")


@pytest.mark.usefixtures("installed")
def test_a_plug_in_that_cannot_be_made_is_no_fault_of_ours(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level("DEBUG", "relit_camera"), pytest.raises(PluginError) as caught:
        open_tracker("raising")
    assert str(caught.value) == (
        "tracker 'raising' of the package relit-example-plugin cannot be opened: "
        "ZeroDivisionError: a fault of the example's; "
        "tell its author, with the traceback that --log-level debug shows; or choose another"
    )
    assert "relit_example_plugin/__init__.py" in caplog.text
    with pytest.raises(InputError, match="takes no argument"):  # what it says itself stays as it is
        REENACTORS.load("example:1")[0](cast(plugins.ReenactorContext, SimpleNamespace(argument="1")))


@pytest.mark.usefixtures("installed")
def test_a_plug_in_that_fails_later_is_told_from_a_fault_of_ours() -> None:
    board = StatusBoard(EventHub())
    frame = Frame(np.zeros((2, 2, 3), np.uint8), 0, 0.0, 0.0)
    with pytest.raises(FileNotFoundError) as caught:
        open_tracker("raising:later").track(frame)
    board.report(DegradationCode.PICTURE_FAILED, caught.value)
    (degradation,) = board.degradations()
    assert degradation.cure == "this is a fault of the plug-in package relit-example-plugin: tell its author"
    board.report(DegradationCode.PICTURE_FAILED, ZeroDivisionError("not raised in a plug-in"))
    (degradation,) = board.degradations()
    assert degradation.cure == "this is a fault of ours: report it"


@pytest.mark.slow
def test_a_command_names_the_package_whose_plug_in_fails(
    material: Material, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONPATH", str(FOLDER))
    process = start("track", material.clip, "--out", tmp_path / "t.json", "--tracker", "raising:later", folder=tmp_path)
    _, errors = process.communicate()
    assert process.returncode == 1
    assert "Traceback" in errors
    assert errors.endswith("relit: this is a fault of the plug-in package relit-example-plugin: tell its author\n")


WITHOUT_ARGUMENT: list[Callable[[], object]] = [
    lambda: open_source(RelitSettings.model_validate({"source": {"source": "pattern:3"}}).source),
    lambda: open_sink(RelitSettings.model_validate({"output": {"sink": "null:3"}}).output),
    lambda: build_subject(sphere_samples(40, 16), "nearest:3", "sphere"),
]


@pytest.mark.parametrize("opening", WITHOUT_ARGUMENT, ids=["source", "sink", "method"])
def test_an_argument_that_is_not_taken_is_an_error(opening: Callable[[], object]) -> None:
    with pytest.raises(InputError, match="takes no argument, and got '3'"):
        opening()


@pytest.mark.parametrize("group", GROUPS, ids=lambda group: group.kind)
def test_what_is_built_in_takes_an_argument_only_if_its_group_says_so(group: PluginGroup) -> None:
    assert set(group.with_argument) <= set(group.names())
    for name in group.names():
        if name in group.with_argument:
            assert group.load(f"{name}:3")[1] == "3"
        else:
            with pytest.raises(InputError, match=f"{name} takes no argument, and got '3'; name it '{name}'"):
                group.load(f"{name}:3")


def test_the_public_names_stay() -> None:
    """A name that goes breaks plug-ins of other people: only a new major version may take one away."""
    assert sorted(plugins.__all__) == sorted((FOLDER / "public_names.txt").read_text().split())


def test_the_public_module_names_every_group() -> None:
    named = re.findall(r"^    (relit_camera\.\w+)", plugins.__doc__ or "", re.MULTILINE)
    assert sorted(named) == sorted(group.group for group in GROUPS)


def test_the_example_imports_the_public_module_alone() -> None:
    imports = re.findall(r"(?:from|import) (relit_\S+)", (FOLDER / PACKAGE / "__init__.py").read_text())
    assert imports == ["relit_camera.plugins"]
