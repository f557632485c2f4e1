"""The tree of errors: every one in its place, and the place named in the module's docstring."""

from __future__ import annotations

import ast
import pickle
import re
from pathlib import Path

import pytest

import relit_camera
from relit_camera.base import errors

PACKAGE = Path(relit_camera.__file__).parent
EXCEPTION_BASE = re.compile(r"(Error|Exception|Warning)$")


def error_classes() -> dict[str, type[BaseException]]:
    return {
        name: value
        for name, value in vars(errors).items()
        if isinstance(value, type) and issubclass(value, BaseException)
    }


def drawn_parents() -> dict[str, str]:
    """Class → base class as the docstring's tree shows them; a class without a base is under the empty name."""
    assert errors.__doc__ is not None
    parents: dict[str, str] = {}
    path: list[str] = []
    for line in errors.__doc__.splitlines():
        found = re.match(r"(?P<branch>[│├└─ ]*)(?P<name>[A-Z]\w*Error)\b", line)
        if found:
            depth = len(found["branch"]) // 4
            path[depth:] = [found["name"]]
            parents[found["name"]] = path[depth - 1] if depth else ""
    return parents


def test_the_docstring_shows_the_tree() -> None:
    parents = drawn_parents()
    assert parents.pop("RelitError") == ""
    assert parents.pop("RuntimeError") == ""
    classes = error_classes()
    assert classes.pop("RelitError").__base__ is Exception
    bases = {name: kind.__base__.__name__ for name, kind in classes.items() if kind.__base__}
    assert parents == bases


@pytest.mark.slow
def test_public_errors_are_defined_in_the_tree_alone() -> None:
    strays = []
    for path in PACKAGE.rglob("*.py"):
        if path == Path(errors.__file__):
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                bases = [ast.unparse(base).rpartition(".")[2] for base in node.bases]
                strays += [f"{path}: {node.name}" for base in bases if EXCEPTION_BASE.search(base)]
    assert strays == []


def test_an_error_says_what_is_wrong_and_the_cure() -> None:
    assert str(errors.ConfigError("it is wrong", "correct it")) == "it is wrong; correct it"
    assert str(errors.ConfigError("it is wrong")) == "it is wrong"


def test_every_error_comes_whole_from_another_process() -> None:
    for kind in error_classes().values():
        if issubclass(kind, errors.RelitError):
            error = kind("what is wrong", "what to do")
            arrived = pickle.loads(pickle.dumps(error))
            assert (type(arrived), arrived.what, arrived.cure) == (kind, "what is wrong", "what to do")
