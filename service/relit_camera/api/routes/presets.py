"""Stored looks: lighting, background and mode under a name."""

from __future__ import annotations

from http import HTTPStatus

from fastapi import APIRouter
from starlette.responses import Response

from relit_camera.api.context import Context
from relit_camera.api.problems import responses
from relit_camera.api.schemas import PresetItem
from relit_camera.config.look import Look, Name

router = APIRouter(prefix="/presets", tags=["presets"])


@router.get("")
def list_presets(api: Context) -> list[PresetItem]:
    """The stored presets."""
    return [PresetItem(name=name) for name in api.presets.names()]


@router.get("/{name}", responses=responses(404, 422))
def get_preset(api: Context, name: Name) -> Look:
    """One preset's look."""
    return api.presets.load(name)


@router.put(
    "/{name}",
    responses=responses(422, 507) | {HTTPStatus.CREATED.value: {"model": Look, "description": "A new preset"}},
)
def save_preset(api: Context, response: Response, name: Name, look: Look | None = None) -> Look:
    """Store a look under a name, in place of one of that name. Without a body: the look as it now stands."""
    look = look or api.camera.director.scene.look
    if api.presets.save(name, look):
        response.status_code = HTTPStatus.CREATED
    api.changed("presets")
    return look


@router.delete("/{name}", status_code=HTTPStatus.NO_CONTENT, responses=responses(404, 422))
def delete_preset(api: Context, name: Name) -> None:
    """Delete a preset."""
    api.presets.remove(name)
    api.changed("presets")


@router.post("/{name}/apply", responses=responses(404, 422))
def apply_preset(api: Context, name: Name) -> Look:
    """Show a preset's look. The answer is the look as it now stands."""
    return api.camera.director.set_look(api.presets.load(name)).look
