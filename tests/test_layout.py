"""The layout of both packages: few entries in a folder, short modules, standard names that occur once in a package."""

from __future__ import annotations

import ast
import contextlib
import re
import sys
import tomllib
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path

import pytest

SERVICE = Path(__file__).resolve().parents[1] / "service"
PACKAGES = (SERVICE / "relit_camera", SERVICE / "relit_studio")
MAX_ENTRIES = 12
MAX_LINES = 400
ONE_A_COMMAND = {"relit_camera/cli/commands", "relit_studio/commands"}
"""Folders that hold one module for each command line command, however many there are."""
SHARED_NAMES = {"__init__", "__main__", "main"}
SAME_WORD = {
    "subject": {"relit_camera/subject/subject.py", "relit_camera/cli/commands/subject.py"},
    "person": {"relit_studio/people/person.py", "relit_studio/commands/person.py"},
}
"""Modules of the same name that are both rightly called so: a command and what it is about."""

OLD_CLASSES = frozenset(
    """
    Line LineKeeper Daemon StandIn Director Composer Cast Finish Finished Claim Stage Move Moved RoomProbe Glimpse Kind
    Reached Press Guide
    """.split()  # noqa: SIM905
)
OLD_NAMES = frozenset(
    """
    daemon director composer stand_in line_keeper holders revive admit_environment room_probe glimpse look_at
    leave_to_stay share_cores keep_picture_memory lamp_places wander
    """.split()  # noqa: SIM905
)
"""Words of the private dialect that `docs/glossary.md` replaced by standard terms."""


def modules() -> list[Path]:
    return sorted(path for package in PACKAGES for path in package.rglob("*.py"))


def folders() -> list[Path]:
    return sorted({path.parent for path in modules()})


def name_of(path: Path) -> str:
    return path.relative_to(SERVICE).as_posix()


def entries(folder: Path) -> list[str]:
    """Modules and folders of modules that a reader sees in a folder."""
    return sorted(
        path.name
        for path in folder.iterdir()
        if path != SERVICE / "relit_camera/plugins.py"  # not a topic: what plug-ins import, from everywhere
        if (path.suffix == ".py" and path.name != "__init__.py") or (path / "__init__.py").exists()
    )


def defined_names(tree: ast.AST) -> Iterator[tuple[str, bool]]:
    """Every name that a module defines or assigns, and whether it is a class."""
    for node in ast.walk(tree):
        match node:
            case ast.ClassDef(name=name):
                yield name, True
            case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name) | ast.arg(arg=name):
                yield name, False
            case ast.Name(id=name, ctx=ast.Store()) | ast.Attribute(attr=name, ctx=ast.Store()):
                yield name, False
            case ast.alias(asname=str(name)):
                yield name, False


def old_names(text: str) -> set[str]:
    """Names of the old dialect in a module's text."""
    named = ((name.lstrip("_"), is_class) for name, is_class in defined_names(ast.parse(text)))
    return {name for name, is_class in named if name in (OLD_CLASSES if is_class else OLD_NAMES)}


def test_a_folder_has_few_entries() -> None:
    found = {name_of(folder): entries(folder) for folder in folders()}
    assert len(found) > 30
    assert {name: held for name, held in found.items() if len(held) > MAX_ENTRIES and name not in ONE_A_COMMAND} == {}


def test_a_module_is_short() -> None:
    lengths = {name_of(path): len(path.read_text(encoding="utf-8").splitlines()) for path in modules()}
    assert {name: length for name, length in lengths.items() if length > MAX_LINES} == {}


def test_a_module_s_name_occurs_once() -> None:
    by_name: dict[tuple[Path, str], set[str]] = {}
    for path in modules():
        if path.stem not in SHARED_NAMES:
            package = next(package for package in PACKAGES if package in path.parents)
            by_name.setdefault((package, path.stem), set()).add(name_of(path))
    assert [paths for (_, name), paths in by_name.items() if len(paths) > 1 and paths != SAME_WORD.get(name)] == []


@pytest.mark.parametrize("path", modules(), ids=name_of)
def test_a_module_says_what_it_is_in_standard_words(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert ast.get_docstring(ast.parse(text)), "a module begins with what it is"
    assert old_names(text) == set()


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("class StandIn: pass", {"StandIn"}),
        ("class _Cast: pass", {"Cast"}),
        ("def revive(device): pass", {"revive"}),
        ("def run(daemon): pass", {"daemon"}),
        ("self.director = None", {"director"}),
        ("import camera_service as daemon", {"daemon"}),
        ("Thread(daemon=True).start()", set()),
        ("class Pipeline: pass", set()),
    ],
)
def test_old_names_are_found(text: str, found: set[str]) -> None:
    assert old_names(text) == found


def test_modules_import_what_is_declared() -> None:
    """Of other packages what dependencies bring, as the program starts where no development tool is installed."""
    project = tomllib.loads((SERVICE.parent / "pyproject.toml").read_text())["project"]
    optional = project["optional-dependencies"]
    needed = _with_their_own([*project["dependencies"], *optional["gpu"], *optional["evaluate"]])
    brought = {module for module, names in metadata.packages_distributions().items() if needed & {*map(_key, names)}}
    known = sys.stdlib_module_names | brought | {package.name for package in PACKAGES}
    foreign = {
        f"{name_of(path)} imports {name}"
        for path in modules()
        if "cycles/worker" not in name_of(path)  # runs in Blender's own Python
        for node in ast.walk(ast.parse(path.read_text()))
        for name in _imported(node)
        if name.partition(".")[0] not in known and _key(name.partition(".")[0]) not in needed
    }
    assert foreign == set()


def _imported(node: ast.AST) -> list[str]:
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names]
    return [node.module] if isinstance(node, ast.ImportFrom) and node.module and not node.level else []


def _key(name: str) -> str:
    return re.sub("[-_.]+", "-", name).lower()


def _with_their_own(requirements: list[str]) -> set[str]:
    """Names of the distributions that these need, and those need in turn; without what only their extras do."""
    found, open_ = set[str](), requirements
    while open_:
        name = _key(re.split(r"[^A-Za-z0-9._-]", open_.pop())[0])
        if name not in found:
            found.add(name)
            with contextlib.suppress(metadata.PackageNotFoundError):
                open_ += [each for each in metadata.requires(name) or () if "extra ==" not in each]
    return found
