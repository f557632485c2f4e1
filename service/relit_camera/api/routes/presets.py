"""Routes of the presets: looks (lighting, background, mode) stored under a name."""

from __future__ import annotations

from http import HTTPStatus

from fastapi import APIRouter
from starlette.responses import Response

from relit_camera.api.dependencies import ApiContextDep
from relit_camera.api.problem_details import error_responses
from relit_camera.api.schemas import PresetItem
from relit_camera.base.config.look import Look, StoredName

router = APIRouter(prefix="/presets", tags=["presets"])


@router.get("")
def list_presets(api: ApiContextDep) -> list[PresetItem]:
    """The stored presets."""
    return [PresetItem(name=name) for name in api.presets.names()]


@router.get("/{name}", responses=error_responses(404, 422))
def get_preset(api: ApiContextDep, name: StoredName) -> Look:
    """One preset's look."""
    return api.presets.load(name)


@router.put(
    "/{name}",
    responses=error_responses(422, 507) | {HTTPStatus.CREATED.value: {"model": Look, "description": "A new preset"}},
)
def save_preset(api: ApiContextDep, response: Response, name: StoredName, look: Look | None = None) -> Look:
    """Store a look under a name, in place of one of that name. Without a body: the look as it now stands."""
    look = look or api.camera.scene_controller.scene.look
    if api.presets.save(name, look):
        response.status_code = HTTPStatus.CREATED
    api.publish_collection_changed("presets")
    return look


@router.delete("/{name}", status_code=HTTPStatus.NO_CONTENT, responses=error_responses(404, 422))
def delete_preset(api: ApiContextDep, name: StoredName) -> None:
    """Delete a preset."""
    api.presets.remove(name)
    api.publish_collection_changed("presets")


@router.post("/{name}/apply", responses=error_responses(404, 422))
def apply_preset(api: ApiContextDep, name: StoredName) -> Look:
    """Show a preset's look. The answer is the look as it now stands."""
    return api.camera.scene_controller.set_look(api.presets.load(name)).look
