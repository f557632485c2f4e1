"""HTML reports: escaping, tables, plots, and what is said without the packages that make them."""

from __future__ import annotations

import json
import math
import sys
from base64 import b64decode
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from relit_camera.base.errors import InputError
from relit_camera.base.images.image_files import decode_display
from relit_camera.lab.evaluate.report import html_page
from relit_camera.lab.evaluate.report.html_page import (
    Heading,
    Paragraph,
    picture,
    render_page,
    require_report_packages,
    table,
)
from relit_camera.lab.evaluate.report.plots import heat_maps, line_plot
from tests.cli.relit_command import call
from tests.lab.capture_documents import documents
from tests.lab.html_outline import Outline


def test_text_from_outside_is_escaped_everywhere() -> None:
    evil = "<script>alert(1)</script>"
    image = picture(np.zeros((2, 2, 3), np.uint8), evil)
    page = render_page(evil, [Heading(evil), Heading(evil), Paragraph(evil), table([evil], [[evil]], evil), image])
    outline = Outline()
    outline.feed(page)
    assert outline.fetched == outline.open == []
    assert "&lt;script&gt;" in page


def test_best_values_are_marked_and_missing_ones_are_dashes() -> None:
    rows = [["a", 1.0, 2.0, "x"], ["b", 3.0, math.nan, "y"], ["c", 2.0, 5.0, "z"]]
    made = table(["name", "low", "high", "text"], rows, "caption", 1, [None, "smaller", "larger", "larger"])
    assert [[cell.text for cell in row] for row in made.rows] == [
        ["a", "1.0", "2.0", "x"],
        ["b", "3.0", "–", "y"],
        ["c", "2.0", "5.0", "z"],
    ]
    assert [(i, j) for i, row in enumerate(made.rows) for j, cell in enumerate(row) if cell.best] == [(0, 1), (2, 2)]


def test_a_plot_is_an_image_that_is_the_same_each_time() -> None:
    x = np.arange(5)
    plots = [
        line_plot(x, {"truth": x, "<other>": [1.0, np.nan, 2.0, 3.0, 4.0]}, "frame", "a & b", "caption")
        for _ in range(2)
    ]
    assert plots[0] == plots[1]
    svg = b64decode(plots[0].source.partition(",")[2])
    assert ElementTree.fromstring(svg).tag.endswith("svg")
    assert b"script" not in svg


def test_a_heat_map_shows_zero_as_black_and_the_top_as_bright() -> None:
    values = [np.zeros((4, 4)), np.full((4, 4), 2.0)]
    figure = heat_maps(values, ["none", "much"], 2.0, "caption", columns=2, color_label="error")
    image = decode_display(b64decode(figure.source.partition(",")[2]), "heat map")
    row = image[image.shape[0] // 2]
    left, right = row[image.shape[1] // 5], row[image.shape[1] * 3 // 5]
    assert left.max() < 20
    assert right.min() > 120


def test_without_the_packages_a_report_is_refused_before_any_work(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(html_page, "find_spec", lambda name: None if name == "matplotlib" else object())
    with pytest.raises(InputError, match="need matplotlib; `relit doctor` says how"):
        require_report_packages()
    answer = call("evaluate", "video", "none.mp4", "--truth", "none.mp4", "--out", tmp_path / "page.html")
    answer.complains("matplotlib", "relit doctor")
    assert not list(tmp_path.iterdir())


def test_figures_need_none_of_the_packages(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for name in html_page.REPORT_PACKAGES:
        monkeypatch.setitem(sys.modules, name, None)
    for name, document in zip(("truth.json", "report.json"), documents(), strict=True):
        (tmp_path / name).write_text(json.dumps(document))
    answer = call("evaluate", "capture", tmp_path / "report.json", "--truth", tmp_path / "truth.json", "--json")
    assert json.loads(answer.out)["used_share"] == 1
    with pytest.raises(ImportError):
        render_page("title", [])
