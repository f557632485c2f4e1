"""How accurate compressed fields are: `python -m tests.compression_accuracy LIGHTS.lp … --maps FOLDER`.

Each `LIGHTS.lp` lists pictures of a person, one light each. Their field is built by the default method and compressed;
printed is a table of PSNR in dB against the field before compression, inside the matte, and of the size: the worst
texel and captured light, the worst of the built-in places, and each panorama (.hdr) of the folder.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.concurrency.threads import limit_threads
from relit_camera.capture.picture_import import import_samples
from relit_camera.capture.reflectance.method_registry import DEFAULT_METHOD, open_method
from relit_camera.light.environments.builtin.builtin_environments import BUILTIN_NAMES
from relit_camera.light.environments.builtin.builtin_light_maps import builtin_light_map
from relit_camera.light.environments.environment_panorama import read_panorama
from relit_camera.light.light_map import LightMap, resample_to_light_map
from relit_camera.subject.compression.accuracy_target import CompressionTarget
from relit_camera.subject.compression.compression_quality import worst_map_db
from relit_camera.subject.compression.field_compression import compress_field
from relit_camera.subject.compression.field_tiles import tiles
from relit_camera.subject.reflectance_field import ReflectanceField

Values = NDArray[np.float32]


def relit_dense(field: ReflectanceField, pixels: NDArray[np.int32], light: Values) -> Values:
    """The field's pictures (maps, some, 3) of ascending row-major pixels under light (maps, 2048, 3)."""
    rows = field.dense(int(pixels[0]), int(pixels[-1]) + 1)[pixels - pixels[0]]
    return np.asarray(np.einsum("plc,mlc->mpc", rows, light, optimize=True), np.float32)


def accuracy(lights: Path, maps: Sequence[LightMap]) -> list[str]:
    """A column of the table."""
    samples = import_samples(lights)
    field = open_method(DEFAULT_METHOD).build(samples)
    target = CompressionTarget(maps=[builtin_light_map(name) for name in BUILTIN_NAMES])
    found = compress_field(field, samples.pictures, samples.matte, target)
    light = CompressionTarget(maps=maps).light
    truth = np.zeros((len(maps), samples.matte.size, 3), np.float32)
    for pixels in (np.unique(tile) for tile in tiles(samples.matte)):
        truth[:, pixels] = relit_dense(field, pixels, light)
    each = [
        worst_map_db(found.basis, found.coefficients, *pair, samples.matte)
        for pair in zip(light[:, None], truth[:, None], strict=True)
    ]
    quality = found.quality
    figures = [quality.texel_db, quality.light_db, quality.map_db, *each]
    return [*(f"{figure:.1f}" for figure in figures), f"{100 * quality.bytes_share:.1f} %"]


def main() -> None:
    """See the module."""
    parser = argparse.ArgumentParser(prog="python -m tests.compression_accuracy", description=__doc__)
    parser.add_argument("lights", type=Path, nargs="+")
    parser.add_argument(
        "--maps", type=Path, required=True, help="folder of panoramas that compression was not tried on"
    )
    options = parser.parse_args()
    limit_threads()
    files = sorted(options.maps.glob("*.hdr"))
    maps = [resample_to_light_map(read_panorama(file).radiance) for file in files]
    columns = [accuracy(lights, maps) for lights in options.lights]
    heads = ["worst texel, alone", "worst captured light", "worst of the built-in surroundings"]
    heads += [*(file.stem for file in files), "bytes, of the dense float32 field"]
    print(f"| dB | {' | '.join(lights.resolve().parent.name for lights in options.lights)} |")
    print(f"|{'---|' * (len(options.lights) + 1)}")
    for head, cells in zip(heads, zip(*columns, strict=True), strict=True):
        print(f"| {head} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
