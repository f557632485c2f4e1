"""Relighters that are shared: made once, also by two threads at once, and gone when nobody has them."""

from __future__ import annotations

import gc
import threading
import time
import weakref
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from relit_camera.base.models.session_with_fallback import SessionOptions
from relit_camera.capture.subject_builder import build_subject
from relit_camera.lab.bench.synthetic_subject import synthetic_subject
from relit_camera.light.environments.builtin.builtin_light_maps import builtin_light_map
from relit_camera.subject.half_size import half_size_subject
from relit_camera.subject.relighting import shared_relighters
from relit_camera.subject.relighting.basis_relighter import BasisRelighter, ClusterPictures
from relit_camera.subject.relighting.relighter import RelighterOptions
from relit_camera.subject.relighting.shared_relighters import SharedRelighters
from relit_camera.subject.subject import Subject
from tests.synthetic import sphere_samples


class Maker:
    """Makes relighters slowly, and counts them."""

    def __init__(self) -> None:
        self.made = 0

    def __call__(self, subject: Subject, options: RelighterOptions, other: BasisRelighter | None) -> BasisRelighter:
        self.made += 1
        time.sleep(0.1)
        return BasisRelighter(subject, options, other)


def test_threads_that_want_it_at_once_have_the_same() -> None:
    make = Maker()
    shared, subject = SharedRelighters(make), synthetic_subject(16, 16)
    with ThreadPoolExecutor(3) as pool:
        found = list(pool.map(lambda _: shared.get(subject), range(3)))
    assert make.made == 1
    assert found[0] is found[1] is found[2]


def test_another_subject_and_other_threads_have_their_own() -> None:
    shared, subject = SharedRelighters(), synthetic_subject(16, 16)
    first, other = shared.get(subject), shared.get(synthetic_subject(16, 16))
    two = shared.get(subject, RelighterOptions(SessionOptions("cpu", threads=2)))
    assert len({id(first), id(other), id(two)}) == 3


def test_one_that_is_made_already_can_be_had_without_waiting() -> None:
    shared, subject = SharedRelighters(), synthetic_subject(16, 16)
    assert shared.made(subject) is None
    relighter = shared.get(subject)
    assert shared.made(subject) is relighter
    assert shared.made(synthetic_subject(16, 16)) is None


def test_one_who_hangs_while_making_it_is_not_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shared_relighters, "WAIT_S", 0.05)
    hanging, go_on = threading.Event(), threading.Event()

    def make(subject: Subject, options: RelighterOptions, other: BasisRelighter | None) -> BasisRelighter:
        if not hanging.is_set():
            hanging.set()
            go_on.wait(30)
        return BasisRelighter(subject, options, other)

    shared, subject = SharedRelighters(make), synthetic_subject(16, 16)
    thread = threading.Thread(target=shared.get, args=(subject,))
    thread.start()
    hanging.wait(30)
    assert shared.get(subject) is not None
    go_on.set()
    thread.join()


@pytest.mark.slow
def test_what_nobody_has_is_not_kept() -> None:
    make = Maker()
    shared, subject = SharedRelighters(make), synthetic_subject(16, 16)
    gone = weakref.ref(shared.get(subject))
    gc.collect()
    assert gone() is None
    assert shared.get(subject) is not None
    assert make.made == 2


def test_a_subject_is_not_kept() -> None:
    shared, subject = SharedRelighters(), synthetic_subject(16, 16)
    relighter, gone = shared.get(subject), weakref.ref(subject)
    del subject
    gc.collect()
    assert gone() is None
    assert relighter is not None


def test_one_that_cannot_be_made_is_tried_again() -> None:
    failing = threading.Event()

    def make(subject: Subject, options: RelighterOptions, other: BasisRelighter | None) -> BasisRelighter:
        if not failing.is_set():
            failing.set()
            raise MemoryError
        return BasisRelighter(subject, options, other)

    shared, subject = SharedRelighters(make), synthetic_subject(16, 16)
    with pytest.raises(MemoryError):
        shared.get(subject)
    assert shared.get(subject) is not None


def sphere_of_many_lights() -> Subject:
    """A subject of more components than are relit without mixes."""
    return build_subject(
        sphere_samples(100, 32), "barycentric", "sphere", landmarks={"none": np.zeros((1, 2), np.float32)}
    )


def mixes_of(relighter: BasisRelighter) -> object:
    """The product that two relighters may share."""
    assert isinstance(relighter._pictures, ClusterPictures)
    return relighter._pictures.mixes


@pytest.mark.slow
def test_the_same_person_in_another_size_shares_the_mixes() -> None:
    shared, whole = SharedRelighters(), sphere_of_many_lights()
    half = half_size_subject(whole)
    assert half.basis.has_mixes_of(whole.basis)
    assert half.basis.values.dtype == np.int8
    first = shared.get(whole)
    second = shared.get(half)
    assert mixes_of(second) is mixes_of(first)
    assert second._coefficient_product is first._coefficient_product
    other = replace(half, coefficients=2 * half.coefficients)
    assert shared.get(other)._coefficient_product is not first._coefficient_product
    light = builtin_light_map("sunset")[None]
    np.testing.assert_array_equal(second.relight(light), BasisRelighter(half).relight(light))
    assert mixes_of(shared.get(sphere_of_many_lights())) is not mixes_of(first)


@pytest.mark.slow
def test_the_same_person_in_another_size_shares_the_coefficients_of_few_components() -> None:
    shared, whole = SharedRelighters(), synthetic_subject(48, 40)
    half = half_size_subject(whole)
    first, second = shared.get(whole), shared.get(half)
    assert second._coefficient_product is first._coefficient_product
    light = builtin_light_map("sunset")[None]
    np.testing.assert_array_equal(second.relight(light), BasisRelighter(half).relight(light))


@pytest.mark.slow
def test_mixes_of_half_floats_are_not_shared() -> None:
    """In 8 bits their units depend on the values, which are others at half the size."""
    shared, whole = SharedRelighters(), sphere_of_many_lights()
    whole = replace(whole, basis=replace(whole.basis, values=whole.basis.values.astype(np.float16)))
    half = half_size_subject(whole)
    assert half.basis.has_mixes_of(whole.basis)
    assert mixes_of(shared.get(half)) is not mixes_of(shared.get(whole))
