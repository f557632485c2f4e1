"""Tables of the documentation that are made from the code: `python -m tests.doc_tables` writes them anew.

A page holds each between `<!-- generated: NAME -->` and `<!-- end -->`; `tests/test_docs.py` compares.
"""

from __future__ import annotations

import re
import tomllib
from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path

import grimp

from relit_camera.base.config.look import Mode
from relit_camera.live.publishing.what_is_shown import FacePresence, Rendering, Situation, what_is_shown
from tests import recorded_cost

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
PACKAGE = "relit_camera"
MARKED = re.compile(r"(<!-- generated: ([a-z-]+) -->\n).*?(<!-- end -->)", re.DOTALL)


def _project() -> dict[str, object]:
    loaded: dict[str, object] = tomllib.loads((ROOT / "pyproject.toml").read_text())
    return loaded


def layers(container: str = PACKAGE) -> list[list[str]]:
    """The parts of a package from top to bottom, those of one layer in one list, as import-linter's contracts say."""
    tool = _project()["tool"]
    assert isinstance(tool, dict)
    for contract in tool["importlinter"]["contracts"]:
        if container in contract.get("containers", []) or (container == PACKAGE and "containers" not in contract):
            return [
                [name.strip().removeprefix(f"{PACKAGE}.") for name in line.split("|")] for line in contract["layers"]
            ]
    raise LookupError(f"pyproject.toml has no layers contract for {container}")


def imports_between_parts(container: str = PACKAGE) -> dict[str, list[str]]:
    """For each part of a package, the other parts that its modules import, both from top to bottom."""
    order = [name for layer in layers(container) for name in layer]
    depth = container.count(".") + 1
    graph = grimp.build_graph(PACKAGE)
    found: dict[str, set[str]] = defaultdict(set)
    for module in graph.modules:
        for imported in graph.find_modules_directly_imported_by(module):
            if not all(name.startswith(f"{container}.") for name in (module, imported)):
                continue
            importing_part, imported_part = (name.split(".")[depth] for name in (module, imported))
            if importing_part in order and imported_part in order and importing_part != imported_part:
                found[importing_part].add(imported_part)
    return {name: sorted(found[name], key=order.index) for name in order}


def plug_ins() -> dict[str, list[str]]:
    """For each entry-point group, the names of the built-in implementations."""
    project = _project()["project"]
    assert isinstance(project, dict)
    return {group: list(points) for group, points in project["entry-points"].items()}


def _layers_text() -> str:
    return "".join(f"    {' · '.join(layer)}\n" for layer in layers())


def _imports_text(container: str = PACKAGE) -> str:
    imports = imports_between_parts(container)
    width = max(map(len, imports))
    return "".join(f"    {name:{width}} → {' '.join(used) or '(none)'}\n" for name, used in imports.items())


def _plug_ins_text() -> str:
    rows = "".join(
        f"| `{group}` | {', '.join(f'`{name}`' for name in names)} |\n" for group, names in plug_ins().items()
    )
    return f"| group | built in |\n|---|---|\n{rows}"


PICTURES = {
    Rendering.WORKS: "come",
    Rendering.FAILS: "fail, for less than 10 s",
    Rendering.HAS_FAILED: "have failed for longer",
}
FACES = {
    FacePresence.FOLLOWED: "followed",
    FacePresence.LOST: "lost, hidden or in profile",
    FacePresence.NOT_YET: "not seen yet",
}


def _shown_text() -> str:
    rows = "| pictures | face | live | portrait | portrait, known to be somebody else |\n|---|---|---|---|---|\n"
    for rendering, face in product(Rendering, FacePresence):
        if rendering is not Rendering.WORKS and face is not FacePresence.FOLLOWED:
            continue
        cells = [PICTURES[rendering], FACES[face] if rendering is Rendering.WORKS else "any"]
        for mode, other_person in ((Mode.LIVE, False), (Mode.PORTRAIT, False), (Mode.PORTRAIT, True)):
            now = Situation(mode, face, rendering=rendering, other_person=other_person)
            kinds = [what_is_shown(replace(now, can_rest=can_rest)) for can_rest in (True, False)]
            cells.append(", else ".join(f"`{kind}`" for kind in dict.fromkeys(kinds)))
        rows += f"| {' | '.join(cells)} |\n"
    return rows


TABLES: Mapping[str, Callable[[], str]] = {
    "layers": _layers_text,
    "imports": _imports_text,
    "imports-live": partial(_imports_text, f"{PACKAGE}.live"),
    "imports-capture": partial(_imports_text, f"{PACKAGE}.capture"),
    "plug-ins": _plug_ins_text,
    "shown": _shown_text,
    **recorded_cost.TABLES,
}


def updated(page: str) -> str:
    """The text of a page with all its generated tables made anew."""
    return MARKED.sub(lambda match: f"{match[1]}\n{TABLES[match[2]]()}\n{match[3]}", page)


def main() -> None:
    """Write the tables of all pages anew."""
    for path in sorted(DOCS.glob("*.md")):
        text = path.read_text()
        path.write_text(updated(text))


if __name__ == "__main__":
    main()
