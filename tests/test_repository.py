"""The repository itself: that what is written down in several places agrees, and that nothing odd got in."""

from __future__ import annotations

import inspect
import pkgutil
import re
import subprocess
import tomllib
from importlib.metadata import entry_points
from pathlib import Path
from typing import get_args

import pytest
import yaml
from pydantic import BaseModel

import relit_camera
from relit_camera.base.config.settings import RelitSettings
from relit_camera.base.config.settings_loader import load_settings
from relit_camera.cli.main import COMMANDS

ROOT = Path(__file__).resolve().parents[1]
MAX_BYTES = 2_000_000
DEMO = ROOT / "service/relit_camera/app/demo/data"
"""The one exception to "no generated data": what `relit demo` shows."""
PICTURES = {".png", ".jpg", ".mp4", ".onnx", ".hdr", ".exr", ".npy", ".npz", ".relit"}
SEAMS = ("trackers", "methods", "relighters", "reenactors", "sources", "sinks")
LINK = re.compile(r"\[[^\]]*\]\(([^)#\s]+)(?:#[^)]*)?\)")
COMMAND = re.compile(r"(?:^\s*|[`/])relit ([a-z]+)\b(?! ─)", re.MULTILINE)
LEFTOVER = re.compile(r"\b(?:TODO|FIXME|XXX)\b|^(?:<{7}|>{7}) |breakpoint\(\)|/(?:root|Users)/", re.MULTILINE)


def tracked() -> list[Path]:
    """Files that git knows, and new ones that it does not ignore; all files of an unpacked source archive."""
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "-z"]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    if listed.returncode != 0:
        pytest.skip(f"no git repository at {ROOT}")
    return [path for name in listed.stdout.split("\0") if name and (path := ROOT / name).is_file()]


def pages() -> list[Path]:
    return [path for path in tracked() if path.suffix == ".md"]


def test_config_yaml_holds_the_defaults(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("RELIT_CONFIG", "RELIT_LOG_LEVEL"):
        monkeypatch.delenv(name, raising=False)
    assert load_settings(ROOT / "config.yaml").model_dump() == RelitSettings().model_dump()


def test_config_yaml_names_every_setting() -> None:
    text = (ROOT / "config.yaml").read_text()
    missing = [name for name in _settings_names(RelitSettings) if not re.search(rf"\b{name}\b", text)]
    assert missing == []


def test_every_setting_says_what_it_is() -> None:
    schema = RelitSettings.model_json_schema()
    described = {name for name, model in schema["$defs"].items() if model.get("description")}
    plain = {name for name, model in schema["$defs"].items() if model["type"] == "object"}
    assert plain <= described


def test_the_version_is_the_same_everywhere() -> None:
    project = re.search(r'^version = "(.+)"$', (ROOT / "pyproject.toml").read_text(), re.MULTILINE)
    newest = re.search(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    assert project
    assert newest
    assert relit_camera.__version__ == project[1] == newest[1]


@pytest.mark.parametrize("seam", SEAMS)
def test_every_plug_in_loads(seam: str) -> None:
    points = entry_points(group=f"relit_camera.{seam}")
    assert len(points) >= 2, "a seam is proven by two implementations"
    for point in points:
        assert callable(point.load())


def test_every_link_leads_somewhere() -> None:
    dead = [
        f"{page.relative_to(ROOT)}: {target}"
        for page in pages()
        for target in LINK.findall(page.read_text())
        if "://" not in target and not (page.parent / target).exists()
    ]
    assert dead == []


def test_pages_name_commands_that_exist() -> None:
    unknown = {
        f"{page.relative_to(ROOT)}: relit {command}"
        for page in pages()
        for command in COMMAND.findall(_code(page.read_text()))
        if command not in COMMANDS
    }
    assert unknown == set()


def test_the_architecture_page_names_what_there_is() -> None:
    parts = "|".join(path.stem for path in (ROOT / "service/relit_camera").iterdir() if path.name[0] != "_")
    names = re.findall(rf"\b(?<![./_])(?:{parts})(?:\.[A-Za-z_0-9]+)+", (ROOT / "docs/architecture.md").read_text())
    named = {name for name in names if name.rpartition(".")[2] not in ("py", "md", "onnx", "lp", "hdr", "yaml")}
    assert len(named) > 20
    assert {name for name in named if not _exists(name)} == set()


def test_the_readme_begins_with_targets_that_the_makefile_has() -> None:
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    named = re.findall(r"^\s*make ([a-z-]+)", (ROOT / "README.md").read_text(), re.MULTILINE)
    assert named[:2] == ["demo", "test"]
    assert set(named) <= targets


def test_every_module_with_settings_of_its_own_for_mypy_exists() -> None:
    overrides = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["mypy"]["overrides"]
    named = [name for override in overrides for name in override["module"] if name.startswith(("tests.", "scripts."))]
    exact = [name for name in named if not name.endswith(".*")]
    assert [name for name in exact if not (ROOT / name.replace(".", "/")).with_suffix(".py").is_file()] == []


def test_no_file_is_large() -> None:
    assert [path for path in tracked() if path.stat().st_size > MAX_BYTES and path.parent != DEMO] == []


def test_the_demonstration_is_as_small_as_it_should_be() -> None:
    bytes_of = {path.name: path.stat().st_size for path in DEMO.iterdir()}
    assert bytes_of["adam.relit"] <= 8_000_000
    assert bytes_of["clip.mp4"] <= 4_000_000
    assert sum(bytes_of.values()) <= 14_000_000


def test_files_are_clean() -> None:
    for path in tracked():
        if path.suffix in PICTURES or path.name == "LICENSE" or "LICENSE" in path.name:
            continue
        text = path.read_text(encoding="utf-8")
        assert text == "" or text.endswith("\n"), f"{path} does not end with a line's end"
        assert not re.search(r"[ \t]\n", text), f"{path} has space at a line's end"
        found = None if path.suffix == ".svg" or path == Path(__file__) else LEFTOVER.search(text)
        assert not found, f"{path} has a leftover: {found}"


def test_yaml_files_are_yaml() -> None:
    for path in tracked():
        if path.suffix in (".yaml", ".yml"):
            assert yaml.safe_load(path.read_text()) is not None, path


def _code(text: str) -> str:
    """The parts of a page that are code: indented, fenced or between backquotes."""
    fenced = re.findall(r"^```.*?^```", text, re.MULTILINE | re.DOTALL)
    indented = re.findall(r"^ {4}.*$", text, re.MULTILINE)
    return "\n".join([*fenced, *indented, *re.findall(r"`[^`\n]+`", text)])


def _exists(dotted: str) -> bool:
    """Whether a dotted name below relit_camera is a module or something in one; what a class gives itself counts."""
    try:
        pkgutil.resolve_name(f"relit_camera.{dotted}")
    except AttributeError:
        owner, _, name = dotted.rpartition(".")
        holder = pkgutil.resolve_name(f"relit_camera.{owner}")
        return inspect.isclass(holder) and f"self.{name} = " in inspect.getsource(holder)
    return True


def _settings_names(model: type[BaseModel]) -> set[str]:
    names = set()
    for name, info in model.model_fields.items():
        names.add(name)
        for inner in (info.annotation, *get_args(info.annotation)):
            if isinstance(inner, type) and issubclass(inner, BaseModel):
                names |= _settings_names(inner)
    return names
