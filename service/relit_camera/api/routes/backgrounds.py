"""What is seen behind the person, and the pictures stored for it."""

from __future__ import annotations

from http import HTTPStatus
from typing import Annotated

from fastapi import APIRouter, Body, Form, Request, UploadFile
from starlette.responses import Response

from relit_camera.api.context import ApiContext, Context
from relit_camera.api.pictures import JPEG_RESPONSE, jpeg_answer, thumbnail, thumbnail_path
from relit_camera.api.problems import ConflictError, responses
from relit_camera.api.schemas import BackgroundPicture
from relit_camera.api.uploads import read_upload
from relit_camera.config.look import Background, ImageBackground, Name

router = APIRouter(tags=["background"])


@router.get("/background")
def get_background(api: Context) -> Background:
    """The background as it now stands."""
    return api.camera.director.scene.look.background


@router.put("/background", responses=responses(404, 422))
def set_background(api: Context, background: Annotated[Background, Body()]) -> Background:
    """Replace the background. Fields left out take the defaults of its kind."""
    scene = api.camera.director.update_look(lambda look: look.model_copy(update={"background": background}))
    return scene.look.background


@router.get("/backgrounds")
def list_backgrounds(api: Context) -> list[BackgroundPicture]:
    """The stored background pictures."""
    return [_item(api, name) for name in api.camera.director.backgrounds.names()]


@router.post("/backgrounds", status_code=HTTPStatus.CREATED, responses=responses(409, 413, 422, 503, 507))
def add_background(api: Context, name: Annotated[Name, Form()], file: UploadFile) -> BackgroundPicture:
    """Store a picture (.jpg, .png, .webp …) to be used as background."""
    director, data = api.camera.director, read_upload(file)
    with api.slow_work():  # the check too: of two at a time with one name, one must hear of the other
        if name in director.background_names():
            raise ConflictError(f"a background or environment '{name}' is stored already", "choose another name")
        director.backgrounds.add(name, data)
    api.changed("backgrounds")
    return _item(api, name)


@router.delete("/backgrounds/{name}", status_code=HTTPStatus.NO_CONTENT, responses=responses(404, 409, 422))
def delete_background(api: Context, name: Name) -> None:
    """Delete a stored background picture that is not in use."""
    if _is_current(api, name):
        raise ConflictError(f"background '{name}' is in use", "choose another background first")
    api.camera.director.backgrounds.remove(name)
    api.changed("backgrounds")


@router.get(
    "/backgrounds/{name}/thumbnail.jpg",
    response_class=Response,
    responses=JPEG_RESPONSE | responses(404, 422, 503),
)
def get_background_thumbnail(api: Context, request: Request, name: Name) -> Response:
    """A small picture of a stored background."""
    with api.slow_work():
        jpeg = thumbnail(api.camera.director.backgrounds.load(name))
    return jpeg_answer(request, jpeg)


def _item(api: ApiContext, name: str) -> BackgroundPicture:
    path = thumbnail_path("backgrounds", name)
    return BackgroundPicture(name=name, is_current=_is_current(api, name), thumbnail=path)


def _is_current(api: ApiContext, name: str) -> bool:
    background = api.camera.director.scene.look.background
    return isinstance(background, ImageBackground) and background.image == name
