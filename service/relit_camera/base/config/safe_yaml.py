"""Parses YAML from untrusted files (settings and presets), within limits."""

from __future__ import annotations

from typing import Any

import yaml

MAX_YAML_BYTES = 1 << 20
"""Largest YAML file. Parsed, it takes some fifty times as much memory."""
MAX_YAML_DEPTH = 32


def parse_yaml(text: str) -> Any:
    """Parse a text of up to `MAX_YAML_BYTES`: mappings, sequences, strings, numbers, booleans, dates, None.

    Tags that create objects or run code are refused, and so are aliases, by which a few lines can stand for billions of
    values ("billion laughs").

    Raises:
        ValueError: it is not YAML, has aliases, or is nested too deeply. The message begins with the line, if one is
            known: ` line 3: …`, else `: …`.
    """
    depth = 0
    try:
        for event in yaml.parse(text, yaml.SafeLoader):
            depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
            if isinstance(event, yaml.AliasEvent):
                raise ValueError(f"{_line(event.start_mark)}: aliases (*{event.anchor}) are not taken")
            if depth > MAX_YAML_DEPTH:
                raise ValueError(f"{_line(event.start_mark)}: nested more than {MAX_YAML_DEPTH} deep")
        return yaml.safe_load(text)
    except yaml.YAMLError as error:
        reason = getattr(error, "problem", None) or str(error)
        raise ValueError(f"{_line(getattr(error, 'problem_mark', None))}: {' '.join(reason.split())}") from error
    except ValueError as error:  # raised above, or by an invalid date or number
        raise ValueError(str(error) if str(error).startswith(" line") else f": {error}") from error


def _line(mark: Any) -> str:
    return f" line {mark.line + 1}" if mark else ""
