"""Routes of the stored subjects and of the one that is shown."""

from __future__ import annotations

import filecmp
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from http import HTTPStatus

from fastapi import Request
from starlette.responses import Response

from relit_camera.api.bodies.job_schemas import NameForm, NewName
from relit_camera.api.bodies.schemas import CurrentSubject, SubjectChoice, SubjectDetails, SubjectItem
from relit_camera.api.dependencies import ApiContext, ApiContextDep
from relit_camera.api.jpeg_responses import JPEG_RESPONSE, encode_thumbnail, jpeg_response, thumbnail_url_path
from relit_camera.api.middleware.body_limits import MAX_SUBJECT_BYTES
from relit_camera.api.openapi.api_router import api_router
from relit_camera.api.problem_details import error_responses
from relit_camera.api.streamed_forms import form_description, read_fields, receive_form
from relit_camera.base.config.look import StoredName
from relit_camera.base.errors import ConflictError
from relit_camera.base.storage.upload import Upload
from relit_camera.subject.subject_file import count_stills, read_metadata, read_neutral

router = api_router("subjects")

DEMO_NAME = "demo person"
"""Under which the person who is shipped with the program is stored."""


@router.get("/subject")
def get_subject(api: ApiContextDep) -> CurrentSubject:
    """Who is shown now."""
    return CurrentSubject(name=api.camera.scene_controller.scene.subject_name)


@router.put("/subject", responses=error_responses(404, 422))
def set_subject(api: ApiContextDep, choice: SubjectChoice) -> CurrentSubject:
    """Show another stored subject, or nobody."""
    return CurrentSubject(name=api.camera.scene_controller.choose_stored_subject(choice.name).subject_name)


@router.get("/subjects")
def list_subjects(api: ApiContextDep) -> list[SubjectItem]:
    """The stored subjects, and those of files named on the command line."""
    scene_controller = api.camera.scene_controller
    return [
        _item(api, name)
        for name in dict.fromkeys([*scene_controller.subjects.names(), *scene_controller.subject_files()])
    ]


@router.post("/demo-subject", responses=error_responses(409, 507))
def store_demo_subject(api: ApiContextDep) -> SubjectItem:
    """Store the person who is shipped with the program, under the name `demo person`, unless that is done already."""
    store, bundled = api.camera.scene_controller.subjects, api.camera.demo_subject
    if DEMO_NAME not in store.names():
        with store.replacing(DEMO_NAME, bundled.suffix) as path:
            shutil.copyfile(bundled, path)
        api.publish_collection_changed("subjects")
    elif not filecmp.cmp(store.path(DEMO_NAME), bundled, shallow=False):
        raise ConflictError(f"a subject of yours is called '{DEMO_NAME}'", "rename or delete it")
    return _item(api, DEMO_NAME)


@router.post(
    "/subjects",
    status_code=HTTPStatus.CREATED,
    responses=error_responses(409, 413, 415, 422, 503, 507),
    openapi_extra=form_description(NameForm, "A subject's file, .relit, as `relit capture` writes it."),
)
async def add_subject(api: ApiContextDep, request: Request) -> SubjectItem:
    """Store the subject of a .relit file of up to 1 GiB; `name` comes before `file`."""
    stored: list[str] = []

    @contextmanager
    def open_file(fields: Mapping[str, str], file_name: str) -> Iterator[Upload]:
        name = read_fields(NameForm, fields).name
        with api.camera.scene_controller.subjects.adding(name, file_name) as path:
            yield Upload(path)
        stored.append(name)

    await receive_form(request, open_file, MAX_SUBJECT_BYTES)
    api.publish_collection_changed("subjects")
    return _item(api, stored[0])


@router.patch("/subjects/{name}", responses=error_responses(404, 409, 422))
def rename_subject(api: ApiContextDep, name: StoredName, change: NewName) -> SubjectItem:
    """Give a stored subject another name, also while it is shown."""
    api.camera.scene_controller.rename_stored_subject(name, change.name)
    api.camera.film_capture.subject_renamed(name, change.name)
    api.publish_collection_changed("subjects")
    return _item(api, change.name)


@router.get("/subjects/{name}", responses=error_responses(404, 422, 503))
def get_subject_details(api: ApiContextDep, name: StoredName) -> SubjectDetails:
    """One stored subject and what its file says of how it was made."""
    with api.exclusive_image_work():
        path = api.camera.scene_controller.subject_path(name)
        metadata, stills = read_metadata(path), count_stills(path)
    return SubjectDetails(**dict(_item(api, name)), metadata=metadata, stills=stills)


@router.delete("/subjects/{name}", status_code=HTTPStatus.NO_CONTENT, responses=error_responses(404, 409, 422))
def delete_subject(api: ApiContextDep, name: StoredName) -> None:
    """Delete a stored subject that is not shown, and the pictures of the report of its film."""
    if name == api.camera.scene_controller.scene.subject_name:
        raise ConflictError(f"subject '{name}' is shown now", "choose another subject first")
    api.camera.scene_controller.subjects.remove(name)
    api.camera.film_capture.subject_removed(name)
    api.publish_collection_changed("subjects")


@router.get(
    "/subjects/{name}/thumbnail.jpg",
    response_class=Response,
    responses=JPEG_RESPONSE | error_responses(404, 422, 503),
)
def get_subject_thumbnail(api: ApiContextDep, request: Request, name: StoredName) -> Response:
    """A small picture of a stored subject's face."""
    with api.exclusive_image_work():
        jpeg = encode_thumbnail(read_neutral(api.camera.scene_controller.subject_path(name)))
    return jpeg_response(request, jpeg)


def _item(api: ApiContext, name: str) -> SubjectItem:
    is_current = name == api.camera.scene_controller.scene.subject_name
    temporary = name not in api.camera.scene_controller.subjects.names()
    return SubjectItem(
        name=name, is_current=is_current, temporary=temporary, thumbnail=thumbnail_url_path("subjects", name)
    )
