"""Which pictures of a subject in places are made anew, and what is kept meanwhile."""

from __future__ import annotations

import gc
import weakref
from dataclasses import replace

import pytest

from relit_camera.api.subject_in_places import SubjectInPlaces
from relit_camera.light.environments.environment_panorama import Environment
from relit_camera.light.environments.environment_store import EnvironmentStore
from tests.generated_subject import small_subject


@pytest.mark.slow
def test_the_picture_is_kept_and_the_environment_is_not() -> None:
    store, subject, places = EnvironmentStore(), small_subject(), SubjectInPlaces()
    loaded: list[weakref.ref[Environment]] = []

    def load(name: str) -> Environment:
        found = store.load(name)
        made = Environment(found.name, found.panorama, found.light_map, found.notes)
        loaded.append(weakref.ref(made))
        return made

    first = places.jpeg(subject, "place", lambda: load("sunset")).result(30)
    gc.collect()
    assert [each() for each in loaded] == [None]
    assert places.jpeg(subject, "place", lambda: load("sunset")).result(30) is first
    assert places.jpeg(subject, "place", lambda: load("party")).result(30) != first


@pytest.mark.slow
def test_a_subject_that_is_shown_no_more_is_not_kept() -> None:
    subject, places = replace(small_subject()), SubjectInPlaces()
    places.jpeg(subject, "place", lambda: EnvironmentStore().load("sunset")).result(30)
    held = weakref.ref(subject)
    del subject
    gc.collect()
    assert held() is None
