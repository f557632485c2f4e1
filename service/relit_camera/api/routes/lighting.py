"""The light that falls on the face."""

from __future__ import annotations

from fastapi import APIRouter

from relit_camera.api.context import Context
from relit_camera.api.problems import responses
from relit_camera.config.look import Lighting

router = APIRouter(prefix="/lighting", tags=["lighting"])


@router.get("")
def get_lighting(api: Context) -> Lighting:
    """The lighting as it now stands."""
    return api.camera.director.scene.look.lighting


@router.put("", responses=responses(404, 422))
def set_lighting(api: Context, lighting: Lighting) -> Lighting:
    """Replace the lighting. Fields left out take their defaults; the answer is the lighting as it now stands."""
    scene = api.camera.director.update_look(lambda look: look.model_copy(update={"lighting": lighting}))
    return scene.look.lighting


@router.patch("", responses=responses(404, 422))
def change_lighting(api: Context, changes: Lighting) -> Lighting:
    """Change only the fields that are given. `lamps` is replaced as a whole; null is a value, not a removal."""
    given = {name: getattr(changes, name) for name in changes.model_fields_set}
    scene = api.camera.director.update_look(
        lambda look: look.model_copy(update={"lighting": look.lighting.model_copy(update=given)})
    )
    return scene.look.lighting
