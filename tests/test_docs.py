"""The documentation against the code: tables, limits, names, commands and settings that pages mention exist."""

from __future__ import annotations

import ast
import inspect
import json
import pkgutil
import re
import shlex
from pathlib import Path
from typing import Any

import pytest
import typer
from pydantic import BaseModel
from typer.core import TyperCommand, TyperGroup

from relit_camera.api.dependencies import MAX_IMAGE_WORK
from relit_camera.api.middleware.body_limits import MAX_JSON_BYTES, MAX_UPLOAD_BYTES
from relit_camera.api.middleware.upload_limits import MAX_UPLOADS
from relit_camera.api.preview_stream import MAX_FRAMES_SENT_PER_S, MAX_VARIANTS, MAX_VIEWERS
from relit_camera.api.problem_details import PROBLEM_TYPES
from relit_camera.api.server.connection_timeouts import MIN_BODY_BYTES_PER_TIMEOUT, WRITE_TIMEOUT_S
from relit_camera.base.concurrency import decoding_process
from relit_camera.base.config.access_token import MIN_TOKEN_LENGTH
from relit_camera.base.config.settings import RelitSettings, StorageSettings
from relit_camera.base.images.image_limits import (
    MAX_DECODED_BYTES,
    MAX_EXR_VALUES,
    MAX_FILE_BYTES,
    MAX_IMAGE_PIXELS,
    MAX_JPEG_SCANS,
)
from relit_camera.base.models.model_manifest import public_manifest
from relit_camera.base.safe_yaml import MAX_YAML_BYTES, MAX_YAML_DEPTH, MAX_YAML_NODES
from relit_camera.base.video import video_decoding
from relit_camera.capture import lights_file, subject_landmarks
from relit_camera.cli.main import app
from relit_camera.face import matte_files
from relit_camera.face.tracking import track_recording
from relit_camera.light.environments.environment_panorama import MAX_PANORAMA_PIXELS
from relit_camera.live.scene.background_store import MAX_SIDE_PX as MAX_BACKGROUND_SIDE_PX
from relit_camera.live.status.camera_status import DegradationCode
from relit_camera.subject import subject_file
from relit_camera.subject.expression_stills import STILL_TENSORS
from relit_camera.subject.subject import MAX_SIDE_PX
from tests.doc_tables import DOCS, ROOT, imports_between_parts, layers, updated

SERVICE = ROOT / "service"
PACKAGE = SERVICE / "relit_camera"
PAGES = sorted([*DOCS.glob("*.md"), *ROOT.glob("*.md"), ROOT / "docker/README.md", ROOT / "models/README.md"])
MIB = 1 << 20
OLD_WORDS = re.compile(
    r"\b(the|a|subject's|relit|captured) still\b(?! picture)|\bstand-ins?\b|\bstand(s|ing)? in for\b"
    r"|\bpicture path\b|\blive chain\b|\bLineKeeper\b|\bDaemon\b|\bDirector\b|\bComposer\b"
    r"|\bbackdrop\b|\bfloors\b|\b[Mm]ode (ratio|reenact)\b",
)
"""What parts and pictures were called before; CHANGELOG.md and the words of the glossary's third column aside."""


def rows(page: str, heading: str) -> list[list[str]]:
    """The cells of the first table under a heading of a page of docs, without its head."""
    text = (DOCS / page).read_text().split(f"\n{heading}\n", 1)[1]
    table = re.search(r"(?:^\|.*\n)+", text, re.MULTILINE)
    assert table
    return [[cell.strip() for cell in line.strip("|").split(" | ")] for line in table[0].splitlines()[2:]]


def code(text: str) -> str:
    """The parts of a page that are code: indented, fenced or between backquotes."""
    fenced = re.findall(r"^```.*?^```", text, re.MULTILINE | re.DOTALL)
    indented = re.findall(r"^ {4}.*$", text, re.MULTILINE)
    return "\n".join([*fenced, *indented, *re.findall(r"`[^`\n]+`", text)])


def test_generated_tables_are_what_the_code_makes() -> None:
    stale = [path.name for path in DOCS.glob("*.md") if updated(path.read_text()) != path.read_text()]
    assert stale == [], "run: python -m tests.doc_tables"


def test_a_folder_imports_only_folders_below_it() -> None:
    level = {name: index for index, layer in enumerate(layers()) for name in layer}
    upward = [
        (one, other) for one, used in imports_between_parts().items() for other in used if level[other] <= level[one]
    ]
    assert upward == []


@pytest.mark.parametrize("page", ["architecture.md", "../CONTRIBUTING.md"])
def test_folder_tables_name_every_folder(page: str) -> None:
    heading = "## Find your way" if "CONTRIBUTING" in page else "## Folders and layers"
    named = [row[0].strip("`") for row in rows(page, heading)]
    assert named == [name for layer in layers() for name in layer]
    parts = {path.stem for path in PACKAGE.iterdir() if path.suffix == ".py" or (path / "__init__.py").exists()}
    assert set(named) == parts - {"__init__"}


def test_the_table_of_threads_names_every_thread() -> None:
    found = set()
    for path in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and ast.unparse(node.func).endswith(("Thread", "ThreadPoolExecutor")):
                named = [keyword.value for keyword in node.keywords if keyword.arg in ("name", "thread_name_prefix")]
                named += node.args[1:2] if ast.unparse(node.func).endswith("Executor") else []
                # Other names are arguments of what starts threads for others.
                found |= {ast.unparse(value).split("'")[1] for value in named if "'" in ast.unparse(value)}
            elif isinstance(node, ast.Call) and ast.unparse(node.func) in ("BackgroundJob", "checking_regularly"):
                found.add(ast.literal_eval(node.args[0]))
    documented = {row[0].strip("`") for row in rows("architecture.md", "## Threads")}
    assert {re.sub(r"\{.*\}", "KIND", name) for name in found} == documented


def test_the_table_of_operations_is_that_of_the_api() -> None:
    paths = json.loads((DOCS / "openapi.json").read_text())["paths"]
    served = {path.removeprefix("/api/v1/"): {method.upper() for method in methods} for path, methods in paths.items()}
    documented = {row[0].strip("`"): set(row[1].split()) for row in rows("api.md", "## Operations")}
    assert documented == served


def test_the_table_of_errors_is_that_of_the_api() -> None:
    documented = {int(row[0]): row[1].strip("`") for row in rows("api.md", "## Errors")}
    assert documented == {status: kind for status, (kind, _) in PROBLEM_TYPES.items()}


def test_the_table_of_events_names_all_that_are_published() -> None:
    documented = {name for row in rows("api.md", "## Events") for name in re.findall(r"`([a-z-]+)`", row[0])}
    source = "\n".join(path.read_text() for path in PACKAGE.rglob("*.py"))
    assert set(re.findall(r"events\.publish\(\s*\"([a-z-]+)\"", source)) <= documented


def test_the_table_of_degradations_names_every_code() -> None:
    documented = {row[0].strip("`") for row in rows("api.md", "### Degradations")}
    assert documented == {str(code) for code in DegradationCode}


LIMITS = {
    "a file sent": [f"{MAX_UPLOAD_BYTES // MIB} MiB"],
    "JSON sent": [f"{MAX_JSON_BYTES // MIB} MiB"],
    "a picture": [
        f"{MAX_IMAGE_PIXELS // 10**6} million pixels",
        f"{MAX_DECODED_BYTES // 10**6} MB",
        f"{MAX_FILE_BYTES // MIB} MiB",
        f"{MAX_JPEG_SCANS} scans",
    ],
    "a panorama": [f"{MAX_PANORAMA_PIXELS / 1e6:.1f} million", f"{MAX_EXR_VALUES // 10**6} million values"],
    "a video's picture": [f"{video_decoding.MAX_PIXELS // 10**6} million", f"{video_decoding.MAX_SIDE} a side"],
    "decoding a file": [
        f"{decoding_process.MOST_BYTES // (1 << 30)} GiB",
        f"{decoding_process.CPU_LIMIT_S} s",
    ],
    "files that are received": [f"{MAX_UPLOADS}"],
    "requests that read": [f"{MAX_IMAGE_WORK}"],
    "the data folder": [f"{StorageSettings().quota_gb:.0f} GB"],
    "a stored background": [f"{MAX_BACKGROUND_SIDE_PX} pixels"],
    "a preset's or settings file": [
        f"{MAX_YAML_BYTES // MIB} MiB",
        f"{MAX_YAML_DEPTH} levels",
        f"{MAX_YAML_NODES:,} values",
    ],
    "a subject that is shown by the camera": [f"{subject_file.MAX_COPIED_BYTES // (1 << 30)} GiB"],
    "a subject file elsewhere": [f"{subject_file.MAX_BYTES // (1 << 30)} GiB"],
    "any subject file": [
        f"{subject_file.MAX_TENSORS} tensors",
        f"{subject_file.MAX_DIMENSIONS} dimensions",
        f"{subject_file.MAX_HEADER_BYTES // MIB} MiB",
        f"{MAX_SIDE_PX} pixels",
    ],
    "a recorded matte": [f"{matte_files.MAX_RECORDED_BYTES // (1 << 30)} GiB", f"{matte_files.MAX_MEMBERS} members"],
    "a track; landmarks; an .lp file": [
        "; ".join(f"{module.MAX_BYTES // MIB} MiB" for module in (track_recording, subject_landmarks, lights_file))
    ],
    "previews": [f"{MAX_VIEWERS} viewers", f"{MAX_VARIANTS} variants", f"{MAX_FRAMES_SENT_PER_S} pictures a second"],
}
"""How a row of the table of limits begins → what must stand in it."""


def test_the_table_of_limits_is_that_of_the_code() -> None:
    table = rows("api.md", "## Limits")
    assert len(table) == len(LIMITS)
    for start, figures in LIMITS.items():
        texts = [row[1] for row in table if row[0].startswith(start)]
        assert [all(figure in text for figure in figures) for text in texts] == [True], (start, figures)


def test_limits_in_prose_are_those_of_the_code() -> None:
    security = " ".join((ROOT / "SECURITY.md").read_text().split())
    assert f"{MIN_TOKEN_LENGTH} characters" in security
    assert f"{MIN_BODY_BYTES_PER_TIMEOUT >> 10} KiB" in security
    assert WRITE_TIMEOUT_S == 10, "SECURITY.md and docs/api.md say ten seconds"
    light = " ".join((DOCS / "light.md").read_text().split())
    assert f"{MAX_PANORAMA_PIXELS / 1e6:.1f} million pixels" in light


def test_the_table_of_tensors_is_that_of_the_subject_file() -> None:
    local = {subject_file.LOCAL_BASIS_PREFIX + name for name in subject_file.LOCAL_BASIS_TENSORS}
    documented = {row[0].strip("`"): row[2] for row in rows("formats.md", "## Subject: `.relit`")}
    landmarks = subject_file.LANDMARKS_PREFIX + "SCHEME"
    optional = {*subject_file.OPTIONAL_TENSORS, *STILL_TENSORS, landmarks}
    assert set(documented) == {*local, *subject_file.REQUIRED_TENSORS, *optional}
    for name, written in documented.items():
        allowed = {kind.__name__ for kind in subject_file.DTYPES.get(name, ())} or {"float32"}
        assert set(written.split(" or ")) <= allowed, name


def test_the_models_page_has_a_card_for_each_model() -> None:
    headings = re.findall(r"^### (.*)$", (DOCS / "models.md").read_text(), re.MULTILINE)
    assert {name for heading in headings for name in heading.split(", ")} == set(public_manifest().models)


def test_the_glossary_has_some_forty_terms_each_once() -> None:
    text = (DOCS / "glossary.md").read_text()
    terms = [
        term
        for head in re.findall(r"^## .*$", text, re.MULTILINE)
        for term in (row[0] for row in rows("glossary.md", head))
    ]
    assert 20 <= len(terms) <= 44
    assert len(set(terms)) == len(terms)
    for page in ("README.md", "CONTRIBUTING.md"):
        assert "docs/glossary.md" in (ROOT / page).read_text()


@pytest.mark.parametrize("page", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_modules_and_files_that_a_page_names_exist(page: Path) -> None:
    parts = "|".join(name for layer in layers() for name in layer)
    text = page.read_text()
    dotted = re.findall(rf"(?<![\w./_-])(?:relit_camera\.)?((?:{parts})(?:\.[A-Za-z_0-9]+)+)", code(text))
    settings = set(RelitSettings.model_fields)
    unknown = {
        name for name in dotted if name.split(".")[0] not in settings and not _is_file(name) and not _exists(name)
    }
    paths = re.findall(r"`([\w/-]+/[\w/.-]*)`", text)
    known = (ROOT, SERVICE, PACKAGE, page.parent, ROOT / "tests/vm", SERVICE / "relit_studio")
    unknown |= {path for path in paths if _names_code(path) and not _found(path, known)}
    names = {path.name for folder in (SERVICE, ROOT / "tests") for path in folder.rglob("*.py")}
    unknown |= {name for name in re.findall(r"`(\w+\.py)`", text) if name not in names}
    assert unknown == set()


@pytest.mark.parametrize("page", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_options_that_a_page_gives_to_commands_exist(page: Path) -> None:
    unknown = []
    joined = code(page.read_text()).replace("\\\n", " ")
    for line in re.findall(r"(?:^\s*|[`$])relit ([a-z].*)", joined, re.MULTILINE):
        words = shlex.split(line.split("#")[0].split("`")[0].replace("'", "").replace('"', ""))
        command, names = _command(words)
        unknown += [f"relit {' '.join(names)} {word}" for word in _options(words) if word not in _option_names(command)]
    assert unknown == []


def test_the_options_of_the_capture_page_exist() -> None:
    documented = {name for row in rows("capture.md", "## Build") for name in re.findall(r"`(--[a-z-]+)", row[0])}
    assert documented <= _option_names(_command(["capture", "build"])[0])
    assert len(documented) > 10


def test_the_messages_that_the_capture_page_quotes_exist() -> None:
    written = set()
    for path in [*(PACKAGE / "capture").rglob("*.py"), *(PACKAGE / "base/video").rglob("*.py")]:
        constants = (node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Constant))
        written |= {constant.value for constant in constants if isinstance(constant.value, str)}
    quoted = [
        piece
        for row in rows("capture.md", "## When it refuses")
        for piece in re.split(r"; |…%?(?: \(.*\))?|, or ", row[0])
    ]
    pieces = [piece.strip(" :,") for piece in quoted if len(piece.strip()) > 8]
    assert len(pieces) > 20
    assert [piece for piece in pieces if not any(piece in text for text in written)] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_settings_that_a_page_names_exist(page: Path) -> None:
    sections = [name for name, field in RelitSettings.model_fields.items() if _model(field.annotation)]
    named = re.findall(rf"`((?:{'|'.join(sections)})\.[a-z_]+(?:\.[a-z_]+)*)", page.read_text())
    assert [name for name in named if not _is_setting(name) and not _exists(name)] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_old_words_do_not_come_back(page: Path) -> None:
    if page.name == "CHANGELOG.md":
        pytest.skip("it tells what things were called")
    assert [match[0] for match in OLD_WORDS.finditer(page.read_text())] == []


def test_links_to_headings_lead_to_headings() -> None:
    dead = []
    for page in PAGES:
        for target, anchor in re.findall(r"\]\(([^)#\s]*)#([^)\s]+)\)", page.read_text()):
            if "://" in target:
                continue
            headings = re.findall(r"^#+ (.*)$", (page.parent / target if target else page).read_text(), re.MULTILINE)
            if anchor not in {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}:
                dead.append(f"{page.name}: {target}#{anchor}")
    assert dead == []


def _is_file(name: str) -> bool:
    return name.rpartition(".")[2] in (
        "py",
        "md",
        "onnx",
        "lp",
        "hdr",
        "yaml",
        "json",
        "mp4",
        "mkv",
        "relit",
        "html",
        "R",
    )


def _names_code(path: str) -> bool:
    return path.endswith(".py") or path.split("/")[0] in {name for layer in layers() for name in layer}


def _found(path: str, folders: tuple[Path, ...]) -> bool:
    return any((folder / path).exists() for folder in folders)


def _exists(dotted: str) -> bool:
    """Whether a dotted name below relit_camera is a module or something in one; what a class gives itself counts."""
    try:
        pkgutil.resolve_name(f"relit_camera.{dotted}")
    except (AttributeError, ImportError):
        owner, _, name = dotted.rpartition(".")
        try:
            holder = pkgutil.resolve_name(f"relit_camera.{owner}")
        except (AttributeError, ImportError):
            return False
        return inspect.isclass(holder) and f"self.{name} = " in inspect.getsource(holder)
    return True


def _command(words: list[str]) -> tuple[TyperCommand | TyperGroup, list[str]]:
    """The command that these words call, and its names."""
    command: Any = typer.main.get_command(app)
    names: list[str] = []
    for word in words:
        if not isinstance(command, TyperGroup):
            break
        if not word.startswith("-") and (inner := command.get_command(None, word)) is not None:  # type: ignore[arg-type]
            command = inner
            names.append(word)
    return command, names


def _options(words: list[str]) -> list[str]:
    return [word.split("=")[0] for word in words if re.fullmatch(r"--[a-z][a-z-]*(=.*)?", word)]


def _option_names(command: TyperCommand | TyperGroup) -> set[str]:
    own = {name for parameter in command.params for name in (*parameter.opts, *parameter.secondary_opts)}
    return {*own, "--help", "--config", "--log-level", "--version"}


def _model(annotation: object) -> type[BaseModel] | None:
    return annotation if isinstance(annotation, type) and issubclass(annotation, BaseModel) else None


def _is_setting(dotted: str) -> bool:
    model: type[BaseModel] | None = RelitSettings
    for name in dotted.split("."):
        if model is None or name not in model.model_fields:
            return False
        model = _model(model.model_fields[name].annotation)
    return True
