"""The subject file: one .relit file is a safetensors file, opened memory-mapped. Layout: docs/formats.md."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save_file

from relit_camera.errors import SubjectError
from relit_camera.files import atomic_path
from relit_camera.subject.pack import decode_basis, encode_basis
from relit_camera.subject.subject import FORMAT_VERSION, Subject, SubjectMetadata

SUFFIX = ".relit"
HEADER_KEY = "relit_subject"
LANDMARKS = "landmarks."
MAX_TENSORS = 64
MAX_BYTES = 8 << 30
REQUIRED = ("basis", "coefficients", "light_directions", "light_coefficients", "matte", "neutral")
OPTIONAL = ("normals", "albedo", "depth")
SMALL_BASIS = "basis_webp"
"""In place of `basis` in a small file: the pictures as bytes of one lossless WebP picture."""
DTYPES = {"basis": np.float16, "neutral": np.uint8}
"""Every other tensor is float32."""
STORED: dict[str, type[np.generic]] = {"F16": np.float16, "F32": np.float32, "U8": np.uint8}
"""What safetensors calls the types that a subject may hold."""


def write_subject(path: Path, subject: Subject, small: bool = False) -> None:
    """Write a subject whole or not at all.

    Args:
        path: file to write.
        subject: what it holds.
        small: keep the basis in 8 bits, a quarter of the size and less. Such a file is decoded when it is opened.

    Raises:
        StorageError: the file cannot be written.
        InputError: `small`, and the basis is larger than a WebP picture may be.
    """
    tensors: dict[str, NDArray] = {name: getattr(subject, name) for name in REQUIRED}
    tensors |= {name: getattr(subject, name) for name in OPTIONAL if getattr(subject, name) is not None}
    tensors |= {LANDMARKS + scheme: points for scheme, points in subject.landmarks.items()}
    if small:
        tensors[SMALL_BASIS] = encode_basis(tensors.pop("basis"))
    contiguous = {name: np.ascontiguousarray(value) for name, value in tensors.items()}
    with atomic_path(path) as temporary:
        try:
            save_file(contiguous, temporary, metadata={HEADER_KEY: subject.metadata.model_dump_json()})
        except SafetensorError as error:
            # The library hides the system's error number in its message.
            if "os error" in str(error).lower() or "I/O" in str(error):
                raise OSError(_errno_in(str(error)), str(error)) from error
            raise


def read_subject(path: Path) -> Subject:
    """Open a subject; its arrays are read-only views of the mapped file, which the system may drop and read again.

    The basis of a small file is not: it is decoded into memory.

    Raises:
        SubjectError: missing, damaged, of another version, or with values that are not finite.
    """
    if not path.is_file():
        raise SubjectError(f"no subject file at {path}", "build one with 'relit capture import' or check the path")
    if path.stat().st_size > MAX_BYTES:
        raise SubjectError(f"{path} is larger than {MAX_BYTES >> 30} GiB", "build it again at a smaller size")
    try:
        with safe_open(path, framework="numpy") as file:
            metadata = _metadata(path, file.metadata() or {})
            names = list(file.keys())
            if len(names) > MAX_TENSORS:
                raise _damaged(path, f"it holds {len(names)} tensors")
        tensors = _mapped(path, names)
    except (SafetensorError, OSError) as error:
        raise _damaged(path, str(error)) from error
    if "basis" not in tensors and SMALL_BASIS in tensors:
        tensors["basis"] = _decoded(path, tensors.pop(SMALL_BASIS), metadata)
    _check(path, tensors)
    landmarks = {n.removeprefix(LANDMARKS): t for n, t in tensors.items() if n.startswith(LANDMARKS)}
    arrays = {name: tensors[name] for name in (*REQUIRED, *OPTIONAL) if name in tensors}
    try:
        return Subject(metadata=metadata, landmarks=landmarks, **arrays)
    except ValueError as error:
        raise _damaged(path, str(error)) from error


def _metadata(path: Path, header: Mapping[str, str]) -> SubjectMetadata:
    try:
        raw = json.loads(header[HEADER_KEY])
        version = raw.get("format_version")
    except (KeyError, ValueError, AttributeError) as error:
        raise _damaged(path, "it has no Relit Camera header") from error
    if version != FORMAT_VERSION:
        raise SubjectError(
            f"{path} has format version {version}; this program reads version {FORMAT_VERSION}",
            "build the subject again, or use the program that wrote it",
        )
    try:
        return SubjectMetadata.model_validate(raw)
    except ValidationError as error:
        first = error.errors()[0]
        raise _damaged(path, f"header field {'.'.join(map(str, first['loc']))}: {first['msg']}") from error


def _mapped(path: Path, names: list[str]) -> dict[str, NDArray]:
    """The tensors of a file that `safe_open` found sound; its own `get_tensor` would copy them into memory.

    Layout (github.com/huggingface/safetensors): the header's length as 8 bytes, the header as JSON, the tensors.
    """
    mapped = np.asarray(np.memmap(path, np.uint8, mode="r"))
    start = 8 + int.from_bytes(mapped[:8].tobytes(), "little")
    header = json.loads(mapped[8:start].tobytes())
    tensors = {}
    for name in names:
        kind, (first, last) = header[name]["dtype"], header[name]["data_offsets"]
        if kind not in STORED:
            raise _damaged(path, f"'{name}' is {kind}, which no tensor of a subject is")
        stored = mapped[start + first : start + last]
        tensors[name] = stored.view(STORED[kind]).reshape(header[name]["shape"])
    return tensors


def _decoded(path: Path, encoded: NDArray, metadata: SubjectMetadata) -> NDArray[np.float16]:
    if encoded.dtype != np.uint8 or encoded.ndim != 1:
        raise _damaged(path, f"'{SMALL_BASIS}' is not a row of bytes")
    try:
        return decode_basis(encoded, (3, metadata.components, metadata.height, metadata.width))
    except SubjectError as error:
        raise _damaged(path, error.what) from error


def _check(path: Path, tensors: Mapping[str, NDArray]) -> None:
    for name in REQUIRED:
        if name not in tensors:
            raise _damaged(path, f"it has no tensor '{name}'")
    for name, tensor in tensors.items():
        expected = DTYPES.get(name, np.float32)
        if tensor.dtype != expected:
            raise _damaged(path, f"'{name}' is {tensor.dtype}, not {np.dtype(expected)}")
        if tensor.dtype.kind == "f" and not np.isfinite(tensor).all():
            raise _damaged(path, f"'{name}' holds NaN or infinity")


def _damaged(path: Path, reason: str) -> SubjectError:
    return SubjectError(f"{path} is not a usable subject file: {reason}", "restore it from a copy or build it again")


def _errno_in(message: str) -> int:
    return next((code for code in (28, 13, 30, 2) if os.strerror(code).lower() in message.lower()), 5)
