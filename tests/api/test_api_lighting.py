"""GET, PUT and PATCH of the lighting."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import pytest

from relit_camera.base.config.look import Lighting
from tests.api.api_client import Client, check_problem
from tests.api.fake_camera import FakeCamera

LIGHTING = "/api/v1/lighting"
LAMP = {"azimuth_deg": 90, "elevation_deg": 0, "kelvin": 3200, "intensity": 2}


def test_get_answers_every_field(client: Client) -> None:
    assert client.get(LIGHTING).json() == Lighting().model_dump(mode="json")


def test_put_takes_defaults_for_fields_left_out(client: Client, camera: FakeCamera) -> None:
    client.put(LIGHTING, {"environment": "sunset", "yaw_deg": 30})
    answer = client.put(LIGHTING, {"exposure_ev": -1})
    assert answer.status_code == 200
    assert answer.json() == Lighting(exposure_ev=-1).model_dump(mode="json")
    assert camera.scene_controller.scene.look.lighting == Lighting(exposure_ev=-1)


def test_patch_changes_only_what_is_given(client: Client) -> None:
    client.put(LIGHTING, {"environment": "sunset", "yaw_deg": 30, "lamps": [LAMP]})
    answer = client.patch(LIGHTING, {"yaw_deg": -45, "blend": 0.5})
    assert answer.json() == client.get(LIGHTING).json()
    stands = Lighting.model_validate(answer.json())
    assert (stands.environment, stands.yaw_deg, stands.blend) == ("sunset", -45, 0.5)
    assert stands.lamps[0].kelvin == 3200


def test_patch_replaces_lamps_as_a_whole(client: Client) -> None:
    client.put(LIGHTING, {"lamps": [LAMP, LAMP]})
    answer = client.patch(LIGHTING, {"lamps": [{"color": [1, 0.5, 0]}]})
    (lamp,) = answer.json()["lamps"]
    assert lamp["color"] == [1, 0.5, 0]
    assert lamp["kelvin"] is None
    assert client.patch(LIGHTING, {"lamps": []}).json()["lamps"] == []


def test_null_environment_is_lamps_only(client: Client, camera: FakeCamera) -> None:
    assert client.patch(LIGHTING, {"environment": None}).json()["environment"] is None
    assert camera.scene_controller.scene.environment is None


def test_changing_another_field_keeps_the_environment_that_was_read(client: Client, camera: FakeCamera) -> None:
    before = camera.scene_controller.scene.environment
    client.patch(LIGHTING, {"yaw_deg": 10})
    assert camera.scene_controller.scene.environment is before is not None


@pytest.mark.parametrize("method", ["PUT", "PATCH"])
def test_unknown_environment_is_not_found_and_changes_nothing(client: Client, camera: FakeCamera, method: str) -> None:
    before = camera.scene_controller.scene
    body = check_problem(client.request(method, LIGHTING, json={"environment": "sunzet", "yaw_deg": 5}), 404)
    assert "sunzet" in body["what"]
    assert "sunset" in body["cure"]
    assert camera.scene_controller.scene is before


@pytest.mark.parametrize(
    ("body", "field"),
    [
        ({"blend": 1.5}, "blend"),
        ({"yaw_deg": "left"}, "yaw_deg"),
        ({"yaw": 3}, "yaw"),
        ({"environment": "../../etc/passwd"}, "environment"),
        ({"exposure_ev": None}, "exposure_ev"),
        ({"lamps": [LAMP, {**LAMP, "color": [1, 1, 1]}]}, "lamps.1"),
        ({"lamps": [LAMP] * 17}, "lamps"),
        ([], ""),
    ],
)
@pytest.mark.parametrize("method", ["PUT", "PATCH"])
def test_bad_values_name_their_field(client: Client, camera: FakeCamera, method: str, body: object, field: str) -> None:
    before = camera.scene_controller.scene
    problem = check_problem(client.request(method, LIGHTING, json=body), 422)
    assert problem["errors"][0]["field"] == field
    assert field in problem["what"]
    assert camera.scene_controller.scene is before


def test_not_a_number_is_refused(client: Client) -> None:
    headers = {"content-type": "application/json"}
    problem = check_problem(client.request("PUT", LIGHTING, content='{"yaw_deg": NaN}', headers=headers), 422)
    assert problem["errors"][0]["field"] == "yaw_deg"


def test_broken_json_is_unreadable(client: Client) -> None:
    headers = {"content-type": "application/json"}
    problem = check_problem(client.request("PUT", LIGHTING, content='{"yaw_deg": ', headers=headers), 400)
    assert "JSON" in problem["what"]


def test_lit_by_a_background_that_cannot_light_is_refused(client: Client) -> None:
    problem = check_problem(client.patch(LIGHTING, {"environment": "background"}), 422)
    assert "background" in problem["what"]
    client.put("/api/v1/background", {"kind": "color", "color": "#ff8800"})
    assert client.patch(LIGHTING, {"environment": "background"}).json()["environment"] == "background"


def test_concurrent_changes_lose_nothing_and_mix_nothing(client: Client, camera: FakeCamera) -> None:
    """Twenty lightings, each with yaw = 10·exposure, race with changes of other parts."""
    first = camera.scene_controller.scene.revision

    def change(number: int) -> None:
        if number % 4 == 0:
            client.put("/api/v1/mode", {"mode": "portrait"})
        elif number % 4 == 1:
            client.put("/api/v1/background", {"kind": "blur", "strength": 0.25})
        else:
            exposure = number % 8
            client.put(LIGHTING, {"exposure_ev": exposure, "yaw_deg": 10 * exposure})
        look = camera.scene_controller.scene.look
        assert look.lighting.yaw_deg == 10 * look.lighting.exposure_ev

    with ThreadPoolExecutor(8) as pool:
        list(pool.map(change, range(40)))
    look = camera.scene_controller.scene.look
    assert camera.scene_controller.scene.revision == first + 40
    assert look.mode == "portrait"
    assert look.background.kind == "blur"
