"""YAML by the core schema of version 1.2: what plain values stand for, what is refused, and what is written."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from relit_camera.base.safe_yaml import MAX_NUMBER_LENGTH, MAX_YAML_DEPTH, MAX_YAML_NODES, parse_yaml, yaml_text


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("~", None),
        ("null", None),
        ("{a: , b: c}", {"a": None, "b": "c"}),
        ("true", True),
        ("False", False),
        ("yes", "yes"),
        ("off", "off"),
        ("12", 12),
        ("-0", 0),
        ("012", 12),
        ("0o17", 15),
        ("0xff", 255),
        ("1_000", "1_000"),
        ("1:30", "1:30"),
        ("2001-01-01", "2001-01-01"),
        ("1.5", 1.5),
        ("-.5e-3", -0.0005),
        ("1e3", 1000.0),
        ("5.", 5.0),
        (".inf", math.inf),
        ("-.Inf", -math.inf),
        ("<<: 1", {"<<": 1}),
        ("'12'", "12"),
        ('"true"', "true"),
        ("a: 1\nb: [x, {c: d}]", {"a": 1, "b": ["x", {"c": "d"}]}),
        ("1: a", {"1": "a"}),
        ("", None),
        ("# nothing", None),
        ("---\na: |\n  x\n  y\n...\n", {"a": "x\ny\n"}),
    ],
)
def test_what_a_text_stands_for(text: str, value: Any) -> None:
    found = parse_yaml(text)
    assert found == value
    assert type(found) is type(value)


def test_nan_is_a_number() -> None:
    assert math.isnan(parse_yaml(".nan"))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a: 1\nb: !!int 2", " line 2: tags"),
        ("a: !!str [2]", " line 1: tags"),
        ("!x {}", " line 1: tags"),
        ("- &a 1\n- *a", " line 2: aliases"),
        ("a: 1\na: 2", " line 2: a is given twice"),
        ("[a]: 1", " line 1: a key is no text"),
        ("a: 1\n---\nb: 2", " line 2: but found another document"),
        ("9" * (MAX_NUMBER_LENGTH + 1), " line 1: a number of more than"),
        ("0x" + "f" * 5000, " line 1: a number of more than"),
        ("[" * (MAX_YAML_DEPTH + 1), f" line 1: nested more than {MAX_YAML_DEPTH} deep"),
        (f"[{'1,' * MAX_YAML_NODES}1]", f" line 1: more than {MAX_YAML_NODES} values"),
        ("{a: 1", " line "),
        ("a: \0", ": "),
    ],
)
def test_what_is_refused(text: str, said: str) -> None:
    with pytest.raises(ValueError, match=r"^ line|^:") as caught:
        parse_yaml(text)
    assert str(caught.value).startswith(said)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "text",
    ["1e3", "0o14", "yes", "1:30", "2001-01-01", "null", "~", "0x1F", ".inf", "<<", "=", "#x", "12"]
    + ["", "x: y", "- a", " a", "é\n\nb"],
)
def test_a_text_that_looks_like_something_else_stays_a_text(text: str) -> None:
    assert parse_yaml(yaml_text({"a": text})) == {"a": text}


WORDS = st.text(st.characters(codec="utf-8", exclude_categories=["Cc", "Cs", "Zl", "Zp"]), max_size=20)
VALUES = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**63), 2**63) | st.floats(allow_nan=False) | WORDS,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(WORDS, inner, max_size=4),
    max_leaves=12,
)


@pytest.mark.slow
@given(st.dictionaries(WORDS, VALUES, max_size=4))
def test_what_is_written_is_read(value: dict[str, Any]) -> None:
    assert parse_yaml(yaml_text(value)) == value


def test_text_may_be_marked_as_that_and_numbers_may_have_an_exponent() -> None:
    assert parse_yaml("a: !!str 2\nb: 1e5\n!!str c: !!str no") == {"a": "2", "b": 1e5, "c": "no"}
