"""Routes of the whole scene: read and changed in one step, undone, done again, reset."""

from __future__ import annotations

import re
from typing import Annotated

from fastapi import Header
from starlette.responses import Response

from relit_camera.api.bodies.schemas import SceneBody, SceneChanges
from relit_camera.api.dependencies import ApiContextDep
from relit_camera.api.openapi.api_router import api_router
from relit_camera.api.problem_details import error_responses
from relit_camera.api.routes.server_sent_events import scene_body
from relit_camera.base.config.look import Look
from relit_camera.live.scene.scene import Scene
from relit_camera.live.scene.scene_controller import ChosenSubject

router = api_router("scene", "/scene")

IfMatch = Annotated[
    str | None,
    Header(description='Change only the scene of this revision, as its `ETag` names it: `"17"`; `*` is any'),
]
LOOK_FIELDS = frozenset({"lighting", "background", "mode"})
_ENTITY_TAG = re.compile(r'(W/)?"([^"]*)"')


@router.get("")
def get_scene(api: ApiContextDep, response: Response) -> SceneBody:
    """Everything that can be changed while the camera runs, as it now stands; `ETag` is its revision."""
    return _answer(api.camera.scene_controller.scene, response)


@router.patch("", responses=error_responses(404, 409, 412, 422))
def change_scene(api: ApiContextDep, response: Response, changes: SceneChanges, if_match: IfMatch = None) -> SceneBody:
    """Change what is given, all of it or nothing, in one step and one revision."""
    given = changes.model_fields_set
    scene = api.camera.scene_controller.change(
        look=(lambda look: _with_changes(look, changes)) if given & LOOK_FIELDS else None,
        subject=ChosenSubject(changes.subject) if "subject" in given else None,
        frozen=changes.frozen if "frozen" in given else None,
        unlit_allowed=changes.unlit_allowed if "unlit_allowed" in given else None,
        avatar_allowed=changes.avatar_allowed if "avatar_allowed" in given else None,
        if_revision=None if if_match is None else matching_revisions(if_match),
    )
    return _answer(scene, response)


@router.post("/undo", responses=error_responses(404, 409))
def undo_change(api: ApiContextDep, response: Response) -> SceneBody:
    """Take the last change back. Changes of the same fields within a second are one. Freezing is not undone."""
    return _answer(api.camera.scene_controller.undo(), response)


@router.post("/redo", responses=error_responses(404, 409))
def redo_change(api: ApiContextDep, response: Response) -> SceneBody:
    """Make the change again that was undone last."""
    return _answer(api.camera.scene_controller.redo(), response)


@router.post("/reset", responses=error_responses(404))
def reset_scene(api: ApiContextDep, response: Response) -> SceneBody:
    """Show what the settings say, as at the first start. Where they name no subject, whoever is shown stays."""
    return _answer(api.camera.scene_controller.reset(), response)


def matching_revisions(if_match: str) -> frozenset[int] | None:
    """The revisions that an `If-Match` header names (RFC 9110); None for any. A weak tag matches none."""
    if if_match.strip() == "*":
        return None
    tags = _ENTITY_TAG.findall(if_match)
    return frozenset(int(tag) for weak, tag in tags if not weak and re.fullmatch(r"[0-9]{1,18}", tag))


def _with_changes(look: Look, changes: SceneChanges) -> Look:
    given = {name: getattr(changes, name) for name in changes.model_fields_set & LOOK_FIELDS}
    if "lighting" in given:
        fields = {name: getattr(changes.lighting, name) for name in changes.lighting.model_fields_set}
        given["lighting"] = look.lighting.model_copy(update=fields)
    return look.model_copy(update=given)


def _answer(scene: Scene, response: Response) -> SceneBody:
    response.headers["ETag"] = f'"{scene.revision}"'
    return scene_body(scene)
