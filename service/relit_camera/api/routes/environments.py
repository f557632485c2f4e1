"""Stored light from all sides."""

from __future__ import annotations

from http import HTTPStatus
from pathlib import PurePath
from typing import Annotated

from fastapi import APIRouter, Form, Request, UploadFile
from starlette.responses import Response

from relit_camera.api.context import ApiContext, Context
from relit_camera.api.pictures import JPEG_RESPONSE, jpeg_answer, thumbnail_path
from relit_camera.api.problems import ConflictError, responses
from relit_camera.api.schemas import EnvironmentDetails, EnvironmentItem
from relit_camera.api.uploads import read_upload
from relit_camera.config.look import ImageBackground, Name
from relit_camera.light.builtin.catalogue import BUILTIN_NAMES
from relit_camera.light.store import RESERVED_NAMES
from relit_camera.light.tone import thumbnail_image
from relit_camera.space.picture_files import encode_display

router = APIRouter(prefix="/environments", tags=["environments"])


@router.get("")
def list_environments(api: Context) -> list[EnvironmentItem]:
    """The built-in and the stored environments, and one from a file named on the command line."""
    director = api.camera.director
    return [
        _item(api, name) for name in dict.fromkeys([*director.environments.names(), *director.guest_environments()])
    ]


@router.post("", status_code=HTTPStatus.CREATED, responses=responses(409, 413, 422, 503, 507))
def add_environment(api: Context, name: Annotated[Name, Form()], file: UploadFile) -> EnvironmentDetails:
    """Store a 360° panorama (.hdr, .exr, .png or .jpg, twice as wide as high), as seen from inside."""
    director, data = api.camera.director, read_upload(file)
    with api.slow_work():  # the check too: of two at a time with one name, one must hear of the other
        if name in RESERVED_NAMES or name in {*director.background_names(), *director.guest_environments()}:
            raise ConflictError(f"an environment or background '{name}' exists already", "choose another name")
        director.environments.add_upload(name, data, PurePath(file.filename or "").suffix)
    api.changed("environments")
    return _details(api, name)


@router.get("/{name}", responses=responses(404, 422, 503))
def get_environment(api: Context, name: Name) -> EnvironmentDetails:
    """One environment and what is to be known of it."""
    return _details(api, name)


@router.delete("/{name}", status_code=HTTPStatus.NO_CONTENT, responses=responses(404, 409, 422))
def delete_environment(api: Context, name: Name) -> None:
    """Delete a stored environment that is neither built in nor in use."""
    if name in BUILTIN_NAMES:
        raise ConflictError(f"environment '{name}' is built in", "only environments of your own can be deleted")
    if _is_current(api, name):
        raise ConflictError(f"environment '{name}' is in use", "choose another environment first")
    api.camera.director.environments.remove(name)
    api.changed("environments")


@router.get("/{name}/thumbnail.jpg", response_class=Response, responses=JPEG_RESPONSE | responses(404, 422, 503))
def get_environment_thumbnail(api: Context, request: Request, name: Name) -> Response:
    """A small picture of an environment as seen from inside, in an exposure that suits it."""
    with api.slow_work():
        director = api.camera.director
        guest = director.guest_environments().get(name)
        jpeg = encode_display(thumbnail_image(guest.panorama)) if guest else director.environments.thumbnail(name)
    return jpeg_answer(request, jpeg)


def _item(api: ApiContext, name: str) -> EnvironmentItem:
    return EnvironmentItem(
        name=name,
        builtin=name in BUILTIN_NAMES,
        temporary=name in api.camera.director.guest_environments(),
        is_current=_is_current(api, name),
        thumbnail=thumbnail_path("environments", name),
    )


def _details(api: ApiContext, name: str) -> EnvironmentDetails:
    with api.slow_work():
        director = api.camera.director
        environment = director.guest_environments().get(name) or director.environments.load(name)
    height, width = environment.panorama.radiance.shape[:2]
    return EnvironmentDetails(
        **dict(_item(api, name)),
        width=width,
        height=height,
        clipped_fraction=environment.panorama.clipped_fraction,
        notes=list(environment.notes),
    )


def _is_current(api: ApiContext, name: str) -> bool:
    look = api.camera.director.scene.look
    in_background = isinstance(look.background, ImageBackground) and look.background.image == name
    return in_background or look.lighting.environment == name
