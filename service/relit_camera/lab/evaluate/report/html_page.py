"""HTML reports: one self-contained file of headings, paragraphs, tables and figures, rendered from a Jinja2 template.

Jinja2 and matplotlib come with the optional extra `evaluate`. They are imported only when a page is rendered, so that
figures in JSON and in plain text need neither.
"""

from __future__ import annotations

import math
from base64 import b64decode, b64encode
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from typing import ClassVar, Literal

from relit_camera import __version__
from relit_camera.base.errors import InputError
from relit_camera.base.images.image_files import encode_display
from relit_camera.base.images.image_types import DisplayImage

REPORT_PACKAGES = ("jinja2", "matplotlib")
"""Modules of the extra `evaluate`."""
_JPEG_QUALITY = 93

Better = Literal["smaller", "larger"]
"""Which value of a table's column is the best one."""


@dataclass(frozen=True)
class Heading:
    """Begins a section.

    Attributes:
        text: plain text.
    """

    text: str
    kind: ClassVar[str] = "heading"


@dataclass(frozen=True)
class Paragraph:
    """A paragraph.

    Attributes:
        text: plain text.
    """

    text: str
    kind: ClassVar[str] = "paragraph"


@dataclass(frozen=True)
class Figure:
    """A picture or plot with its caption.

    Attributes:
        source: `data:` URI of the image.
        caption: plain text.
    """

    source: str
    caption: str
    kind: ClassVar[str] = "figure"


@dataclass(frozen=True)
class Cell:
    """One cell of a table.

    Attributes:
        text: plain text.
        best: whether it is the best value of its column.
    """

    text: str
    best: bool = False


@dataclass(frozen=True)
class Table:
    """A table with its caption.

    Attributes:
        head: names of the columns.
        rows: cells of each row; the first of a row names it.
        caption: plain text.
    """

    head: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    caption: str
    kind: ClassVar[str] = "table"


Block = Heading | Paragraph | Figure | Table


def require_report_packages() -> None:
    """Check that HTML reports can be made.

    Raises:
        InputError: a package of the extra `evaluate` is not installed.
    """
    missing = [name for name in REPORT_PACKAGES if find_spec(name) is None]
    if missing:
        raise InputError(
            f"HTML reports need {' and '.join(missing)}",
            "`relit doctor` says how to install that; or use --json without --out",
        )


def picture(image: DisplayImage, caption: str, *, lossless: bool = True) -> Figure:
    """Figure of a uint8 sRGB picture (height, width, 3): PNG, or JPEG unless it must be `lossless`."""
    suffix, media_type = (".png", "image/png") if lossless else (".jpg", "image/jpeg")
    return Figure(data_uri(encode_display(image, suffix, _JPEG_QUALITY), media_type), caption)


def data_uri(content: bytes, media_type: str) -> str:
    """`data:` URI of a file's content."""
    return f"data:{media_type};base64,{b64encode(content).decode()}"


def data_of_uri(uri: str) -> bytes:
    """The content of a `data_uri`."""
    return b64decode(uri.partition(",")[2])


def table(
    head: Sequence[str],
    rows: Sequence[Sequence[object]],
    caption: str,
    digits: int = 2,
    better: Better | Sequence[Better | None] | None = None,
) -> Table:
    """Table of values.

    Args:
        head: names of the columns.
        rows: values of each row; the first of a row names it. NaN is shown as a dash.
        caption: plain text.
        digits: of floating-point numbers, after the point.
        better: marks the best of each column's floating-point numbers: one answer for all columns, or one a column.
    """
    columns = better if isinstance(better, (list, tuple)) else [better] * len(head)
    best = [_best_value([row[index] for row in rows], which) for index, which in enumerate(columns)]
    cells = [
        [Cell(_cell_text(value, digits), best[index] is not None and value == best[index])
         for index, value in enumerate(row)] for row in rows
    ]  # fmt: skip
    return Table(head, cells, caption)


def render_page(title: str, blocks: Iterable[Block]) -> str:
    """The whole HTML document."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("relit_camera.lab.evaluate.report", ""),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    template = environment.get_template("report.html.j2")
    return template.render(title=title, blocks=list(blocks), version=__version__)


def _cell_text(value: object, digits: int) -> str:
    if isinstance(value, float):
        return "–" if math.isnan(value) else f"{value:.{digits}f}"
    return str(value)


def _best_value(values: Sequence[object], better: Better | None) -> float | None:
    """The best of a column's finite floating-point numbers; None where there are fewer than two."""
    numbers = [value for value in values if isinstance(value, float) and math.isfinite(value)]
    if better is None or len(numbers) < 2:
        return None
    return min(numbers) if better == "smaller" else max(numbers)
