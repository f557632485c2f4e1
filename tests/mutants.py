"""Mutants: small faults that are put into the program one at a time, to see which of them the tests notice."""

from __future__ import annotations

import ast
import hashlib
import json
import random
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

CHECKS_OF_CODE = {"strict", "frozen", "slots", "daemon"}
"""Arguments which nobody notices unless other code is wrong."""
SWAPS: dict[type[ast.AST], type[ast.AST]] = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In, ast.And: ast.Or, ast.Or: ast.And,
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult,
}  # fmt: skip


@dataclass(frozen=True)
class Mutant:
    """A fault: what is written in the place of an expression or a statement. Columns are in bytes, as in `ast`."""

    file: str
    line: int
    column: int
    end_line: int
    end_column: int
    operator: str
    before: str
    after: str

    @property
    def id(self) -> str:
        """The same as long as this line of the program is."""
        words = (self.file, self.line, self.column, self.operator, self.before, self.after)
        return hashlib.sha256(json.dumps(words).encode()).hexdigest()[:10]

    @property
    def module(self) -> str:
        """The mutated module's dotted name."""
        return ".".join(Path(self.file).with_suffix("").parts[1:]).removesuffix(".__init__")

    def __str__(self) -> str:
        return f"{self.id} {self.file}:{self.line} {self.operator}: {self.before} → {self.after}"


class _Finder(ast.NodeVisitor):
    """Finds every mutant of a module."""

    def __init__(self, file: str) -> None:
        self.found: list[Mutant] = []
        self._file = file
        self._returns_nothing = False

    def _add(self, node: ast.expr | ast.stmt, operator: str, after: str) -> None:
        assert node.end_lineno is not None
        assert node.end_col_offset is not None
        place = (node.lineno, node.col_offset, node.end_lineno, node.end_col_offset)
        self.found.append(Mutant(self._file, *place, operator, ast.unparse(node), after))

    def _visit_each(self, nodes: Iterable[ast.AST | None]) -> None:
        for node in nodes:
            if node is not None:
                self.visit(node)

    def visit_FunctionDef(self, node: ast.FunctionDef | ast.AsyncFunctionDef) -> None:
        if node.name == "__repr__":
            return
        self._visit_each(node.decorator_list)
        for default in (*node.args.defaults, *node.args.kw_defaults):
            self._constant(default, "default") if isinstance(default, ast.Constant) else self._visit_each([default])
        outer, self._returns_nothing = (
            self._returns_nothing,
            node.returns is None or ast.unparse(node.returns) == "None",
        )
        self._visit_each(node.body)
        self._returns_nothing = outer

    visit_AsyncFunctionDef = visit_FunctionDef  # noqa: N815

    def visit_ClassDef(self, node: ast.ClassDef) -> None:
        self._visit_each(node.body)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        self._visit_each([node.value])

    def visit_Assign(self, node: ast.Assign) -> None:
        if ast.unparse(node.targets[0]) != "__all__":
            self.visit(node.value)

    def visit_If(self, node: ast.If) -> None:
        if ast.unparse(node.test) in ("TYPE_CHECKING", "__name__ == '__main__'"):
            return
        if not _is_not(node.test):
            self._add(node.test, "if", f"not ({ast.unparse(node.test)})")
        self.generic_visit(node)

    def visit_Expr(self, node: ast.Expr) -> None:
        if isinstance(node.value, ast.Call) and not _logs(node.value):
            self._add(node, "call", "pass")
        self.generic_visit(node)

    def visit_Return(self, node: ast.Return) -> None:
        if node.value is not None and not self._returns_nothing and ast.unparse(node.value) != "None":
            self._add(node, "return", "return None")
        self.generic_visit(node)

    def visit_Call(self, node: ast.Call) -> None:
        if not _logs(node):
            self.generic_visit(node)

    def visit_keyword(self, node: ast.keyword) -> None:
        if node.arg not in CHECKS_OF_CODE:
            self.visit(node.value)

    def visit_JoinedStr(self, node: ast.JoinedStr) -> None:
        """Skip it: a message, and before Python 3.12 without the places of its parts."""

    def visit_Compare(self, node: ast.Compare) -> None:
        for index, operation in enumerate(node.ops):
            operations = [*node.ops[:index], *_swapped(operation), *node.ops[index + 1 :]]
            self._add(node, "comparison", ast.unparse(ast.Compare(node.left, operations, node.comparators)))
        self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        self._add(node, "boolean", ast.unparse(ast.BoolOp(_swapped(node.op)[0], node.values)))
        self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        if _is_not(node):
            self._add(node, "not", ast.unparse(node.operand))
        self.generic_visit(node)

    def visit_BinOp(self, node: ast.BinOp) -> None:
        if not (_is_text(node.left) or _is_text(node.right)):
            for operation in _swapped(node.op):
                self._add(node, "arithmetic", ast.unparse(ast.BinOp(node.left, operation, node.right)))
        self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        self._constant(node, "constant")

    def _constant(self, node: ast.Constant, operator: str) -> None:
        if isinstance(node.value, bool):
            self._add(node, operator, str(not node.value))
        elif isinstance(node.value, int | float):
            self._add(node, operator, repr(node.value + 1))


def _swapped(operation: ast.AST) -> list[Any]:
    return [SWAPS[type(operation)]()] if type(operation) in SWAPS else []


def _is_not(node: ast.expr) -> bool:
    return isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not)


def _is_text(node: ast.expr) -> bool:
    return isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Constant) and isinstance(node.value, str))


def _logs(call: ast.Call) -> bool:
    return ast.unparse(call.func).startswith(("log.", "logging.", "warnings."))


def mutants_of(text: str, file: str) -> list[Mutant]:
    """All mutants of a module's text."""
    finder = _Finder(file)
    finder.visit(ast.parse(text))
    return finder.found


def mutated(text: str, mutant: Mutant) -> str:
    """A module's text with the fault in it."""
    lines = text.encode().splitlines(keepends=True)
    before = b"".join(lines[: mutant.line - 1]) + lines[mutant.line - 1][: mutant.column]
    after = lines[mutant.end_line - 1][mutant.end_column :] + b"".join(lines[mutant.end_line :])
    is_statement = mutant.operator in ("call", "return")
    return (before + (mutant.after if is_statement else f"({mutant.after})").encode() + after).decode()


def allotted(lines: Mapping[str, int], total: int) -> dict[str, int]:
    """So many of a total for each folder: one, and the rest in proportion to its lines."""
    rest = total - len(lines)
    shares = {folder: rest * number / sum(lines.values()) for folder, number in lines.items()}
    largest = sorted(shares, key=lambda folder: (-(shares[folder] % 1), folder))
    also = set(largest[: rest - sum(map(int, shares.values()))])
    return {folder: 1 + int(share) + (folder in also) for folder, share in shares.items()}


def chosen(root: Path, total: int, seed: int) -> list[Mutant]:
    """The fixed choice of mutants of a checkout's program: of each operator as many, as far as a folder has them."""
    found, lines = defaultdict[str, list[Mutant]](list), Counter[str]()
    for path in sorted((root / "service/relit_camera").rglob("*.py")):
        text, file = path.read_text(encoding="utf-8"), path.relative_to(root).as_posix()
        if mutants := mutants_of(text, file):
            found[str(Path(file).parent)] += mutants
            statements = {node.lineno for node in ast.walk(ast.parse(text)) if isinstance(node, ast.stmt)}
            lines[str(Path(file).parent)] += len(statements)
    choice = []
    for folder, number in allotted(lines, total).items():
        chance, held = random.Random(f"{seed} {folder}"), found[folder]
        for _ in range(min(number, len(held))):
            operator = chance.choice(sorted({mutant.operator for mutant in held}))
            mutant = chance.choice([mutant for mutant in held if mutant.operator == operator])
            held.remove(mutant)
            choice.append(mutant)
    return sorted(choice, key=lambda mutant: (mutant.file, mutant.line, mutant.column, mutant.operator))
