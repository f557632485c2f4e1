"""Routes of the presets: looks (lighting, background, mode, subject) stored under a name."""

from __future__ import annotations

from http import HTTPStatus

from starlette.responses import Response

from relit_camera.api.bodies.schemas import PresetChanges, PresetItem
from relit_camera.api.dependencies import ApiContextDep
from relit_camera.api.openapi.api_router import api_router
from relit_camera.api.problem_details import error_responses
from relit_camera.base.config.look import Look, Preset, StoredName
from relit_camera.live.scene.scene_controller import ChosenSubject

router = api_router("presets", "/presets")


@router.get("")
def list_presets(api: ApiContextDep) -> list[PresetItem]:
    """The stored presets."""
    at_start = api.presets.at_start()
    return [PresetItem(name=name, at_start=name == at_start) for name in api.presets.names()]


@router.get("/{name}", responses=error_responses(404, 422))
def get_preset(api: ApiContextDep, name: StoredName) -> Preset:
    """One preset: its look, and who is shown."""
    return api.presets.load(name)


@router.put(
    "/{name}",
    responses=error_responses(422, 507) | {HTTPStatus.CREATED.value: {"model": Preset, "description": "A new preset"}},
)
def save_preset(api: ApiContextDep, response: Response, name: StoredName, preset: Preset | None = None) -> Preset:
    """Store a look under a name, in place of one of that name. Without a body: what is shown now."""
    if preset is None:
        controller = api.camera.scene_controller
        scene = controller.scene
        stored = scene.subject_name in controller.subjects.names()  # one of a file is gone at the next start
        preset = Preset(**dict(scene.look), subject=scene.subject_name if stored else None)
    if api.presets.save(name, preset):
        response.status_code = HTTPStatus.CREATED
    api.publish_collection_changed("presets")
    return preset


@router.patch("/{name}", responses=error_responses(404, 409, 422, 507))
def change_preset(api: ApiContextDep, name: StoredName, changes: PresetChanges) -> PresetItem:
    """Rename a preset, or have it shown when the camera starts."""
    presets, given = api.presets, changes.model_fields_set
    presets.path(name)
    if "name" in given:
        presets.rename(name, changes.name)
        name = changes.name
    if "at_start" in given and changes.at_start != (presets.at_start() == name):
        presets.set_at_start(name if changes.at_start else None)
    api.publish_collection_changed("presets")
    return PresetItem(name=name, at_start=presets.at_start() == name)


@router.delete("/{name}", status_code=HTTPStatus.NO_CONTENT, responses=error_responses(404, 422))
def delete_preset(api: ApiContextDep, name: StoredName) -> None:
    """Delete a preset."""
    api.presets.remove(name)
    api.publish_collection_changed("presets")


@router.post("/{name}/apply", responses=error_responses(404, 409, 422))
def apply_preset(api: ApiContextDep, name: StoredName) -> Look:
    """Show a preset. The answer is the look as it now stands."""
    preset = api.presets.load(name)
    controller = api.camera.scene_controller
    named = preset.subject is not None and preset.subject != controller.scene.subject_name
    return controller.change(lambda _: preset.look, ChosenSubject(preset.subject) if named else None).look
