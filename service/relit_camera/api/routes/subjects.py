"""Who is shown: the stored subjects and the chosen one."""

from __future__ import annotations

from http import HTTPStatus

from fastapi import APIRouter, Request
from starlette.responses import Response

from relit_camera.api.context import ApiContext, Context
from relit_camera.api.pictures import JPEG_RESPONSE, jpeg_answer, thumbnail, thumbnail_path
from relit_camera.api.problems import ConflictError, responses
from relit_camera.api.schemas import CurrentSubject, SubjectChoice, SubjectDetails, SubjectItem
from relit_camera.config.look import Name

router = APIRouter(tags=["subjects"])


@router.get("/subject")
def get_subject(api: Context) -> CurrentSubject:
    """Who is shown now."""
    return CurrentSubject(name=api.camera.director.scene.subject_name)


@router.put("/subject", responses=responses(404, 422))
def set_subject(api: Context, choice: SubjectChoice) -> CurrentSubject:
    """Show another stored subject, or nobody."""
    director = api.camera.director
    if choice.name is not None:
        director.subjects.path(choice.name)  # a stored name only: `set_subject` would take a file's path too
    return CurrentSubject(name=director.set_subject(choice.name).subject_name)


@router.get("/subjects")
def list_subjects(api: Context) -> list[SubjectItem]:
    """The stored subjects."""
    return [_item(api, name) for name in api.camera.director.subjects.names()]


@router.get("/subjects/{name}", responses=responses(404, 422, 503))
def get_subject_details(api: Context, name: Name) -> SubjectDetails:
    """One stored subject and what its file says of how it was made."""
    with api.slow_work():
        metadata = api.camera.director.subjects.metadata(name)
    return SubjectDetails(**dict(_item(api, name)), metadata=metadata)


@router.delete("/subjects/{name}", status_code=HTTPStatus.NO_CONTENT, responses=responses(404, 409, 422))
def delete_subject(api: Context, name: Name) -> None:
    """Delete a stored subject that is not shown."""
    if name == api.camera.director.scene.subject_name:
        raise ConflictError(f"subject '{name}' is shown now", "choose another subject first")
    api.camera.director.subjects.remove(name)
    api.changed("subjects")


@router.get(
    "/subjects/{name}/thumbnail.jpg",
    response_class=Response,
    responses=JPEG_RESPONSE | responses(404, 422, 503),
)
def get_subject_thumbnail(api: Context, request: Request, name: Name) -> Response:
    """A small picture of a stored subject's face."""
    with api.slow_work():
        jpeg = thumbnail(api.camera.director.subjects.neutral(name))
    return jpeg_answer(request, jpeg)


def _item(api: ApiContext, name: str) -> SubjectItem:
    is_current = name == api.camera.director.scene.subject_name
    return SubjectItem(name=name, is_current=is_current, thumbnail=thumbnail_path("subjects", name))
