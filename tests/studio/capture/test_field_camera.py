"""A field's folder says where its camera stood: a capture places the person by it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from relit_camera.light.environments.builtin.builtin_light_maps import builtin_light_map
from relit_studio.cameras.pinhole import Pinhole
from relit_studio.cameras.studio_camera import Camera
from relit_studio.capture.persons.field_person import FieldPerson
from relit_studio.field.field_renderer import FieldSettings, field_description
from relit_studio.field.transport_solver import DISTANCE_CM, SolverSettings, write_solver_field
from relit_studio.people.face.landmarks import canonical_origin, landmarks
from relit_studio.people.person import Person
from relit_studio.people.posture import Posture


def test_the_camera_that_is_told_sees_points_where_they_are(person: Person) -> None:
    camera = Camera(64)
    told = field_description(person, FieldSettings(size=64), camera)["camera"]
    assert isinstance(told, dict)
    points = landmarks(person, Posture())["mesh478"]
    depth = points[:, 2] - canonical_origin(person.model)[0][2]  # as truth.npz has it
    pixels = camera.project(points)
    rays = Pinhole(64, 64, told["focal_px"]).rays(*pixels.T)
    found = rays * ((depth - told["depth_zero_cm"]) / rays[:, 2])[:, None]
    np.testing.assert_allclose(found, points - camera.position_cm, atol=1e-4)


@pytest.mark.slow
def test_a_solved_field_is_filmed_at_its_distance(tmp_path: Path) -> None:
    write_solver_field(
        tmp_path, SolverSettings(width=32, height=24, map_rows=4, bundles=8, rays=32, supersampling=1, shadow=96)
    )
    filmed = FieldPerson(tmp_path, 24, builtin_light_map("window"))
    assert abs(filmed.origin[2] + DISTANCE_CM) < 2
