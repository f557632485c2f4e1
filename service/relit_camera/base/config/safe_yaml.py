"""YAML that others may have written: settings and presets."""

from __future__ import annotations

from typing import Any

import yaml

MAX_YAML_BYTES = 1 << 20
"""Of a file. What it holds takes some fifty times that in memory."""
MAX_YAML_DEPTH = 32


def parse_yaml(text: str) -> Any:
    """What a text of up to `MAX_YAML_BYTES` says: mappings, sequences, strings, numbers, booleans, dates, None.

    Nothing in it can run, and it cannot be larger than it looks: aliases, by which a few lines stand for billions
    ("billion laughs"), are refused.

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
    except ValueError as error:  # of ours, or of a date or number that is none
        raise ValueError(str(error) if str(error).startswith(" line") else f": {error}") from error


def _line(mark: Any) -> str:
    return f" line {mark.line + 1}" if mark else ""
