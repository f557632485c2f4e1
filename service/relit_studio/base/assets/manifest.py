"""The list of raw meshes and pictures: what each file is, where it comes from, and under what license."""

from __future__ import annotations

from functools import lru_cache
from importlib.resources import files
from typing import Annotated

import yaml
from pydantic import BaseModel, ConfigDict, Field


class AssetFile(BaseModel):
    """One file.

    Attributes:
        name: relative to the assets' folder, and to a mirror.
        sha256: of the file as it is used.
        licence: SPDX identifier.
        credit: key of the credit line.
        source: page a person can read of it.
        urls: that give the file itself; empty where none does.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str
    sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
    licence: str
    credit: str
    source: str
    urls: tuple[str, ...]


class Manifest(BaseModel):
    """All files, and the lines that credit their makers."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    credits: dict[str, str]
    files: tuple[AssetFile, ...]


@lru_cache(maxsize=1)
def manifest() -> Manifest:
    """Read the packaged list."""
    text = files("relit_studio.base.assets").joinpath("manifest.yaml").read_text(encoding="utf-8")
    return Manifest.model_validate(yaml.safe_load(text))
