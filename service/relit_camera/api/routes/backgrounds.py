"""Routes of the background behind the person, and of the pictures stored for it."""

from __future__ import annotations

from http import HTTPStatus
from typing import Annotated

from fastapi import Body, Form, Request, UploadFile
from starlette.responses import Response

from relit_camera.api.bodies.schemas import BackgroundPicture
from relit_camera.api.dependencies import ApiContext, ApiContextDep
from relit_camera.api.jpeg_responses import JPEG_RESPONSE, encode_thumbnail, jpeg_response, thumbnail_url_path
from relit_camera.api.middleware.body_limits import uploaded_file
from relit_camera.api.openapi.api_router import api_router
from relit_camera.api.problem_details import error_responses
from relit_camera.base.config.look import Background, ImageBackground, StoredName
from relit_camera.base.errors import ConflictError

router = api_router("background")


@router.get("/background")
def get_background(api: ApiContextDep) -> Background:
    """The background as it now stands."""
    return api.camera.scene_controller.scene.look.background


@router.put("/background", responses=error_responses(404, 422))
def set_background(api: ApiContextDep, background: Annotated[Background, Body()]) -> Background:
    """Replace the background. Fields left out take the defaults of its kind."""
    scene = api.camera.scene_controller.update_look(lambda look: look.model_copy(update={"background": background}))
    return scene.look.background


@router.get("/backgrounds")
def list_backgrounds(api: ApiContextDep) -> list[BackgroundPicture]:
    """The stored background pictures."""
    return [_item(api, name) for name in api.camera.scene_controller.backgrounds.names()]


@router.post("/backgrounds", status_code=HTTPStatus.CREATED, responses=error_responses(409, 413, 422, 503, 507))
def add_background(api: ApiContextDep, name: Annotated[StoredName, Form()], file: UploadFile) -> BackgroundPicture:
    """Store a picture (.jpg, .png, .webp …) to be used as background."""
    scene_controller, data = api.camera.scene_controller, uploaded_file(file)
    with api.exclusive_image_work():  # with the check: of two uploads of one name at a time, one must fail
        if name in scene_controller.background_names():
            raise ConflictError(f"a background or environment '{name}' is stored already", "choose another name")
        scene_controller.backgrounds.add(name, data)
    api.publish_collection_changed("backgrounds")
    return _item(api, name)


@router.delete("/backgrounds/{name}", status_code=HTTPStatus.NO_CONTENT, responses=error_responses(404, 409, 422))
def delete_background(api: ApiContextDep, name: StoredName) -> None:
    """Delete a stored background picture that is not in use."""
    if _is_current(api, name):
        raise ConflictError(f"background '{name}' is in use", "choose another background first")
    api.camera.scene_controller.backgrounds.remove(name)
    api.publish_collection_changed("backgrounds")


@router.get(
    "/backgrounds/{name}/thumbnail.jpg",
    response_class=Response,
    responses=JPEG_RESPONSE | error_responses(404, 422, 503),
)
def get_background_thumbnail(api: ApiContextDep, request: Request, name: StoredName) -> Response:
    """A small picture of a stored background."""
    with api.exclusive_image_work():
        jpeg = encode_thumbnail(api.camera.scene_controller.backgrounds.load(name))
    return jpeg_response(request, jpeg)


def _item(api: ApiContext, name: str) -> BackgroundPicture:
    path = thumbnail_url_path("backgrounds", name)
    return BackgroundPicture(name=name, is_current=_is_current(api, name), thumbnail=path)


def _is_current(api: ApiContext, name: str) -> bool:
    background = api.camera.scene_controller.scene.look.background
    return isinstance(background, ImageBackground) and background.image == name
