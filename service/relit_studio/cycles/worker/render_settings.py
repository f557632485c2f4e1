"""Camera, light and render settings."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import bpy
from mathutils import Vector

from relit_studio.cycles.worker.axes import to_blender


def set_camera(description: Mapping[str, Any]) -> None:
    """Set a pinhole camera on the room's Z axis that looks along -Z."""
    scene = bpy.context.scene
    camera = bpy.data.cameras.new("camera")
    camera.sensor_fit, camera.sensor_width = "HORIZONTAL", 1.0
    camera.lens = description["focal_px"] / description["width"]
    camera.clip_start, camera.clip_end = 1, 1000
    placed = bpy.data.objects.new("camera", camera)
    placed.location = to_blender(description["position_cm"])
    placed.rotation_euler = (math.pi / 2, 0, 0)
    bpy.context.collection.objects.link(placed)
    scene.camera = placed
    scene.render.resolution_x, scene.render.resolution_y = description["width"], description["height"]
    scene.render.resolution_percentage = 100


def set_quality(quality: Mapping[str, Any]) -> None:
    """Set samples, denoiser, clamp, seed and threads, and the settings that all pictures share."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    cycles = scene.cycles
    cycles.device, cycles.samples, cycles.seed = "CPU", quality["samples"], quality["seed"]
    cycles.use_adaptive_sampling, cycles.pixel_filter_type = False, quality["pixel_filter"]
    cycles.use_denoising, cycles.denoiser = quality["denoise"], "OPENIMAGEDENOISE"
    cycles.denoising_input_passes, cycles.denoising_prefilter = "RGB_ALBEDO_NORMAL", "ACCURATE"
    cycles.max_bounces, cycles.diffuse_bounces, cycles.glossy_bounces = 8, 3, 3
    cycles.transmission_bounces, cycles.transparent_max_bounces = 6, 12
    cycles.sample_clamp_indirect = quality["clamp_indirect"]
    cycles.caustics_reflective = cycles.caustics_refractive = False
    cycles.blur_glossy = 0.5 if quality["clamp_indirect"] else 0.0
    scene.cycles_curves.shape, scene.cycles_curves.subdivisions = "RIBBONS", 2
    scene.render.threads_mode, scene.render.threads = "FIXED", quality["threads"]
    scene.render.film_transparent = scene.render.use_persistent_data = True
    scene.view_settings.view_transform, scene.view_settings.look = "Standard", "None"


def set_light(light: Mapping[str, Any]) -> None:
    """Set a distant lamp, a patch of light or an environment panorama, and switch the others off."""
    kind = light["kind"]
    bpy.context.scene.world = _world(light["picture"], light["strength"]) if kind == "panorama" else None
    if kind == "distant":
        _set_sun(light["direction"], light["irradiance"], light["size_deg"])
    else:
        _set_sun([0.0, 1.0, 0.0], 0.0, 1.0)
    if kind == "patch":
        _set_patch(light["center_cm"], light["size_cm"])
    else:
        _set_patch([0.0, 0.0, 0.0], None)


def _set_sun(direction: Sequence[float], irradiance: float, size_deg: float) -> None:
    lamp = bpy.data.lights.get("sun") or bpy.data.lights.new("sun", "SUN")
    # In Cycles a white wall facing a sun of strength E has radiance E / pi; in our unit its value is E.
    lamp.energy, lamp.angle = math.pi * irradiance, math.radians(size_deg)
    placed = bpy.data.objects.get("sun")
    if placed is None:
        placed = bpy.data.objects.new("sun", lamp)
        placed.rotation_mode = "QUATERNION"
        bpy.context.collection.objects.link(placed)
    placed.rotation_quaternion = Vector(to_blender(direction).tolist()).to_track_quat("Z", "Y")
    placed.hide_render = irradiance == 0


def _set_patch(center_cm: Sequence[float], size_cm: Sequence[float] | None) -> None:
    """The patch of light at a place; None switches it off."""
    lamp = bpy.data.lights.get("patch") or bpy.data.lights.new("patch", "AREA")
    placed = bpy.data.objects.get("patch")
    if placed is None:
        placed = bpy.data.objects.new("patch", lamp)
        placed.rotation_mode = "QUATERNION"
        # Blender's lamps shine along their own -Z.
        placed.rotation_quaternion = Vector(to_blender([0.0, 0.0, 1.0]).tolist()).to_track_quat("Z", "Y")
        bpy.context.collection.objects.link(placed)
    placed.location = to_blender(center_cm)
    placed.hide_render = size_cm is None
    if size_cm is not None:
        lamp.shape, lamp.size, lamp.size_y = "RECTANGLE", *size_cm
        # A Lambertian patch of radiance 1 sends pi through each square centimeter.
        lamp.energy = math.pi * size_cm[0] * size_cm[1]


def _world(picture: str, strength: float) -> Any:
    """Environment of a panorama file, with its middle toward the camera."""
    name = f"{Path(picture).name} {strength:g}"
    if name in bpy.data.worlds:
        return bpy.data.worlds[name]
    world = bpy.data.worlds.new(name)
    world.use_nodes = True
    tree = world.node_tree
    tree.nodes.clear()
    where, turn, texture, background, output = (
        tree.nodes.new(f"ShaderNode{kind}")
        for kind in ("TexCoord", "Mapping", "TexEnvironment", "Background", "OutputWorld")
    )
    texture.image = bpy.data.images.load(picture, check_existing=True)
    # Blender has the middle of the picture at +X.
    turn.inputs["Rotation"].default_value = (0, 0, math.pi / 2)
    background.inputs["Strength"].default_value = math.pi * strength
    tree.links.new(where.outputs["Generated"], turn.inputs["Vector"])
    tree.links.new(turn.outputs["Vector"], texture.inputs["Vector"])
    tree.links.new(texture.outputs["Color"], background.inputs["Color"])
    tree.links.new(background.outputs["Background"], output.inputs["Surface"])
    return world
