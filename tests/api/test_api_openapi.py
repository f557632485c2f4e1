"""The description is kept in the repository, and true."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from relit_camera.api.openapi.openapi_export import openapi_text
from relit_camera.api.problem_details import MEDIA_TYPE
from tests.api.api_client import Client

KEPT = Path(__file__).resolve().parents[2] / "docs" / "openapi.json"
FIXED = {  # what the design promises
    "status": "get",
    "scene": "get patch",
    "scene/undo": "post",
    "scene/redo": "post",
    "scene/reset": "post",
    "lighting": "get put patch",
    "environments": "get post",
    "environments/{name}": "get delete",
    "environments/{name}/thumbnail.jpg": "get",
    "background": "get put",
    "mode": "get put",
    "freeze": "get put",
    "presets": "get",
    "presets/{name}": "get put patch delete",
    "neutral-pose": "post",
    "subjects": "get",
    "subjects/{name}": "get delete",
    "subject": "get put",
    "snapshot.jpg": "get",
    "preview.mjpg": "get",
    "events": "get",
    "checks": "get",
    "devices": "get",
    "source": "get patch",
    "tracker": "get put",
    "framing": "get put",
    "models": "get post delete",
}


@pytest.fixture(scope="module")
def described() -> dict[str, Any]:
    document: dict[str, Any] = json.loads(openapi_text())
    return document


def operations(document: dict[str, Any]) -> list[tuple[str, str, dict[str, Any]]]:
    return [(path, method, body) for path, ways in document["paths"].items() for method, body in ways.items()]


def test_the_kept_description_is_the_code_s(described: dict[str, Any]) -> None:
    cure = "write it again: python -m relit_camera.api.openapi.openapi_export"
    assert json.loads(KEPT.read_text(encoding="utf-8")) == described, cure


def test_it_is_served(client: Client, described: dict[str, Any]) -> None:
    assert client.get("/api/v1/openapi.json").json() == described


def test_everything_promised_is_there(described: dict[str, Any]) -> None:
    for path, methods in FIXED.items():
        assert set(methods.split()) <= set(described["paths"][f"/api/v1/{path}"]), path


def test_operations_have_names_tags_and_words(described: dict[str, Any]) -> None:
    found = [body["operationId"] for *_, body in operations(described)]
    assert len(found) == len(set(found))
    known = {tag["name"] for tag in described["tags"]}
    for _, _, body in operations(described):
        assert re.fullmatch(r"[a-z]+(_[a-z]+)*", body["operationId"])
        assert set(body["tags"]) <= known
        assert len(body["tags"]) == 1
        assert body["description"].strip()


def test_every_error_is_a_problem(described: dict[str, Any]) -> None:
    for path, method, body in operations(described):
        errors = {status: answer for status, answer in body["responses"].items() if status >= "400"}
        if "parameters" in body or "requestBody" in body:
            assert "422" in errors, (method, path)
        for answer in errors.values():
            assert list(answer["content"]) == [MEDIA_TYPE]
    assert "HTTPValidationError" not in described["components"]["schemas"]


def test_fields_are_snake_case_and_explained(described: dict[str, Any]) -> None:
    schemas = described["components"]["schemas"]
    for name, schema in schemas.items():
        for field in schema.get("properties", {}):
            assert re.fullmatch(r"[a-z][a-z0-9]*(_[a-z0-9]+)*", field), (name, field)
    assert "right" in schemas["Lighting"]["properties"]["yaw_deg"]["description"]


@pytest.mark.slow
def test_the_command_writes_it(tmp_path: Path) -> None:
    target = tmp_path / "openapi.json"
    command = [sys.executable, "-W", "error", "-m", "relit_camera.api.openapi.openapi_export", str(target)]
    subprocess.run(command, check=True, timeout=60)
    assert target.read_text(encoding="utf-8") == openapi_text()
