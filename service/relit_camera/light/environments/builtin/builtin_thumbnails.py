"""The thumbnails of the built-in environments, files of the package: painting a panorama takes too long to wait for.

`python -m relit_camera.light.environments.builtin.builtin_thumbnails` writes them.
"""

from __future__ import annotations

from pathlib import Path

from relit_camera.base.images.image_files import encode_display
from relit_camera.base.storage.atomic_files import write_atomic
from relit_camera.light.environments.builtin.builtin_environments import BUILTIN_NAMES, builtin_environment
from relit_camera.light.environments.environment_thumbnail import thumbnail_image

FOLDER = Path(__file__).parent / "thumbnails"
JPEG_QUALITY = 88


def builtin_thumbnail(name: str) -> bytes:
    """The JPEG file, 256 x 128 pixels, of a built-in environment as seen from inside."""
    return (FOLDER / f"{name}.jpg").read_bytes()


def drawn_thumbnail(name: str) -> bytes:
    """The same, drawn anew."""
    return encode_display(thumbnail_image(builtin_environment(name).panorama), ".jpg", JPEG_QUALITY)


def main() -> None:
    """Write the files."""
    FOLDER.mkdir(exist_ok=True)
    for name in BUILTIN_NAMES:
        write_atomic(FOLDER / f"{name}.jpg", drawn_thumbnail(name))


if __name__ == "__main__":
    main()
