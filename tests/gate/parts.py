"""The parts of the gate: what each does, how long it usually takes, and which paths it is about.

A part without paths runs for every change, the others when a file there differs from what it was when they last passed.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass, field

PYTHON = sys.executable
PARTS_VARIABLE = "TEST_PARTS"
"""Names the parts whose tests a run of pytest takes; all of them where it is not set."""

_PACKAGED = ("pyproject.toml", "README.md", "LICENSE", "service", ":(exclude,glob)service/**/[!_]*.py")
"""What decides what is in the wheel. That its modules import nothing else is tested by `tests/test_layout.py`."""
_PROGRAM = ("service", "models", "config.yaml", "pyproject.toml")
CAPTURE = (
    *(f"service/relit_camera/{name}" for name in ("__init__.py", "plugins.py", "base", "devices", "light", "subject")),
    *(f"service/relit_camera/{name}" for name in ("face", "capture", "lab", "cli", "app/demo", "app/setup")),
    *(f"service/relit_camera/live/{name}" for name in ("compositing", "reenactment", "scene", "render_quality.py")),
    "service/relit_studio",
    "pyproject.toml",
)
"""The code by which people are rendered and become subjects."""
_CAPTURE_TESTS = (
    *(f"tests/{name}" for name in ("capture", "subject", "light", "fuzz", "base/images")),
    *(f"tests/studio/{name}" for name in ("capture", "field/test_solver.py", "mannequin", "people")),
    *(f"tests/cli/test_cli_{name}.py" for name in ("desk", "evaluate")),
    "tests/lab/test_stabilization_accuracy.py",
)
_ON_DEVICES = (
    *(
        f"service/relit_camera/{name}"
        for name in ("devices", "app", "cli", "live/publishing", "live/camera_control.py")
    ),
    "pyproject.toml",
)
"""The code that meets a real camera, a driver or a call app; what goes on behind it is tested without them."""
_HELPERS = (":(glob)tests/*.py", ":(glob)tests/**/[!t]*.py", ":(glob)tests/**/t[!e]*.py")
"""What tests import from each other: all of their files but the tests themselves."""


@dataclass(frozen=True)
class Need:
    """What a part needs of the machine, and how it is made ready.

    Attributes:
        command: makes it ready; exit status 69 where it cannot be had here, any other but 0 is a failure.
        variables: are set where it is ready, so that no test is skipped for want of it.
    """

    command: tuple[str, ...]
    variables: Mapping[str, str] = field(default_factory=dict)


UNAVAILABLE = 69
NEEDS = {
    "public networks": Need((PYTHON, "-m", "tests.package_index"), {"PACKAGE_INDEX_NEEDED": "1"}),
    "Chromium": Need(("sh", "tests/browser/install.sh"), {"BROWSER_NEEDED": "1"}),
    "PipeWire": Need(("sh", "tests/pipewire/install.sh"), {"PIPEWIRE_NEEDED": "1"}),
    "newer PipeWire": Need(("sh", "tests/pipewire/install.sh", "bookworm-backports"), {"PIPEWIRE_NEEDED": "1"}),
    "virtual machine": Need(("sh", "tests/vm/build.sh"), {"VM_NEEDED": "1"}),
}
"""In the order in which they are made ready, one after another."""


@dataclass(frozen=True)
class Part:
    """A check, or a set of tests.

    Attributes:
        name: one word.
        does: what it checks.
        usual: how long it takes on two cores.
        command: of a part that runs by itself. Those without one share a run of pytest.
        beside: it runs while the tests that share a run do, its output shown if it fails.
        tests: paths whose tests are of this part, unless an earlier part has them.
        slow: only those of them that are marked `slow`.
        about: git pathspecs of the files that it depends on, its own tests included.
        needs: what all of it needs of the machine, as named in `NEEDS`; it is left out where that cannot be had.
        wants: what some of its tests need, which are skipped where that cannot be had.
        variables: of the command's environment.
    """

    name: str
    does: str
    usual: str
    command: tuple[str, ...] = ()
    beside: bool = False
    tests: tuple[str, ...] = ()
    slow: bool = False
    about: tuple[str, ...] = ()
    needs: tuple[str, ...] = ()
    wants: tuple[str, ...] = ()
    variables: Mapping[str, str] = field(default_factory=dict)


def make_command(target: str) -> tuple[str, ...]:
    """A target of the Makefile."""
    return ("make", "--no-print-directory", target)


def pytest_command(*arguments: str) -> tuple[str, ...]:
    """A run of pytest."""
    return (PYTHON, "-m", "pytest", "-q", *arguments)


FLOWS = ("tests/browser/test_first_minute.py", "tests/browser/test_privacy.py")

PARTS = (
    Part(
        "types",
        "static types of all code",
        "100 s",
        make_command("types"),
        beside=True,
        about=(":(glob)**/*.py", "pyproject.toml"),
    ),
    Part(
        "image",
        "the image's build without Docker: the wheel, installed by itself, shows a picture",
        "60 s",
        make_command("image-steps"),
        beside=True,
        about=("docker", *_PACKAGED, "scripts/check_installed.py"),
    ),
    Part(
        "tools",
        "the wheel as people install it, with uv, used from an empty home",
        "40 s",
        make_command("tool-install"),
        beside=True,
        about=(*_PACKAGED, "scripts/check_tool_install.sh"),
    ),
    Part("lint", "style and formatting", "1 s", make_command("lint")),
    Part("layers", "which package may import which", "1 s", make_command("layers")),
    Part("scripts", "shell scripts, Dockerfile, compose files", "1 s", make_command("scripts")),
    Part("generated", "files built from code are what it builds", "3 s", make_command("generated")),
    Part(
        "cost",
        "what a picture costs, beside its record",
        "30 s",
        pytest_command("tests/lab/bench/test_recorded_cost.py"),
        tests=("tests/lab/bench/test_recorded_cost.py",),
        about=(
            *_PROGRAM,
            ":(exclude)service/relit_camera/api/panel",
            "docs/performance.json",
            *_HELPERS,
            "tests/lab/bench",
        ),
        needs=("public networks",),
    ),
    Part(
        "vm",
        "the camera on a real kernel, in a virtual machine",
        "6 min",
        pytest_command("tests/vm"),
        tests=("tests/vm",),
        about=(
            *_ON_DEVICES,
            "service/relit_camera/capture/desk",
            "service/relit_camera/api/server",
            "tests/vm",
            *_HELPERS,
        ),
        needs=("virtual machine",),
    ),
    Part(
        "pipewire",
        "the camera in a PipeWire session",
        "2 min",
        pytest_command("tests/pipewire"),
        beside=True,
        tests=("tests/pipewire",),
        needs=("PipeWire",),
    ),
    Part(
        "newer",
        "the same with the next PipeWire",
        "2 min",
        pytest_command("tests/pipewire"),
        beside=True,
        tests=("tests/pipewire",),
        about=(*_ON_DEVICES, "tests/pipewire", *_HELPERS),
        needs=("newer PipeWire",),
        variables={"PIPEWIRE_SUITES": "bookworm-backports"},
    ),
    Part(
        "flows",
        "the main ways through the panel, in Chromium",
        "95 s",
        pytest_command("-n", "2", "--dist", "worksteal", *FLOWS),
        tests=FLOWS,
        needs=("Chromium",),
        wants=("public networks",),
    ),
    Part(
        "panel",
        "all else in the panel",
        "4 min",
        pytest_command("-n", "2", "--dist", "worksteal", "tests/browser", *(f"--ignore={path}" for path in FLOWS)),
        tests=("tests/browser",),
        about=(
            *(f"service/relit_camera/{name}" for name in ("api", "app", "cli", "light", "devices/device_discovery.py")),
            *("pyproject.toml", "config.yaml", "tests/browser", "tests/devices", *_HELPERS),
        ),
        needs=("Chromium",),
        wants=("public networks",),
    ),
    Part(
        "faults",
        "the camera while its devices, files and networks fail",
        "60 s",
        tests=("tests/faults", "tests/test_crash.py", "tests/test_soak.py"),
        about=(*_PROGRAM, "tests/faults", *_HELPERS),
    ),
    Part(
        "captures",
        "whole films and pictures become subjects; studies of their accuracy",
        "2 min",
        tests=_CAPTURE_TESTS,
        slow=True,
        wants=("public networks",),
        about=(*CAPTURE, *_CAPTURE_TESTS, *_HELPERS),
    ),
    Part(
        "runs",
        "whole runs of the program: commands, jobs, replays",
        "3 min",
        tests=("tests",),
        slow=True,
        wants=("public networks",),
        about=(*_PROGRAM, "scripts", "docker", "tests", ":(exclude)tests/gate/passed.json"),
    ),
    Part("unit", "each unit, and the API", "2 min", tests=("tests",), wants=("public networks",)),
)


def part_of(path: str, slow: bool) -> Part:
    """The part that a test is of.

    Args:
        path: of its file, from the repository's root.
        slow: it is marked so.
    """
    return next(
        part
        for part in PARTS
        if (slow or not part.slow) and any(path == each or path.startswith(f"{each}/") for each in part.tests)
    )
