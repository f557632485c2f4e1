"""`python -m relit_studio.cycles.worker JOB.json`: builds the scene and writes the pictures that the job lists.

One JSON line on stdout a picture: {"picture": name, "seconds": s}. A picture is written beside its place and renamed.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from relit_studio.cycles.worker.materials import build_material
from relit_studio.cycles.worker.objects import add_mesh, add_strands, reshape
from relit_studio.cycles.worker.render_settings import set_camera, set_light, set_quality


def main(job_file: Path) -> None:
    """Run one job."""
    job = json.loads(job_file.read_text(encoding="utf-8"))
    folder = job_file.parent
    bpy.ops.wm.read_factory_settings(use_empty=True)
    _build(job["scene"], folder)
    set_camera(job["camera"])
    set_quality(job["quality"])
    for picture in job["pictures"]:
        started = time.perf_counter()
        if picture["shape"]:
            with np.load(folder / picture["shape"]) as arrays:
                reshape(arrays)
        set_light(picture["light"])
        _render(Path(picture["path"]), all_passes=picture["all_passes"])
        report = {"picture": picture["path"], "seconds": round(time.perf_counter() - started, 2)}
        print(json.dumps(report), file=sys.stdout, flush=True)


def _build(scene: Mapping[str, Any], folder: Path) -> None:
    materials = {name: build_material(name, kind) for name, kind in scene["materials"].items()}
    with np.load(folder / scene["arrays"]) as file:
        arrays = dict(file)
    for description in scene["objects"]:
        add = add_mesh if description["kind"] == "mesh" else add_strands
        add(description, arrays, materials)


def _render(path: Path, *, all_passes: bool) -> None:
    scene = bpy.context.scene
    layer = scene.view_layers[0]
    layer.use_pass_z = layer.use_pass_normal = all_passes
    layer.cycles.denoising_store_passes = all_passes
    settings = scene.render.image_settings
    settings.file_format = "OPEN_EXR_MULTILAYER" if all_passes else "OPEN_EXR"
    settings.color_mode, settings.color_depth = "RGBA", "32" if all_passes else "16"
    settings.exr_codec = "ZIP"
    temporary = path.with_name(f".{path.stem}.part.exr")
    scene.render.filepath = str(temporary)
    bpy.ops.render.render(write_still=True)
    temporary.replace(path)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
