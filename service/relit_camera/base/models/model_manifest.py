"""The list of public models: where they are published, their checksums, and how they are converted."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from importlib import resources
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, model_validator

from relit_camera.base.safe_yaml import parse_yaml

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
    """A file in a zip or a tar."""

    name: str
    sha256: Sha256


class Package(_ManifestEntry):
    """A wheel on the package index that holds networks. It is never installed: files are read from it."""

    version: str
    python: Annotated[str, Field(pattern=r"^3\.\d+$")]
    """The Python version of the wheel that is asked for, whatever runs here: its networks are the same in all."""
    platform: str
    """Its platform tag."""
    size: int
    """Bytes of the wheel."""
    licence: str
    """SPDX identifier."""
    credits: str
    page: str
    """Where a person reads about it."""


class PackagedFile(_ManifestEntry):
    """A file in a wheel."""

    package: str
    name: str
    """Its path in the wheel."""
    sha256: Sha256
    size: int
    """Bytes."""


class Conversion(_ManifestEntry):
    """How a TFLite file becomes ONNX: names for its inputs and outputs, in its own order."""

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]


class PublicModel(_ManifestEntry):
    """A model as it is stored: an ONNX file."""

    purpose: str
    download: str | None = None
    """The file of its authors that it is made from; None where they publish it in a package alone."""
    member: Member | None = None
    """The part of the file, where it is an archive."""
    weights: Member | None = None
    """The packed weights that the other part lists, of a network whose layers the program knows (`convert` is None)."""
    packaged: PackagedFile | None = None
    """The same in a package, to the byte once it is converted."""
    substitute: str | None = None
    """A model that does the same, for where this one cannot be had."""
    without: str | None = None
    """What does not work without it, where that is little and it has no stand-in."""
    convert: Conversion | None = None
    """None where the file is no TFLite file."""
    sha256: Sha256
    size: int
    """Bytes of the ONNX file."""


class Manifest(_ManifestEntry):
    """All public models by name."""

    downloads: Mapping[str, Download]
    packages: Mapping[str, Package] = {}
    models: Mapping[str, PublicModel]

    @model_validator(mode="after")
    def _sources_exist(self) -> Manifest:
        for name, model in self.models.items():
            if model.download is None and model.packaged is None:
                raise ValueError(f"{name} has no source")
            if model.download is not None and model.download not in self.downloads:
                raise ValueError(f"no such download: {model.download}")
            if model.packaged is not None and model.packaged.package not in self.packages:
                raise ValueError(f"no such package: {model.packaged.package}")
            if model.substitute is not None and model.substitute not in self.models:
                raise ValueError(f"no such model: {model.substitute}")
        return self

    def licence_of(self, name: str) -> str:
        """Return the SPDX identifier of the model's licence."""
        model = self.models[name]
        if model.download is not None:
            return self.downloads[model.download].licence
        return self.packages[model.packaged.package].licence if model.packaged else ""


@cache
def public_manifest() -> Manifest:
    """Read the manifest that comes with the package."""
    text = resources.files(__package__).joinpath("manifest.yaml").read_text("utf-8")
    return Manifest.model_validate(parse_yaml(text))
