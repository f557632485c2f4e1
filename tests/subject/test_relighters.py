"""Every relighter gives the same picture, and it is the integral of field times light."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import onnxruntime
import pytest

from relit_camera.app.demo import demo_files
from relit_camera.base.errors import DeviceError, NotFoundError
from relit_camera.base.images.image_quality import psnr
from relit_camera.base.models import provider_names, session_with_fallback
from relit_camera.base.models.session_with_fallback import SessionOptions
from relit_camera.base.rotations import rotation_from_angles
from relit_camera.capture.reflectance.directional_light import relight_from_direction
from relit_camera.capture.subject_builder import build_subject
from relit_camera.light.directions import direction_from_degrees, texel_directions, texel_solid_angles
from relit_camera.light.light_map_rotation import rotate_light_map
from relit_camera.subject.compression.local_basis import LocalBasis, global_basis
from relit_camera.subject.relighting.basis_relighter import BasisRelighter, ClusterPictures
from relit_camera.subject.relighting.component_pictures import ComponentPictures, component_bytes
from relit_camera.subject.relighting.onnx_relighter import OnnxBasisRelighter
from relit_camera.subject.relighting.relighter import open_relighter, weighted_light
from relit_camera.subject.subject import Subject
from relit_camera.subject.subject_file import read_subject
from tests.subject.handmade_basis import rows_by_hand
from tests.synthetic import render_sphere, sphere_samples, sphere_surface

ACCURACY_DB = {"dense": 90, "basis": 65, "onnx-basis": 90}
"""Least PSNR of linear pictures against the field summed by hand: `basis` keeps and multiplies 8-bit integers."""
ALL = list(ACCURACY_DB)


@pytest.fixture(scope="module")
def sphere() -> Subject:
    return build_subject(
        sphere_samples(400, 32), "barycentric", "sphere", landmarks={"none": np.zeros((1, 2), np.float32)}
    )


@pytest.fixture(scope="module")
def coloured_light() -> np.ndarray:
    rng = np.random.default_rng(3)
    return rng.gamma(0.5, 1.0, (32, 64, 3)).astype(np.float32)


@pytest.fixture(scope="module")
def sphere_field(sphere: Subject) -> np.ndarray:
    return _field_by_hand(sphere)


def relit(name: str, subject: Subject, light: np.ndarray) -> np.ndarray:
    """The subject under one light map."""
    return open_relighter(name, subject).relight(light[None])[0]


@pytest.mark.slow
@pytest.mark.parametrize("name", ALL)
def test_agrees_with_the_field_summed_by_hand(
    sphere: Subject, sphere_field: np.ndarray, coloured_light: np.ndarray, name: str
) -> None:
    weighted = (coloured_light * texel_solid_angles()[..., None]).reshape(-1, 3)
    expected = np.einsum("hwlc,lc->hwc", sphere_field, weighted).astype(np.float32)
    picture = relit(name, sphere, coloured_light)
    assert picture.dtype == np.float32
    assert psnr(picture, expected, sphere.matte) > ACCURACY_DB[name]


@pytest.mark.slow
def test_many_components_are_relit_by_clusters(sphere: Subject) -> None:
    assert isinstance(BasisRelighter(sphere)._pictures, ClusterPictures)


FEW = 40
"""Lights of a subject whose components are few enough for a picture each."""
LAMP_DB = 70
"""Least PSNR under one lamp, whose 99th percentile is taken for 1."""


@pytest.fixture(scope="module")
def few() -> Subject:
    return build_subject(
        sphere_samples(FEW, 32), "barycentric", "sphere", landmarks={"none": np.zeros((1, 2), np.float32)}
    )


@pytest.mark.slow
@pytest.mark.parametrize("values", [np.int8, np.float16])
def test_few_components_are_relit_by_whole_pictures(few: Subject, coloured_light: np.ndarray, values: type) -> None:
    subject = replace(few, basis=replace(few.basis, values=few.basis.values.astype(values)))
    assert subject.metadata.components <= FEW
    field = _field_by_hand(subject)
    lamp = np.zeros_like(coloured_light)
    lamp[6, 50] = (40, 20, 10)
    lights = np.stack([coloured_light, lamp])
    relighter = BasisRelighter(subject)
    pictures = relighter.relight(lights)
    assert isinstance(relighter._pictures, ComponentPictures)
    for light, picture in zip(lights, pictures, strict=True):
        weighted = (light * texel_solid_angles()[..., None]).reshape(-1, 3)
        expected = np.einsum("hwlc,lc->hwc", field, weighted).astype(np.float32)
        peak = np.percentile(expected[subject.matte > 0], 99)
        assert psnr(picture / peak, expected / peak, subject.matte) > LAMP_DB
        assert not picture[subject.matte == 0].any()
        np.testing.assert_allclose(relighter.relight(light[None])[0], picture, atol=1e-4 * expected.max())
    assert not relighter.relight(np.zeros((1, 32, 64, 3), np.float32)).any()


@pytest.mark.slow
def test_the_bundled_person_under_lamps_all_round() -> None:
    """Packed, with few components, and dark from behind: there one code a value showed blotches."""
    subject = read_subject(demo_files.SUBJECT)
    relighter = BasisRelighter(subject)
    assert isinstance(relighter._pictures, ComponentPictures)
    for row in (8, 16):
        for column in range(0, 64, 8):
            light = np.zeros((1, 32, 64, 3), np.float32)
            light[0, row, column] = 1
            weighted = weighted_light(light)[0]
            truth = subject.pictures(subject.coefficients @ weighted)
            expected = np.stack([truth[channel, ..., channel] for channel in range(3)], axis=-1)
            peak = np.percentile(expected[subject.matte > 0.5], 99)
            assert psnr(relighter.relight(light)[0] / peak, expected / peak, subject.matte) > LAMP_DB, (row, column)


def test_many_times_the_bytes_are_not_read_for_few_components(few: Subject) -> None:
    """Clusters of one component each, as of a large picture with little in it."""
    pixels = np.arange(32 * 32, dtype=np.int32).reshape(8, 128)
    rng = np.random.default_rng(4)
    values = rng.integers(-127, 128, (8, 3, 128)).astype(np.int8)
    mixes = rng.standard_normal((8, few.metadata.components)).astype(np.float16)
    basis = LocalBasis(pixels, np.arange(9, dtype=np.int32), values, np.ones(8, np.float32), mixes)
    relighter = BasisRelighter(replace(few, basis=basis))
    assert isinstance(relighter._pictures, ClusterPictures)
    assert component_bytes(basis) > 3 * relighter._pictures.nbytes


def test_pictures_of_few_components_without_a_matte(few: Subject, coloured_light: np.ndarray) -> None:
    """Every pixel is in a cluster."""
    everywhere = np.ones_like(few.matte)
    pictures = np.random.default_rng(0).random((3, 8, 32, 32)).astype(np.float16)
    basis = global_basis(pictures, everywhere)
    amounts = np.random.default_rng(1).standard_normal((3, 2, 8)).astype(np.float32)
    found = ComponentPictures(basis, everywhere.size)(amounts)
    expected = np.einsum("cnk,ckp->npc", amounts, pictures.reshape(3, 8, -1).astype(np.float32))
    np.testing.assert_allclose(found, expected, atol=2e-4 * np.abs(expected).max())


@pytest.mark.parametrize("name", ALL)
def test_under_several_lights_at_once_as_under_each(sphere: Subject, coloured_light: np.ndarray, name: str) -> None:
    relighter = open_relighter(name, sphere)
    lights = np.stack([coloured_light, 2 * coloured_light[::-1], coloured_light[:, :, ::-1]])
    pictures = relighter.relight(lights)
    assert pictures.shape == (3, 32, 32, 3)
    assert pictures.dtype == np.float32
    for light, picture in zip(lights, pictures, strict=True):
        assert psnr(picture, relighter.relight(light[None])[0], sphere.matte) > ACCURACY_DB[name]


@pytest.mark.parametrize("name", ALL)
def test_a_lit_sphere_reads_its_irradiance(sphere: Subject, name: str) -> None:
    """Under uniform radiance 1 a Lambertian patch of unit response facing the camera reads ∫ max(0, n·l) dω = π."""
    picture = relit(name, sphere, np.ones((32, 64, 3), np.float32))
    assert picture[24, 8].mean() == pytest.approx(np.pi, rel=0.03)


def test_white_light_gives_the_sum_picture(sphere: Subject, sphere_field: np.ndarray) -> None:
    summed = (sphere_field * texel_solid_angles().ravel()[:, None]).sum(axis=2).astype(np.float32)
    assert psnr(relit("basis", sphere, np.ones((32, 64, 3), np.float32)), summed, sphere.matte) > ACCURACY_DB["basis"]


def test_a_captured_direction_returns_the_captured_frame(sphere: Subject) -> None:
    samples = sphere_samples(400, 32)
    in_front = np.flatnonzero(samples.directions[:, 2] > 0)[::17]
    assert len(in_front) > 8
    for index in in_front:
        picture = relight_from_direction(sphere, samples.directions[index])
        assert psnr(picture, samples.pictures[index], samples.matte) > 45


def test_a_subject_without_captured_directions_is_relit_from_its_map(sphere: Subject) -> None:
    """An instant capture has the room's light alone, and its method's name is none of the reflectance methods."""
    metadata = sphere.metadata.model_copy(update={"rung": "instant", "method": "instant"})
    instant = replace(sphere, metadata=metadata)
    light = direction_from_degrees(35, 25)
    assert psnr(relight_from_direction(instant, light), relight_from_direction(sphere, light), sphere.matte) > 30


POSES = [(30, 0, 0), (-30, 0, 0), (0, 25, 0), (0, -25, 0), (0, 0, 40), (0, 0, -40), (25, -15, 20), (-35, 20, -30)]


@pytest.mark.parametrize("pose", POSES)
def test_a_light_fixed_in_the_room_and_a_turned_head(sphere: Subject, pose: tuple[float, float, float]) -> None:
    """Sign and amount of the counter-rotation, against a rendered sphere with a shadowing bump.

    The truth turns sphere and bump in the room, where the light stays, by matrices written out from the signs that
    users are told: nothing of the code under test. A sphere that shades right but shadows wrong would fail: the bump
    is off centre.
    """
    room_light = direction_from_degrees(35, 25)
    head = rotation_from_angles(*pose)
    truth = render_sphere(room_light, 32, _turn(*pose))
    wrong = render_sphere(room_light, 32, _turn(*pose).T)
    exact = relight_from_direction(sphere, head.inv().apply(room_light))
    assert psnr(exact, truth, sphere.matte) > 22
    assert psnr(exact, truth, sphere.matte) > psnr(exact, wrong, sphere.matte) + 6

    through_map = relit("basis", sphere, rotate_light_map(_lamp(room_light), head))
    assert psnr(through_map, truth, sphere.matte) > 20
    assert psnr(through_map, truth, sphere.matte) > psnr(through_map, wrong, sphere.matte) + 5


@pytest.mark.parametrize("axis", [0, 1, 2], ids=["yaw", "pitch", "roll"])
@pytest.mark.parametrize("true_deg", [24, -24])
def test_nearby_poses_beat_the_right_one_never(sphere: Subject, axis: int, true_deg: float) -> None:
    """The amount: of all angles the one that was rendered fits best."""
    room_light = direction_from_degrees(-30, 25)
    truth = render_sphere(room_light, 32, _turn(*(true_deg * np.eye(3)[axis])))
    relighter = open_relighter("basis", sphere)
    angles = np.arange(-48, 49, 4)
    scores = []
    for angle in angles:
        light = rotate_light_map(_lamp(room_light), rotation_from_angles(*(angle * np.eye(3)[axis])))
        scores.append(psnr(relighter.relight(light[None])[0], truth, sphere.matte))
    assert angles[int(np.argmax(scores))] == true_deg


def test_light_from_the_picture_right_lights_its_right_half(sphere: Subject) -> None:
    picture = relight_from_direction(sphere, direction_from_degrees(90, 0))
    assert picture[:, 16:].sum() > 10 * picture[:, :16].sum()
    above = relight_from_direction(sphere, direction_from_degrees(0, 80))
    assert above[:16].sum() > 3 * above[16:].sum()


@pytest.mark.parametrize("name", ALL)
def test_pixels_outside_the_matte_are_black(sphere: Subject, coloured_light: np.ndarray, name: str) -> None:
    """Also where the capture saw something there: here the same as in the middle of the sphere."""
    outside = ~sphere_surface(32)[1]
    pictures = sphere.pictures(np.eye(sphere.metadata.components, dtype=np.float32)).transpose(3, 0, 1, 2)
    scale = np.abs(pictures).max(axis=(0, 2, 3))
    pictures = (pictures / scale[:, None, None]).astype(np.float16)
    pictures[:, :, outside] = pictures[:, :, 16, 16, None]
    whole = replace(
        sphere, basis=global_basis(pictures, sphere.matte), coefficients=sphere.coefficients * scale[:, None]
    )
    picture = relit(name, whole, coloured_light)
    assert np.abs(picture[outside]).max() == 0
    assert psnr(picture, relit("basis", sphere, coloured_light), sphere.matte) > 55


def test_an_unknown_relighter_lists_those_there_are(sphere: Subject) -> None:
    with pytest.raises(NotFoundError, match="basis"):
        open_relighter("magic", sphere)


def pretend_cuda(monkeypatch: pytest.MonkeyPatch, placement: dict[str, int]) -> None:
    """An ONNX Runtime that was built with CUDA, places nodes as given, and computes on the CPU all the same."""
    available, real = ["CUDAExecutionProvider", "CPUExecutionProvider"], onnxruntime.InferenceSession

    def accept(model: object, options: object, providers: list[str], **rest: int) -> onnxruntime.InferenceSession:
        return real(model, options, providers=available[1:], **rest)

    monkeypatch.setattr(onnxruntime, "get_available_providers", lambda: available)
    monkeypatch.setattr(onnxruntime, "InferenceSession", accept)
    monkeypatch.setattr(session_with_fallback, "node_placement", lambda _: placement)
    monkeypatch.setattr(provider_names, "preload", lambda _: "")


def test_auto_is_the_basis_where_there_is_no_gpu(
    sphere: Subject, coloured_light: np.ndarray, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(onnxruntime, "get_available_providers", lambda: ["CPUExecutionProvider"])
    monkeypatch.setattr(OnnxBasisRelighter, "__init__", pytest.fail)  # no graph is made in vain
    caplog.set_level("DEBUG", "relit_camera")
    chosen = open_relighter("auto", sphere)
    assert (chosen.name, chosen.provider) == ("basis", "cpu")
    assert "the subject is relit by basis on cpu" in caplog.text
    expected = relit("basis", sphere, coloured_light)
    np.testing.assert_array_equal(chosen.relight(coloured_light[None])[0], expected)


def test_auto_is_the_graph_where_a_gpu_is_proven_to_run_it(
    sphere: Subject, coloured_light: np.ndarray, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    pretend_cuda(monkeypatch, {"cuda": 20, "cpu": 1})
    caplog.set_level("INFO", "relit_camera")
    chosen = open_relighter("auto", sphere)
    assert (chosen.name, chosen.provider) == ("onnx-basis", "cuda")
    assert "the subject is relit by onnx-basis on cuda" in caplog.text
    expected = relit("basis", sphere, coloured_light)
    assert psnr(chosen.relight(coloured_light[None])[0], expected, sphere.matte) > ACCURACY_DB["basis"]


@pytest.mark.parametrize("placement", [{"cpu": 21}, {"cuda": 2, "cpu": 19}], ids=["none", "few"])
def test_auto_is_the_basis_where_the_gpu_does_not_take_the_graph_and_the_log_says_why(
    sphere: Subject, placement: dict[str, int], monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    pretend_cuda(monkeypatch, placement)
    assert open_relighter("auto", sphere).name == "basis"
    assert "relighting stays on the CPU: cuda: " in caplog.text
    assert "placed there" in caplog.text
    with pytest.raises(DeviceError, match="model relight-basis cannot run on cuda"):
        open_relighter("auto", sphere, SessionOptions("cuda", strict=True))


def test_auto_takes_the_cpu_that_is_asked_for(sphere: Subject, monkeypatch: pytest.MonkeyPatch) -> None:
    pretend_cuda(monkeypatch, {"cuda": 21})
    assert open_relighter("auto", sphere, SessionOptions("cpu")).name == "basis"


def _field_by_hand(subject: Subject) -> np.ndarray:
    """R (height, width, 2048, 3) float64."""
    width, height = subject.size
    field = rows_by_hand(subject.basis, width * height) @ subject.coefficients
    return field.transpose(0, 2, 1).reshape(height, width, -1, 3)


def _turn(yaw: float, pitch: float, roll: float) -> np.ndarray:
    """Nose to the picture's right by yaw, after nose down by pitch, after the picture's right side up by roll."""
    (sy, sp, sr), (cy, cp, cr) = np.sin(np.radians([yaw, pitch, roll])), np.cos(np.radians([yaw, pitch, roll]))
    by_yaw = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    by_pitch = np.array([[1, 0, 0], [0, cp, -sp], [0, sp, cp]])
    by_roll = np.array([[cr, -sr, 0], [sr, cr, 0], [0, 0, 1]])
    return by_yaw @ by_pitch @ by_roll


def _lamp(direction: np.ndarray) -> np.ndarray:
    """A lamp of 8° as a light map of unit irradiance."""
    cosine = texel_directions() @ direction
    lobe = np.exp((cosine - 1) / (1 - np.cos(np.radians(4.0))))
    lobe /= (lobe * texel_solid_angles()).sum()
    return np.repeat(lobe[..., None], 3, axis=2).astype(np.float32)


@pytest.mark.slow
def test_a_subject_of_texels_returns_captured_frames_too_and_nearly_the_field_between_them() -> None:
    """The blend decides pixel by pixel, so its file holds texels, not weights of captured lights."""
    samples = sphere_samples(90, 32)
    subject = build_subject(samples, "blend", "sphere", landmarks={"none": np.zeros((1, 2), np.float32)})
    for index in (3, 40, 77):
        assert (
            psnr(relight_from_direction(subject, samples.directions[index]), samples.pictures[index], samples.matte)
            > 40
        )
    between = direction_from_degrees(33, 21)
    assert psnr(relight_from_direction(subject, between), render_sphere(between, 32), samples.matte) > 25
