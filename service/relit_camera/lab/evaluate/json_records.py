"""Reading of JSON files into checked records."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from relit_camera.base.errors import InputError

Form = TypeVar("Form", bound="Record")


class Record(BaseModel):
    """Base of records read from JSON objects: numbers must be finite, unknown keys are ignored."""

    model_config = ConfigDict(allow_inf_nan=False)


def read_json_record(path: Path, form: type[Form], cure: str, error_type: type[InputError] = InputError) -> Form:
    """Read a file in this form; `cure` says what to give instead.

    Raises:
        InputError: of `error_type`; missing, no JSON, or in another form; the message says where.
    """
    try:
        return form.model_validate(json.loads(path.read_bytes()))
    except OSError as error:
        raise error_type(f"cannot read {path}: {error.strerror or error}", "check the path") from error
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"])) or "top level"
        raise error_type(f"{path}: {place}: {first['msg']}", cure) from error
    except (ValueError, RecursionError) as error:
        raise error_type(f"{path} is no JSON: {error}", cure) from error
