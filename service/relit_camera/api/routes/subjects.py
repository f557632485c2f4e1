"""Routes of the stored subjects and of the one that is shown."""

from __future__ import annotations

from http import HTTPStatus

from fastapi import APIRouter, Request
from starlette.responses import Response

from relit_camera.api.dependencies import ApiContext, ApiContextDep
from relit_camera.api.jpeg_responses import JPEG_RESPONSE, encode_thumbnail, jpeg_response, thumbnail_url_path
from relit_camera.api.problem_details import error_responses
from relit_camera.api.schemas import CurrentSubject, SubjectChoice, SubjectDetails, SubjectItem
from relit_camera.base.config.look import StoredName
from relit_camera.base.errors import ConflictError

router = APIRouter(tags=["subjects"])


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
    """The stored subjects."""
    return [_item(api, name) for name in api.camera.scene_controller.subjects.names()]


@router.get("/subjects/{name}", responses=error_responses(404, 422, 503))
def get_subject_details(api: ApiContextDep, name: StoredName) -> SubjectDetails:
    """One stored subject and what its file says of how it was made."""
    with api.exclusive_image_work():
        metadata = api.camera.scene_controller.subjects.metadata(name)
    return SubjectDetails(**dict(_item(api, name)), metadata=metadata)


@router.delete("/subjects/{name}", status_code=HTTPStatus.NO_CONTENT, responses=error_responses(404, 409, 422))
def delete_subject(api: ApiContextDep, name: StoredName) -> None:
    """Delete a stored subject that is not shown."""
    if name == api.camera.scene_controller.scene.subject_name:
        raise ConflictError(f"subject '{name}' is shown now", "choose another subject first")
    api.camera.scene_controller.subjects.remove(name)
    api.publish_collection_changed("subjects")


@router.get(
    "/subjects/{name}/thumbnail.jpg",
    response_class=Response,
    responses=JPEG_RESPONSE | error_responses(404, 422, 503),
)
def get_subject_thumbnail(api: ApiContextDep, request: Request, name: StoredName) -> Response:
    """A small picture of a stored subject's face."""
    with api.exclusive_image_work():
        jpeg = encode_thumbnail(api.camera.scene_controller.subjects.neutral(name))
    return jpeg_response(request, jpeg)


def _item(api: ApiContext, name: str) -> SubjectItem:
    is_current = name == api.camera.scene_controller.scene.subject_name
    return SubjectItem(name=name, is_current=is_current, thumbnail=thumbnail_url_path("subjects", name))
