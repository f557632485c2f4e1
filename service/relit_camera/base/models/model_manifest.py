"""The list of public models: where they are published, their checksums, and how they are converted."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from importlib import resources
from typing import Annotated

import yaml
from pydantic import BaseModel, ConfigDict, Field, model_validator

Sha256 = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]


class _ManifestEntry(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)


class Download(_ManifestEntry):
    """A file as its authors publish it."""

    urls: Annotated[tuple[str, ...], Field(min_length=1)]
    """Tried in this order."""
    also_named: tuple[str, ...] = ()
    """Names that it has elsewhere."""
    sha256: Sha256
    size: int
    """Bytes."""
    licence: str
    """SPDX identifier."""
    credits: str
    page: str
    """Where a person reads about it."""


class Member(_ManifestEntry):
    """A file in a zip."""

    name: str
    sha256: Sha256


class Conversion(_ManifestEntry):
    """How a TFLite file becomes ONNX: names for its inputs and outputs, in its own order."""

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]


class PublicModel(_ManifestEntry):
    """A model as it is stored: an ONNX file."""

    purpose: str
    download: str
    """The file that it is made from."""
    member: Member | None = None
    """The part of the file, where it is a zip."""
    convert: Conversion | None = None
    """None where the file is ONNX already."""
    sha256: Sha256
    size: int
    """Bytes of the ONNX file."""


class Manifest(_ManifestEntry):
    """All public models by name."""

    downloads: Mapping[str, Download]
    models: Mapping[str, PublicModel]

    @model_validator(mode="after")
    def _downloads_exist(self) -> Manifest:
        unknown = {model.download for model in self.models.values()} - set(self.downloads)
        if unknown:
            raise ValueError(f"no such download: {', '.join(sorted(unknown))}")
        return self

    def download_of(self, name: str) -> Download:
        """Return the file that the model `name` is made from."""
        return self.downloads[self.models[name].download]


@cache
def public_manifest() -> Manifest:
    """Read the manifest that comes with the package."""
    text = resources.files(__package__).joinpath("manifest.yaml").read_text("utf-8")
    return Manifest.model_validate(yaml.safe_load(text))
