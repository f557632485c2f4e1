"""Routes of the stored environments: light from all sides."""

from __future__ import annotations

import asyncio
from http import HTTPStatus
from pathlib import PurePath
from typing import Annotated

from fastapi import Form, Request, UploadFile
from starlette.responses import Response

from relit_camera.api.bodies.schemas import EnvironmentDetails, EnvironmentItem
from relit_camera.api.dependencies import ApiContext, ApiContextDep
from relit_camera.api.jpeg_responses import JPEG_RESPONSE, jpeg_response, thumbnail_url_path
from relit_camera.api.middleware.body_limits import uploaded_file
from relit_camera.api.openapi.api_router import api_router
from relit_camera.api.problem_details import error_responses
from relit_camera.base.config.look import ImageBackground, StoredName
from relit_camera.base.errors import ConflictError, NotFoundError
from relit_camera.base.images.image_files import encode_display
from relit_camera.light.environments.builtin.builtin_environments import BUILTIN_NAMES
from relit_camera.light.environments.environment_panorama import Environment
from relit_camera.light.environments.environment_store import RESERVED_NAMES
from relit_camera.light.environments.environment_thumbnail import thumbnail_image

router = api_router("environments", "/environments")


@router.get("")
def list_environments(api: ApiContextDep) -> list[EnvironmentItem]:
    """The built-in and the stored environments, and one from a file named on the command line."""
    scene_controller = api.camera.scene_controller
    return [
        _item(api, name)
        for name in dict.fromkeys([*scene_controller.environments.names(), *scene_controller.temporary_environments()])
    ]


@router.post("", status_code=HTTPStatus.CREATED, responses=error_responses(409, 413, 422, 503, 507))
def add_environment(api: ApiContextDep, name: Annotated[StoredName, Form()], file: UploadFile) -> EnvironmentDetails:
    """Store a 360° panorama (.hdr, .exr, .png or .jpg, twice as wide as high), as seen from inside."""
    scene_controller, data = api.camera.scene_controller, uploaded_file(file)
    with api.exclusive_image_work():  # with the check: of two uploads of one name at a time, one must fail
        if name in RESERVED_NAMES or name in {
            *scene_controller.background_names(),
            *scene_controller.temporary_environments(),
        }:
            raise ConflictError(f"an environment or background '{name}' exists already", "choose another name")
        scene_controller.environments.add_upload(name, data, PurePath(file.filename or "").suffix)
    api.publish_collection_changed("environments")
    return _details(api, name)


@router.get("/{name}", responses=error_responses(404, 422, 503))
def get_environment(api: ApiContextDep, name: StoredName) -> EnvironmentDetails:
    """One environment and what is to be known of it."""
    return _details(api, name)


@router.delete("/{name}", status_code=HTTPStatus.NO_CONTENT, responses=error_responses(404, 409, 422))
def delete_environment(api: ApiContextDep, name: StoredName) -> None:
    """Delete a stored environment that is neither built in nor in use."""
    if name in BUILTIN_NAMES:
        raise ConflictError(f"environment '{name}' is built in", "only environments of your own can be deleted")
    if _is_current(api, name):
        raise ConflictError(f"environment '{name}' is in use", "choose another environment first")
    api.camera.scene_controller.environments.remove(name)
    api.publish_collection_changed("environments")


@router.get("/{name}/thumbnail.jpg", response_class=Response, responses=JPEG_RESPONSE | error_responses(404, 422, 503))
def get_environment_thumbnail(api: ApiContextDep, request: Request, name: StoredName) -> Response:
    """A small picture of an environment as seen from inside, in an exposure that suits it."""
    with api.exclusive_image_work():
        scene_controller = api.camera.scene_controller
        temporary = scene_controller.temporary_environments().get(name)
        if temporary is None:
            jpeg = scene_controller.environments.thumbnail(name)
        else:
            jpeg = encode_display(thumbnail_image(temporary.panorama))
    return jpeg_response(request, jpeg)


@router.get("/{name}/on-me.jpg", response_class=Response, responses=JPEG_RESPONSE | error_responses(404, 422, 503))
async def get_environment_on_subject(api: ApiContextDep, request: Request, name: StoredName) -> Response:
    """A small picture of the person who is shown, lit by an environment and before it; 404 while nobody is."""
    subject = api.camera.scene_controller.scene.subject
    if subject is None:
        raise NotFoundError("nobody is shown", "choose a subject first")

    def load() -> Environment:
        # Not exclusive: that thread has a low priority, and where the cores are busy others would wait for it.
        api.require_running()
        return _environment(api, name)

    return jpeg_response(request, await asyncio.wrap_future(api.subject_in_places.jpeg(subject, name, load)))


def _item(api: ApiContext, name: str) -> EnvironmentItem:
    return EnvironmentItem(
        name=name,
        builtin=name in BUILTIN_NAMES,
        temporary=name in api.camera.scene_controller.temporary_environments(),
        is_current=_is_current(api, name),
        thumbnail=thumbnail_url_path("environments", name),
    )


def _details(api: ApiContext, name: str) -> EnvironmentDetails:
    with api.exclusive_image_work():
        environment = _environment(api, name)
    height, width = environment.panorama.radiance.shape[:2]
    return EnvironmentDetails(
        **dict(_item(api, name)),
        width=width,
        height=height,
        clipped_fraction=environment.panorama.clipped_fraction,
        notes=list(environment.notes),
    )


def _environment(api: ApiContext, name: str) -> Environment:
    scene_controller = api.camera.scene_controller
    return scene_controller.temporary_environments().get(name) or scene_controller.environments.load(name)


def _is_current(api: ApiContext, name: str) -> bool:
    look = api.camera.scene_controller.scene.look
    in_background = isinstance(look.background, ImageBackground) and look.background.image == name
    return in_background or look.lighting.environment == name
