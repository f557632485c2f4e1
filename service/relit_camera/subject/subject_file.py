"""The subject file: one .relit file is a safetensors file, opened memory-mapped. Layout: docs/formats.md."""

from __future__ import annotations

import json
import logging
import shutil
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError
from safetensors import SafetensorError, safe_open

from relit_camera.base.errors import SubjectError
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.base.storage.atomic_files import write_atomic, write_tensors
from relit_camera.subject.compression.local_basis import LocalBasis, global_basis
from relit_camera.subject.compression.webp_packing import decode_basis, encode_basis
from relit_camera.subject.expression_stills import (
    PREFIX as STILL_PREFIX,
)
from relit_camera.subject.expression_stills import (
    STILL_TENSORS,
    ExpressionStill,
    still_tensors,
    stills_of_tensors,
)
from relit_camera.subject.expression_stills import TYPES as STILL_TYPES
from relit_camera.subject.subject import FORMAT_VERSION, Subject, SubjectMetadata

log = logging.getLogger(__name__)

SUFFIX = ".relit"
HEADER_KEY = "relit_subject"
LANDMARKS_PREFIX = "landmarks."
MAX_TENSORS = 64
MAX_HEADER_BYTES = 1 << 20
"""Of the JSON text before the tensors; those of subjects have some kilobytes. safetensors itself takes 100 MB."""
MAX_DIMENSIONS = 4
MAX_BYTES = 8 << 30
"""Largest file that is memory-mapped."""
MAX_COPIED_BYTES = 1 << 30
"""Largest file that is copied first; the largest subject that is built, 1024 pixels a side, has under 700 MB."""
REQUIRED_TENSORS = ("coefficients", "light_directions", "light_coefficients", "matte", "neutral")
OPTIONAL_TENSORS = ("normals", "albedo", "depth", "horizons")
LOCAL_BASIS_PREFIX = "basis."
LOCAL_BASIS_TENSORS = ("pixels", "first", "values", "scales", "mixes")
"""Arrays of the local basis in version 2, each stored under its name after `LOCAL_BASIS_PREFIX`."""
GLOBAL_BASIS, GLOBAL_BASIS_WEBP = "basis", "basis_webp"
"""The basis in version 1: the pictures (3, components, height, width), or one WebP picture of them."""
DTYPES: dict[str, tuple[type[np.generic], ...]] = {
    GLOBAL_BASIS: (np.float16,),
    GLOBAL_BASIS_WEBP: (np.uint8,),
    "neutral": (np.uint8,),
    "normals": (np.float16, np.float32),
    "albedo": (np.float16, np.float32),
    "horizons": (np.uint8,),
    LOCAL_BASIS_PREFIX + "pixels": (np.int32,),
    LOCAL_BASIS_PREFIX + "first": (np.int32,),
    LOCAL_BASIS_PREFIX + "values": (np.int8, np.float16),
    LOCAL_BASIS_PREFIX + "mixes": (np.float16,),
    **STILL_TYPES,
}
"""Allowed types of the tensors; every tensor not named here is float32."""
SAFETENSORS_DTYPES: dict[str, type[np.generic]] = {
    "F16": np.float16,
    "F32": np.float32,
    "U8": np.uint8,
    "I8": np.int8,
    "I32": np.int32,
}
"""Types of a subject's tensors by their safetensors names."""


def write_subject(path: Path, subject: Subject, small: bool = False) -> None:
    """Write a subject whole or not at all.

    Args:
        path: file to write.
        subject: what it holds.
        small: store the principal pictures of `subject.compression.webp_packing.pack_subject` as one picture of 8 bits
            (format version 1). Such a file is decoded when it is opened.

    Raises:
        StorageError: the file cannot be written.
        InputError: `small`, and the pictures are larger than a WebP picture may be.
        ValueError: `small`, and the subject is not packed: its pictures go beyond −1..1.
    """
    meta = subject.metadata.model_copy(update={"format_version": 1 if small else FORMAT_VERSION})
    tensors: dict[str, NDArray] = {name: getattr(subject, name) for name in REQUIRED_TENSORS}
    tensors |= {name: getattr(subject, name) for name in OPTIONAL_TENSORS if getattr(subject, name) is not None}
    tensors |= {LANDMARKS_PREFIX + scheme: points for scheme, points in subject.landmarks.items()}
    tensors |= still_tensors(subject.stills)
    if small:
        tensors[GLOBAL_BASIS_WEBP] = encode_basis(
            subject.pictures(np.eye(meta.components, dtype=np.float32)).transpose(3, 0, 1, 2)
        )
    else:
        tensors |= {LOCAL_BASIS_PREFIX + name: getattr(subject.basis, name) for name in LOCAL_BASIS_TENSORS}
    write_tensors(path, tensors, {HEADER_KEY: meta.model_dump_json()})


def read_subject(path: Path, copied: bool = False) -> Subject:
    """Open a subject; its arrays are read-only views of the mapped file, which the system may drop and read again.

    The basis of a file of version 1 and the pictures of expression stills are not: they are decoded into memory, the
    basis with `copied` into a file without a name.

    Args:
        path: the file.
        copied: map a copy of the file, `MAX_COPIED_BYTES` at most, else `MAX_BYTES`. Long-running programs need that:
            the system kills a process that reads a mapped file which was truncated meanwhile.

    Raises:
        SubjectError: missing, too large, damaged, of another version, or with values that are not finite or, in
            expression stills, impossible.
    """
    with _open_safetensors(path, MAX_COPIED_BYTES if copied else MAX_BYTES) as file:
        metadata = _metadata(path, file.metadata() or {})
        try:
            tensors = _tensor_views(path, list(file.keys()), copied)
        except (KeyError, TypeError, ValueError) as error:  # replaced by another file meanwhile
            raise _damaged_file_error(path, f"it changed while it was read ({error})") from error
    _require_valid_tensors(path, tensors, metadata.format_version)
    landmarks = {n.removeprefix(LANDMARKS_PREFIX): t for n, t in tensors.items() if n.startswith(LANDMARKS_PREFIX)}
    arrays = {name: tensors[name] for name in (*REQUIRED_TENSORS, *OPTIONAL_TENSORS) if name in tensors}
    try:
        stills, basis = stills_of_tensors(tensors), _basis(tensors, metadata)
        if copied and metadata.format_version == 1:
            basis = replace(basis, values=_mapped(basis.values, path.parent))
        return Subject(metadata=metadata, basis=basis, landmarks=landmarks, stills=stills, **arrays)
    except (ValueError, SubjectError) as error:
        raise _damaged_file_error(path, error.what if isinstance(error, SubjectError) else str(error)) from error


def read_metadata(path: Path) -> SubjectMetadata:
    """The header of a subject file. Its tensors are not read.

    Raises:
        SubjectError: missing, too large, no subject, or of another version.
    """
    with _open_safetensors(path, MAX_BYTES) as file:
        return _metadata(path, file.metadata() or {})


def copy_subject(source: Path, target: Path, **noted: object) -> None:
    """Copy a subject file, with other values of these fields in its header; the tensors are copied as they are.

    Raises:
        SubjectError: `source` is no subject.
        StorageError: `target` cannot be written.
    """
    metadata = SubjectMetadata.model_validate(read_metadata(source).model_dump() | noted)
    with source.open("rb") as file:
        layout = json.loads(file.read(int.from_bytes(file.read(8), "little")))
        tensors = file.read()
    layout["__metadata__"] = {HEADER_KEY: metadata.model_dump_json()}
    header = json.dumps(layout, separators=(",", ":")).encode()
    header += b" " * (-len(header) % 8)  # tensors begin at a multiple of 8
    write_atomic(target, len(header).to_bytes(8, "little") + header + tensors)


def write_stills(source: Path, target: Path, stills: Sequence[ExpressionStill]) -> None:
    """Copy a subject file with these expression stills instead of its own; the other tensors are copied as they are.

    Raises:
        SubjectError: `source` is no subject.
        StorageError: `target` cannot be written.
    """
    with _open_safetensors(source, MAX_BYTES) as file:
        metadata = _metadata(source, file.metadata() or {})
        tensors = _tensor_views(source, list(set(file.keys()) - set(STILL_TENSORS)), copied=False)
    write_tensors(target, tensors | still_tensors(stills), {HEADER_KEY: metadata.model_dump_json()})


def count_stills(path: Path) -> int:
    """Number of expression stills in a subject file, by its header alone.

    Raises:
        SubjectError: missing, too large, or no file of tensors.
    """
    landmarks = f"{STILL_PREFIX}landmarks"
    with _open_safetensors(path, MAX_BYTES) as file:
        return int(file.get_slice(landmarks).get_shape()[0]) if landmarks in list(file.keys()) else 0


def read_neutral(path: Path) -> DisplayImage:
    """A copy of the neutral picture, uint8 sRGB RGB (height, width, 3). No other tensor is read.

    Raises:
        SubjectError: missing, too large, no subject, of another version, or without such a picture.
    """
    with _open_safetensors(path, MAX_BYTES) as file:
        metadata = _metadata(path, file.metadata() or {})
        if "neutral" not in list(file.keys()):
            raise _damaged_file_error(path, "it has no tensor 'neutral'")
        stored, shape = file.get_slice("neutral"), [metadata.height, metadata.width, 3]
        if stored.get_dtype() != "U8" or stored.get_shape() != shape:
            raise _damaged_file_error(path, f"'neutral' is {stored.get_dtype()} {stored.get_shape()}, not U8 {shape}")
        neutral: DisplayImage = file.get_tensor("neutral")
        return neutral


@contextmanager
def _open_safetensors(path: Path, most_bytes: int) -> Iterator[Any]:
    """Open a file of tensors with `safe_open`; errors while it is open become SubjectError."""
    if not path.is_file():
        raise SubjectError(f"no subject file at {path}", "build one with 'relit capture import' or check the path")
    if path.stat().st_size > most_bytes:
        raise SubjectError(f"{path} is larger than {most_bytes >> 30} GiB", "build it again at a smaller size")
    try:
        with path.open("rb") as start:
            header_bytes = int.from_bytes(start.read(8), "little")
        if header_bytes > MAX_HEADER_BYTES:  # which would be parsed whole, into twenty times as much memory
            raise _damaged_file_error(path, f"its header states {header_bytes} bytes")
        with safe_open(path, framework="numpy") as file:
            _require_plain_shapes(path, file)
            yield file
    except (SafetensorError, OSError) as error:
        raise _damaged_file_error(path, str(error)) from error


def _require_plain_shapes(path: Path, file: Any) -> None:
    names = list(file.keys())
    if len(names) > MAX_TENSORS:
        raise _damaged_file_error(path, f"it holds {len(names)} tensors")
    for name in names:
        shape = file.get_slice(name).get_shape()
        if not 1 <= len(shape) <= MAX_DIMENSIONS or not all(1 <= side <= MAX_BYTES for side in shape):
            shown = " x ".join(map(str, shape[: 2 * MAX_DIMENSIONS]))
            raise _damaged_file_error(path, f"'{name[:40]}' has {len(shape)} dimensions: {shown}")


def _basis(tensors: Mapping[str, NDArray], metadata: SubjectMetadata) -> LocalBasis:
    if metadata.format_version == FORMAT_VERSION:
        return LocalBasis(**{name: tensors[LOCAL_BASIS_PREFIX + name] for name in LOCAL_BASIS_TENSORS})
    shape = (3, metadata.components, metadata.height, metadata.width)
    pictures = tensors[GLOBAL_BASIS] if GLOBAL_BASIS in tensors else decode_basis(tensors[GLOBAL_BASIS_WEBP], shape)
    if pictures.shape != shape or tensors["matte"].shape != shape[2:]:
        raise ValueError(
            f"{GLOBAL_BASIS} has shape {pictures.shape} with a matte of {tensors['matte'].shape}, not {shape}"
        )
    return global_basis(pictures, tensors["matte"])


def _metadata(path: Path, header: Mapping[str, str]) -> SubjectMetadata:
    try:
        raw = json.loads(header[HEADER_KEY])
        version = raw.get("format_version")
    except (KeyError, ValueError, AttributeError, RecursionError) as error:
        raise _damaged_file_error(path, "it has no Relit Camera header") from error
    if version not in (1, FORMAT_VERSION):
        raise SubjectError(
            f"{path} has format version {version}; this program reads versions 1 and {FORMAT_VERSION}",
            "build the subject again, or use the program that wrote it",
        )
    try:
        return SubjectMetadata.model_validate(raw)
    except ValidationError as error:
        first = error.errors()[0]
        raise _damaged_file_error(path, f"header field {'.'.join(map(str, first['loc']))}: {first['msg']}") from error


def _tensor_views(path: Path, names: list[str], copied: bool) -> dict[str, NDArray]:
    """Views of the tensors of a file that `safe_open` has checked; its own `get_tensor` would copy each.

    Layout (github.com/huggingface/safetensors): the header's length as 8 bytes, the header as JSON, the tensors.
    """
    content = _own_copy(path) if copied else np.asarray(np.memmap(path, np.uint8, mode="r"))
    content.flags.writeable = False
    start = 8 + int.from_bytes(content[:8].tobytes(), "little")
    header = json.loads(content[8:start].tobytes())
    tensors = {}
    for name in names:
        kind, (first, last) = header[name]["dtype"], header[name]["data_offsets"]
        if kind not in SAFETENSORS_DTYPES:
            raise _damaged_file_error(path, f"'{name}' is {kind}, which no tensor of a subject is")
        stored = content[start + first : start + last]
        tensors[name] = stored.view(SAFETENSORS_DTYPES[kind]).reshape(header[name]["shape"])
    return tensors


def _own_copy(path: Path) -> NDArray[np.uint8]:
    """The content of a file, mapped from a copy without a name, which nobody else can change.

    The system can drop its pages, unlike those of memory. The copy is in the file's own folder: a likeness must not get
    to a disk that is protected less. Where none can be written there, the file is read into memory.
    """
    try:
        with path.open("rb") as file, tempfile.TemporaryFile(dir=path.parent) as copy:
            shutil.copyfileobj(file, copy, 1 << 20)
            copy.flush()
            return np.asarray(np.memmap(copy, np.uint8, mode="r"))
    except OSError as error:
        log.info("no copy of %s can be written (%s): it is read into memory", path, error.strerror)
        return np.fromfile(path, np.uint8)


def _mapped(array: NDArray[Any], folder: Path) -> NDArray[Any]:
    """The same numbers in a mapped file of that folder without a name, as `_own_copy` keeps a file's content.

    They are needed while something is opened for the subject, and then no more: 19 MB for a subject of 65 000 pixels.
    """
    try:
        with tempfile.TemporaryFile(dir=folder) as file:
            array.tofile(file)
            file.flush()
            return np.asarray(np.memmap(file, array.dtype, mode="r", shape=array.shape))
    except OSError as error:
        log.info("no file can be written in %s (%s): the subject stays in memory", folder, error.strerror)
        array.flags.writeable = False
        return array


def _require_valid_tensors(path: Path, tensors: Mapping[str, NDArray], version: int) -> None:
    whole = GLOBAL_BASIS if GLOBAL_BASIS in tensors else GLOBAL_BASIS_WEBP
    for name in (
        *REQUIRED_TENSORS,
        *((whole,) if version == 1 else (LOCAL_BASIS_PREFIX + part for part in LOCAL_BASIS_TENSORS)),
    ):
        if name not in tensors:
            raise _damaged_file_error(path, f"it has no tensor '{name}'")
    for name, tensor in tensors.items():
        expected = DTYPES.get(name, (np.float32,))
        if tensor.dtype not in expected:
            raise _damaged_file_error(
                path, f"'{name}' is {tensor.dtype}, not {' or '.join(np.dtype(each).name for each in expected)}"
            )
        if tensor.dtype.kind == "f" and not np.isfinite(tensor).all():
            raise _damaged_file_error(path, f"'{name}' holds NaN or infinity")


def _damaged_file_error(path: Path, reason: str) -> SubjectError:
    return SubjectError(f"{path} is not a usable subject file: {reason}", "restore it from a copy or build it again")
