"""A person whose reflectance field is known, and the subjects that are kept between runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from types import MappingProxyType

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Float32Array
from relit_camera.base.errors import LightsError
from relit_camera.base.images.image_types import LinearImage
from relit_camera.base.storage.atomic_files import make_folder
from relit_camera.capture.reflectance.method_registry import DEFAULT_METHOD
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from relit_camera.capture.subject_builder import build_subject
from relit_camera.light.light_map import LightMap
from relit_camera.subject.relighting.basis_relighter import BasisRelighter
from relit_camera.subject.subject import Subject
from relit_camera.subject.subject_file import SUFFIX, read_subject, write_subject

WHOLLY_THE_PERSON = 0.78
"""Matte from which a pixel counts: those at the rim show the room as well."""
BORDER = 0.03
"""Of a picture's side: that near its border no pixel counts. There the known person ends; a real one goes on."""


@dataclass(frozen=True)
class KnownPerson:
    """A person lit from all around, one light at a time.

    Attributes:
        name: for reports.
        samples: pictures under lights over the whole sphere.
        subject: built of all of them by the default method: the truth.
        screens: by the name of a screen, pictures (patches, height, width, 3) of them under each of its patches, where
            these were rendered.
    """

    name: str
    samples: OlatSamples
    subject: Subject
    screens: Mapping[str, Float32Array] = field(default_factory=dict)

    @cached_property
    def relighter(self) -> BasisRelighter:
        """Of the truth."""
        return BasisRelighter(self.subject)

    @cached_property
    def counted(self) -> NDArray[np.bool_]:
        """Pixels (height, width) that figures are of."""
        return within_border(self.samples.matte > WHOLLY_THE_PERSON)

    def under(self, light_map: LightMap) -> LinearImage:
        """The person under a light map, linear (height, width, 3), over black."""
        return np.asarray(self.relighter.relight(light_map[None])[0], np.float32)


def within_border(counted: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Those of some pixels (height, width) that are not near the picture's border."""
    height, width = counted.shape
    rows, columns = round(BORDER * height), round(BORDER * width)
    inner = np.zeros_like(counted)
    inner[rows : height - rows, columns : width - columns] = True
    return counted & inner


class SubjectFolder:
    """Subjects that take long to build, kept in a folder; they are found again for the same pictures."""

    def __init__(self, folder: Path | None) -> None:
        """`folder` is made when there is something to keep; None keeps nothing."""
        self._folder = folder

    def subject(self, name: str, samples: OlatSamples, method: str = DEFAULT_METHOD) -> Subject:
        """The subject that `method` builds of `samples`; `name` is for the file.

        Raises:
            LightsError: the directions cannot carry a field.
            NotFoundError: no such method.
            StorageError: it cannot be kept.
        """

        def build() -> Subject:
            return build_subject(samples, method, f"{name}{SUFFIX}", with_geometry=False)

        return self._kept(f"{name}-{_digest(method, *_arrays(samples))}", build)

    def made_of(self, person: KnownPerson, how: str, build: Callable[[], Subject]) -> Subject:
        """The subject that `build` makes of a person before a screen of the name `how`."""
        rendered = [person.screens[how]] if how in person.screens else []
        return self._kept(f"{person.name}-{how}-{_digest(how, *_arrays(person.samples), *rendered)}", build)

    def _kept(self, key: str, build: Callable[[], Subject]) -> Subject:
        if self._folder is None:
            return build()
        path = self._folder / f"{key}{SUFFIX}"
        if not path.is_file():
            make_folder(self._folder)
            write_subject(path, build())
        return read_subject(path)


def known_person(
    name: str,
    samples: OlatSamples,
    size: int,
    subjects: SubjectFolder,
    screens: Mapping[str, OlatSamples] = MappingProxyType({}),
) -> KnownPerson:
    """The person of these pictures, and of those before `screens`, the longer side reduced to `size` pixels at most.

    Raises:
        LightsError: the pictures before a screen are of another size.
    """
    small = reduced(samples, size)
    before = {screen: reduced(each, size).pictures for screen, each in screens.items()}
    for screen, pictures in before.items():
        if pictures.shape[1:3] != small.matte.shape:
            raise LightsError(
                f"the pictures of {name} before the {screen} have another size than those under single lights",
                "render both with the same --size",
            )
    return KnownPerson(name, small, subjects.subject(f"{name}-full", small), before)


def reduced(samples: OlatSamples, size: int) -> OlatSamples:
    """The samples with pictures whose longer side has `size` pixels at most, each pixel the mean of those it covers."""
    height, width = samples.matte.shape
    scale = size / max(height, width)
    if scale >= 1:
        return samples
    shape = (max(round(width * scale), 1), max(round(height * scale), 1))
    pictures = np.stack([cv2.resize(each, shape, interpolation=cv2.INTER_AREA) for each in samples.pictures])
    matte = cv2.resize(samples.matte, shape, interpolation=cv2.INTER_AREA)
    return OlatSamples(pictures.astype(np.float32), samples.directions, np.asarray(matte, np.float32))


def _arrays(samples: OlatSamples) -> tuple[NDArray[np.floating], ...]:
    return samples.pictures, samples.directions, samples.matte


def _digest(how: str, *parts: NDArray[np.floating]) -> str:
    """Twelve hexadecimal digits of what a subject depends on; not of the program, which may have changed."""
    content = sha256(how.encode())
    for part in parts:
        content.update(str(part.shape).encode() + np.ascontiguousarray(part).tobytes())
    return content.hexdigest()[:12]
