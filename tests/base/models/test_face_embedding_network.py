"""The face embedding's network, made of random weights of few channels, against the same layers in NumPy."""

from __future__ import annotations

import hashlib
import io
import json
import tarfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from relit_camera.base.errors import ModelError
from relit_camera.base.models.face_embedding_network import (
    GROUPS,
    MEAN_RGB,
    SIDE_PX,
    Weights,
    convert_face_embedding,
    unpack_weights,
)
from relit_camera.base.models.model_manifest import Manifest
from relit_camera.base.models.model_store import ModelStore
from relit_camera.base.models.session_with_fallback import open_session

CHANNELS = (2, 3, 4, 5, 5)
"""After each group of blocks."""
EMBEDDING = 7
Float = NDArray[np.float32]


def packed_network(seed: int = 0) -> tuple[bytes, bytes]:
    """Listing and values of the network with `CHANNELS`: the scales as float32, all else quantized."""
    rng = np.random.default_rng(seed)
    shapes = dict(convolution("conv32_down", 7, 3, CHANNELS[0]))
    given = CHANNELS[0]
    for group, made in zip(GROUPS, CHANNELS, strict=True):
        for name in group:
            shapes |= convolution(f"{name}/conv1", 3, given, made) | convolution(f"{name}/conv2", 3, made, made)
            given = made
    shapes["fc"] = (given, EMBEDDING)
    entries, packed = [], b""
    for name, shape in shapes.items():
        entry: dict[str, Any] = {"name": name, "shape": shape, "dtype": "float32"}
        if name.endswith("scale/weights"):
            packed += rng.uniform(0.5, 1.5, shape).astype("<f4").tobytes()
        else:
            entry["quantization"] = {"dtype": "uint8", "scale": 0.004, "min": -0.5}
            packed += rng.integers(0, 256, shape, np.uint8).tobytes()
        entries.append(entry)
    return json.dumps([{"paths": ["weights.bin"], "weights": entries}]).encode(), packed


def convolution(name: str, kernel: int, given: int, made: int) -> dict[str, tuple[int, ...]]:
    vectors = ("conv/bias", "scale/weights", "scale/biases")
    return {f"{name}/conv/filters": (kernel, kernel, given, made), **{f"{name}/{each}": (made,) for each in vectors}}


def relu(value: Float) -> Float:
    return np.maximum(value, 0)


def windows(value: Float, side: int, stride: int) -> Float:
    """(height, width, channels, side, side)."""
    return sliding_window_view(value, (side, side), (0, 1))[::stride, ::stride]


def convolved(value: Float, weights: Weights, name: str, stride: int = 1, pad: int = 1) -> Float:
    filters = weights[f"{name}/conv/filters"]
    padded = np.pad(value, ((pad, pad), (pad, pad), (0, 0)))
    plain = np.einsum("hwcij,ijcm->hwm", windows(padded, len(filters), stride), filters)
    scaled = (plain + weights[f"{name}/conv/bias"]) * weights[f"{name}/scale/weights"]
    return scaled + weights[f"{name}/scale/biases"]


def halving(value: Float, weights: Weights, name: str) -> Float:
    kept = windows(value, 2, 2).mean(axis=(3, 4))
    inner = relu(convolved(value, weights, f"{name}/conv1", stride=2, pad=0))
    residual = convolved(inner, weights, f"{name}/conv2")
    whole = np.zeros((*kept.shape[:2], residual.shape[2]), np.float32)
    whole[: residual.shape[0], : residual.shape[1]] = residual
    whole[..., : kept.shape[2]] += kept
    return relu(whole)


def embedding_of(image: Float, weights: Weights) -> Float:
    """What the network makes of a picture (150, 150, 3) of 0..1."""
    centered = image - np.float32(np.array(MEAN_RGB) / 255)
    value = relu(convolved(centered, weights, "conv32_down", stride=2, pad=0))
    value = windows(value, 3, 2).max(axis=(3, 4))
    for name in (name for group in GROUPS for name in group):
        if "down" in name:
            value = halving(value, weights, name)
        else:
            inner = relu(convolved(value, weights, f"{name}/conv1"))
            value = relu(value + convolved(inner, weights, f"{name}/conv2"))
    return value.mean(axis=(0, 1)) @ weights["fc"]


def test_the_network_is_that_of_its_authors() -> None:
    listing, packed = packed_network()
    image = np.random.default_rng(1).random((SIDE_PX, SIDE_PX, 3), np.float32)
    session = open_session(convert_face_embedding(listing, packed), "tiny")
    found = session.run({"image": image[None]})["embedding"]
    expected = embedding_of(image, unpack_weights(listing, packed))
    assert found.shape == (1, EMBEDDING)
    np.testing.assert_allclose(found[0], expected, rtol=1e-4)


def test_the_same_bytes_give_the_same_model() -> None:
    assert convert_face_embedding(*packed_network()) == convert_face_embedding(*packed_network())


def test_quantized_and_plain_weights() -> None:
    listing = [
        {"weights": [{"name": "q", "shape": [2, 1], "dtype": "float32",
                      "quantization": {"dtype": "uint8", "scale": 0.5, "min": -1.0}}]},
        {"weights": [{"name": "plain", "shape": [2], "dtype": "float32"}]},
    ]  # fmt: skip
    weights = unpack_weights(json.dumps(listing).encode(), bytes([0, 255]) + np.array([3, -4], "<f4").tobytes())
    assert weights["q"].tolist() == [[-1.0], [126.5]]
    assert weights["plain"].tolist() == [3.0, -4.0]
    assert {values.dtype for values in weights.values()} == {np.dtype(np.float32)}


@pytest.mark.parametrize("damage", [lambda data: data[:-1], lambda data: data + b"x", lambda _: b""])
def test_weights_that_are_not_as_listed(damage: Callable[[bytes], bytes]) -> None:
    listing, packed = packed_network()
    with pytest.raises(ModelError, match="bytes of weights are not as many as listed"):
        unpack_weights(listing, damage(packed))


def test_weights_of_a_type_that_is_not_known() -> None:
    listing = json.dumps([{"weights": [{"name": "w", "shape": [1], "dtype": "int32"}]}]).encode()
    with pytest.raises(ModelError, match="the weights w are int32"):
        unpack_weights(listing, bytes(4))


def test_a_pull_reads_listing_and_weights_from_the_archive(tmp_path: Path) -> None:
    mirror = tmp_path / "mirror"
    mirror.mkdir()
    listing, packed = packed_network()
    members = {"package/listing.json": listing, "package/weights.bin": packed}
    with tarfile.open(mirror / "package.tgz", "w:gz") as archive:
        for name, data in members.items():
            about = tarfile.TarInfo(name)
            about.size = len(data)
            archive.addfile(about, io.BytesIO(data))
    store = ModelStore(tmp_path / "models", manifest((mirror / "package.tgz").read_bytes(), members))
    store.pull(mirror=mirror)
    assert store.path("face").read_bytes() == convert_face_embedding(listing, packed)
    wrong = manifest((mirror / "package.tgz").read_bytes(), {**members, "package/weights.bin": b"others"})
    with pytest.raises(ModelError, match=r"package/weights.bin in .*package.tgz has the wrong sha256"):
        ModelStore(tmp_path / "others", wrong).pull(mirror=mirror)


def manifest(archive: bytes, members: dict[str, bytes]) -> Manifest:
    """One model, of the listing and the weights in an archive."""
    listing, weights = ({"name": name, "sha256": sha256(data)} for name, data in members.items())
    model = convert_face_embedding(*packed_network())
    about = {"licence": "MIT", "credits": "nobody", "page": "https://example.org", "urls": ["https://example.org"]}
    made = {"sha256": sha256(model), "size": len(model)}
    return Manifest.model_validate(
        {
            "downloads": {"package.tgz": {**about, "sha256": sha256(archive), "size": len(archive)}},
            "models": {
                "face": {"purpose": "test", "download": "package.tgz", "member": listing, "weights": weights, **made}
            },
        }
    )


def sha256(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()
