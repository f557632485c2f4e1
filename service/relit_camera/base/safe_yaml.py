"""Reads YAML from files (settings, presets, the list of models) within limits, for some are untrusted, and writes it.

What a plain value stands for is decided by the core schema of YAML 1.2 (yaml.org/spec/1.2.2, 10.3): null, true and
false, whole numbers, fractions, and else text. There are no dates, no sexagesimal numbers and no tags but !!str.
PyYAML's parser (libyaml's, where it is installed with it) finds the structure; none of its constructors is used.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import yaml

MAX_YAML_BYTES = 1 << 20
"""Largest YAML file."""
MAX_YAML_DEPTH = 32
MAX_YAML_NODES = 10_000
"""Keys, values and lists of a document; settings with every key have some three hundred."""
MAX_NUMBER_LENGTH = 40
"""Characters of a number; those of the longest 64-bit number are half as many."""

_PARSER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_TEXT_TAG = "tag:yaml.org,2002:str"
_NULLS = frozenset({"", "~", "null", "Null", "NULL"})
_BOOLS = {"true": True, "True": True, "TRUE": True, "false": False, "False": False, "FALSE": False}
_INTEGER = re.compile(r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+")
_FRACTION = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_NOT_FINITE = re.compile(r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")


def parse_yaml(text: str) -> Any:
    """Parse a text of up to `MAX_YAML_BYTES`: mappings with texts as keys, sequences, texts, numbers, booleans, None.

    Tags (but !!str) and aliases are refused; by aliases a few lines can stand for billions of values ("billion
    laughs").

    Raises:
        ValueError: it is not YAML, has tags, aliases, a key twice or another document, is nested too deeply, or has too
            many values or too long a number. The message begins with the line, if one is known: ` line 3: …`, else
            `: …`.
    """
    try:
        return _Document(yaml.parse(text, _PARSER)).value()
    except yaml.YAMLError as error:
        reason = getattr(error, "problem", None) or str(error)
        if "nesting depth" in reason:  # newer versions of libyaml have a limit too, which lies further ahead of us
            reason = f"nested more than {MAX_YAML_DEPTH} deep"
        mark = getattr(error, "problem_mark", None)
        # The end of a text lies in a line of its own, which nobody sees.
        last = max(len(text.splitlines()), 1)
        line = f" line {min(mark.line + 1, last)}" if mark else ""
        raise ValueError(f"{line}: {' '.join(reason.split())}") from error


def yaml_text(value: Any) -> str:
    """The YAML text of mappings, lists, texts, numbers, booleans and None, which `parse_yaml` reads back the same."""
    return yaml.dump(value, Dumper=_Dumper, sort_keys=False, allow_unicode=True)


class _Dumper(yaml.SafeDumper):
    """Puts quotes around texts that either version of YAML would take for something else."""


for _tag, _pattern in (("int", _INTEGER), ("float", _FRACTION), ("float", _NOT_FINITE)):
    _Dumper.add_implicit_resolver(
        f"tag:yaml.org,2002:{_tag}", re.compile(f"(?:{_pattern.pattern})$"), list("-+.0123456789")
    )


class _Document:
    """Makes the values of the one document of a stream of parser events."""

    def __init__(self, events: Iterator[Any]) -> None:
        self._events, self._nodes = events, 0

    def value(self) -> Any:
        value = None
        for event in self._events:
            if isinstance(event, yaml.DocumentStartEvent):
                value = self._node(next(self._events), 0)
                break
        next(self._events, None)  # the document's end
        following = next(self._events, None)
        if isinstance(following, yaml.DocumentStartEvent):
            raise _error(following, "but found another document")
        return value

    def _node(self, event: Any, depth: int) -> Any:
        self._nodes += 1
        if isinstance(event, yaml.AliasEvent):
            raise _error(event, f"aliases (*{str(event.anchor)[:40]}) are not taken")
        if self._nodes > MAX_YAML_NODES:
            raise _error(event, f"more than {MAX_YAML_NODES} values")
        if event.tag is not None and not (event.tag == _TEXT_TAG and isinstance(event, yaml.ScalarEvent)):
            raise _error(event, f"tags ({event.tag[:40]}) are not taken")
        if isinstance(event, yaml.ScalarEvent):
            return _scalar(event) if event.implicit[0] and event.tag is None else event.value
        if depth == MAX_YAML_DEPTH:
            raise _error(event, f"nested more than {MAX_YAML_DEPTH} deep")
        if isinstance(event, yaml.SequenceStartEvent):
            return [self._node(item, depth + 1) for item in self._until(yaml.SequenceEndEvent)]
        values: dict[str, Any] = {}
        for key in self._until(yaml.MappingEndEvent):
            if not isinstance(key, yaml.ScalarEvent):
                raise _error(key, "a key is no text")
            self._node(key, depth + 1)
            if key.value in values:
                raise _error(key, f"{key.value[:40]} is given twice")
            values[key.value] = self._node(next(self._events), depth + 1)
        return values

    def _until(self, end: type) -> Iterator[Any]:
        while not isinstance(event := next(self._events), end):
            yield event


def _scalar(event: Any) -> Any:
    """What a value without quotes stands for."""
    text = event.value
    if text in _NULLS:
        return None
    if text in _BOOLS:
        return _BOOLS[text]
    if _INTEGER.fullmatch(text) or _FRACTION.fullmatch(text):
        if len(text) > MAX_NUMBER_LENGTH:
            raise _error(event, f"a number of more than {MAX_NUMBER_LENGTH} characters")
        if text.startswith(("0o", "0x")):
            return int(text, 0)
        return int(text) if _INTEGER.fullmatch(text) else float(text)
    return float(text.replace(".", "")) if _NOT_FINITE.fullmatch(text) else text


def _error(event: Any, reason: str) -> ValueError:
    return ValueError(f"{_line(event.start_mark)}: {reason}")


def _line(mark: Any) -> str:
    return f" line {mark.line + 1}" if mark else ""
