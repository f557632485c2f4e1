"""Routes of the light that falls on the face."""

from __future__ import annotations

from relit_camera.api.dependencies import ApiContextDep
from relit_camera.api.openapi.api_router import api_router
from relit_camera.api.problem_details import error_responses
from relit_camera.base.config.look import Lighting

router = api_router("lighting", "/lighting")


@router.get("")
def get_lighting(api: ApiContextDep) -> Lighting:
    """The lighting as it now stands."""
    return api.camera.scene_controller.scene.look.lighting


@router.put("", responses=error_responses(404, 409, 422))
def set_lighting(api: ApiContextDep, lighting: Lighting) -> Lighting:
    """Replace the lighting. Fields left out take their defaults; the answer is the lighting as it now stands."""
    scene = api.camera.scene_controller.update_look(lambda look: look.model_copy(update={"lighting": lighting}))
    return scene.look.lighting


@router.patch("", responses=error_responses(404, 409, 422))
def change_lighting(api: ApiContextDep, changes: Lighting) -> Lighting:
    """Change only the fields that are given. `lamps` is replaced as a whole; null is a value, not a removal."""
    given = {name: getattr(changes, name) for name in changes.model_fields_set}
    scene = api.camera.scene_controller.update_look(
        lambda look: look.model_copy(update={"lighting": look.lighting.model_copy(update=given)})
    )
    return scene.look.lighting
