"""Cost curves: their points are measured, grow where they must, and are written as plots and figures."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from relit_camera.lab.bench.curves import light_curve as light
from relit_camera.lab.bench.curves import preview_curve as preview
from relit_camera.lab.bench.curves import relighting_curves as relighting
from relit_camera.lab.bench.curves.cost_curve import CostCurve, median_processor_ms
from relit_camera.lab.bench.curves.relighting_curves import sized_subject
from relit_camera.lab.bench.mesh_run import MeshRun
from relit_camera.subject.relighting.basis_relighter import BasisRelighter
from relit_camera.subject.relighting.dense_relighter import DenseRelighter
from tests.cli.relit_command import call

SIDES_PX, RANKS, LAMPS, VIEWERS = (8, 24), (8, 16), (0, 12), (1, 3)


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """The command measures tiny sizes, briefly."""
    curves = partial(
        relighting.relighting_curves, sides_px=SIDES_PX, ranks=RANKS, side_px=16, read_bytes=1 << 20, at_most_s=0.01
    )
    monkeypatch.setattr(relighting, "relighting_curves", curves)
    monkeypatch.setattr(light, "light_curve", partial(light.light_curve, lamp_counts=LAMPS, at_most_s=0.01))
    monkeypatch.setattr(preview, "preview_curve", partial(preview.preview_curve, viewer_counts=VIEWERS, seconds=0.5))


@pytest.mark.slow
@pytest.mark.usefixtures("small")
def test_the_command_writes_plots_and_figures(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    folder = tmp_path / "new" / "curves"
    answer = call("bench", "--curves", folder)
    assert answer.code == 0, answer.err
    found = json.loads((folder / "curves.json").read_text())
    curves = {curve["name"]: curve for curve in found["curves"]}
    sizes = {name: tuple(curve["sizes"]) for name, curve in curves.items()}
    assert sizes == {
        "relighting-pixels": tuple(side**2 for side in SIDES_PX),
        "relighting-rank": RANKS,
        "light-map-lamps": LAMPS,
        "preview-viewers": VIEWERS,
    }
    for name, curve in curves.items():
        assert (folder / f"{name}.svg").read_text().rstrip().endswith("</svg>")
        assert curve["caption"] in answer.out
        for series, values in curve["processor_ms"].items():
            assert all(ms > 0 for ms in values)
            assert curve["mesh_runs"][series] == pytest.approx([ms / curve["mesh_run_ms"] for ms in values])
    assert curves["relighting-pixels"]["processor_ms"].keys() == {"basis", "onnx-basis", "dense"}
    assert curves["relighting-rank"]["processor_ms"].keys() == {"basis", "onnx-basis"}
    for name in ("relighting-pixels", "relighting-rank"):
        for read in [*curves[name]["other"].values(), *curves[name]["bounds_ms"].values()]:
            assert read[0] < read[1]
    for few, many in curves["light-map-lamps"]["processor_ms"].values():
        assert few < many
    assert all(rate > 1 for rate in curves["preview-viewers"]["other"]["pictures a second each"])
    assert found["machine"]["cores"] >= 1


def test_a_folder_that_cannot_be_made_is_one_line(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    (tmp_path / "file").write_text("")
    call("bench", "--curves", tmp_path / "file").complains("file", "cannot write")


def test_the_random_subject_is_relit_alike_by_basis_and_matrix() -> None:
    subject = sized_subject(20, 16)  # 400 pixels: the last cluster is not full
    light_map = np.random.default_rng(2).random((1, 32, 64, 3), np.float32)
    dense, basis = DenseRelighter(subject).relight(light_map), BasisRelighter(subject).relight(light_map)
    assert np.sqrt(np.mean((dense - basis) ** 2)) < 0.01 * np.abs(dense).max()


@pytest.mark.slow
def test_the_dense_matrix_is_left_out_where_it_is_too_large(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(relighting, "DENSE_SIDE_PX", 8)
    pixels, _ = relighting.relighting_curves(MeshRun(), (8, 16), (8,), 8, 0.0, 1 << 20)
    measured, left_out = pixels.processor_ms["dense"]
    assert measured
    assert left_out is None
    assert pixels.text().splitlines()[-1].count("–") == 3


def test_a_point_is_the_median_of_processor_times(monkeypatch: pytest.MonkeyPatch) -> None:
    times = iter([0.0, 0.004, 1.0, 1.009, 2.0, 2.005])
    monkeypatch.setattr("relit_camera.lab.bench.curves.cost_curve.time.process_time", lambda: next(times))
    assert median_processor_ms(lambda: None, 0.0) == pytest.approx(5.0)


def test_the_table_has_a_line_a_size() -> None:
    curve = CostCurve("n", "lamps", [0, 8], "Lamps.", 2.0, {"small": [1.0, None]}, other={"MB": [3.0, 4.0]})
    head, names, *rows = curve.text().splitlines()
    assert head == "Lamps. A mesh run: 2.00 ms."
    assert names.split() == ["lamps", "small,", "ms", "mesh", "runs", "MB"]
    assert [row.split() for row in rows] == [["0", "1.000", "0.500", "3.0"], ["8", "–", "–", "4.0"]]
