"""The learned response: what the network sees, and what it may do to a response."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from relit_camera.capture.instant.response.learned_response import (
    LEAST_SHARE,
    input_signs,
    learned_network,
    response_inputs,
    with_learned_response,
)
from relit_camera.capture.instant.response.response_network import harmonic_signs, read_network
from relit_camera.light.directions import texel_directions, texel_solid_angles
from relit_camera.light.spherical_harmonics import basis, texel_basis
from tests.capture.instant.lit_person import SIDE, generic_person

TOWARD = texel_directions().reshape(-1, 3)


def test_it_sees_where_a_pixel_lies_on_the_head_and_what_the_generic_head_answers() -> None:
    shape, response, matte = generic_person()
    seen = response_inputs(response, shape, matte)
    assert seen.shape == (len(response.pixels), len(input_signs()))
    y, x = np.divmod(response.pixels, SIDE // 2)
    rows, columns = np.nonzero(shape.face)
    np.testing.assert_allclose(seen[:, 0], (x - columns.mean()) / shape.pixels_per_cm, atol=0.05)
    np.testing.assert_allclose(seen[:, 1], (rows.mean() - y) / shape.pixels_per_cm, atol=0.05)
    assert seen[(y == round(rows.mean())) & (x == round(columns.mean())), 2] > 5
    # The first harmonic is the same all round: the response to even light.
    even = response.diffuse @ texel_solid_angles().ravel()
    np.testing.assert_allclose(seen[:, 3], even / np.sqrt(4 * np.pi), rtol=1e-3)


def test_a_network_that_adds_nothing_leaves_the_response() -> None:
    shape, response, matte = generic_person()
    known = learned_network()
    weights, offsets = known.layers[-1]
    nothing = replace(known, layers=(*known.layers[:-1], (0 * weights, 0 * offsets)))
    same = with_learned_response(response, shape, matte, nothing)
    np.testing.assert_array_equal(same.diffuse, response.diffuse)


def test_what_it_adds_is_the_harmonics_and_never_takes_all() -> None:
    shape, response, matte = generic_person()
    known = learned_network()
    weights, _ = known.layers[-1]
    shift = np.zeros(9, np.float32)
    shift[3] = -5.0  # much less from before, more from behind
    steep = replace(known, layers=(*known.layers[:-1], (0 * weights, shift)))
    changed = with_learned_response(response, shape, matte, steep).diffuse
    wanted = response.diffuse + shift @ basis(TOWARD, 2).T
    free = wanted > LEAST_SHARE * response.diffuse
    np.testing.assert_allclose(changed[free], wanted[free], atol=1e-4)
    assert not free.all()
    np.testing.assert_allclose(changed[~free], LEAST_SHARE * response.diffuse[~free], atol=1e-6)


def test_it_changes_a_response_a_little_and_both_sides_alike() -> None:
    shape, response, matte = generic_person()
    seen = response_inputs(response, shape, matte)
    added = learned_network().outputs(seen)
    mirrored = learned_network().outputs(seen * input_signs()) * harmonic_signs()
    np.testing.assert_allclose(mirrored, added, atol=1e-5)
    assert 0.01 < np.abs(added @ texel_basis(2).T).mean() < 0.3


def test_written_it_is_read_again(tmp_path: Path) -> None:
    known = learned_network()
    known.write(tmp_path / "network.npz")
    again = read_network(tmp_path / "network.npz", input_signs(), harmonic_signs())
    inputs = np.random.default_rng(0).normal(0, 3, (20, len(input_signs()))).astype(np.float32)
    np.testing.assert_array_equal(again.outputs(inputs), known.outputs(inputs))
    assert (tmp_path / "network.npz").stat().st_size < 1 << 16
