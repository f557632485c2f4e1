"""A report as one HTML file: pictures embedded, nothing loaded from anywhere.

Small line charts as inline SVG, for reports that need no other file.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Callable, Iterable, Mapping, Sequence
from html import escape

import numpy as np
from numpy.typing import ArrayLike

from relit_camera import __version__
from relit_camera.base.images.image_files import encode_display
from relit_camera.base.images.image_types import DisplayImage

_STYLE = """
body{font:16px/1.5 system-ui,sans-serif;color:#1a1a1a;background:#fff;max-width:1080px;margin:2em auto;padding:0 1em}
h1{font-size:1.6em}h2{font-size:1.25em;margin-top:2em;border-top:1px solid #ddd;padding-top:1em}
figure{margin:1.2em 0}figure img{max-width:100%;display:block}
figcaption{color:#444;font-size:.92em;max-width:62em;padding:.4em 0}
table{border-collapse:collapse;font-size:.92em}
td,th{padding:.3em .7em;border-bottom:1px solid #e3e3e3;text-align:right}
td:first-child,th:first-child{text-align:left}
svg{font:12px system-ui,sans-serif;max-width:100%}.legend span{margin-right:1.2em}
.scroll{overflow-x:auto}
"""


def picture(image: DisplayImage, caption: str, *, exact: bool = True) -> str:
    """A figure of a uint8 sRGB picture: as PNG, or as a good JPEG where it need not be `exact`."""
    suffix = ".png" if exact else ".jpg"
    data = b64encode(encode_display(image, suffix, 93)).decode()
    kind = "png" if exact else "jpeg"
    return _figure(f'<img alt="" src="data:image/{kind};base64,{data}">', caption)


def chart(svg: str, caption: str) -> str:
    """A figure of an inline SVG."""
    return _figure(svg, caption)


def _figure(content: str, caption: str) -> str:
    return f"<figure>{content}<figcaption>{escape(caption)}</figcaption></figure>"


def table(head: Sequence[str], rows: Sequence[Sequence[object]], caption: str, digits: int = 2) -> str:
    """A table; the first column holds names, numbers have so many digits after the point."""

    def cell(value: object) -> str:
        return f"{value:.{digits}f}" if isinstance(value, float) else escape(str(value))

    top = "".join(f"<th>{escape(name)}</th>" for name in head)
    body = "".join("<tr>" + "".join(f"<td>{cell(value)}</td>" for value in row) + "</tr>" for row in rows)
    return _figure(
        f'<div class="scroll"><table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table></div>', caption
    )


def heading(text: str) -> str:
    """Begin a section."""
    return f"<h2>{escape(text)}</h2>"


def paragraph(text: str) -> str:
    """A paragraph of plain text."""
    return f"<p>{escape(text)}</p>"


def page(title: str, blocks: Iterable[str]) -> str:
    """The whole document."""
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title>'
        f'<meta name="viewport" content="width=device-width"><style>{_STYLE}</style></head>'
        f"<body><h1>{escape(title)}</h1>{''.join(blocks)}<p>Made by relit-camera {__version__}.</p></body></html>\n"
    )


SERIES_COLORS = (
    "#111111",
    "#d1495b",
    "#00798c",
    "#edae49",
    "#66518f",
    "#30638e",
    "#8f5d2b",
    "#3c8d40",
    "#b0578d",
    "#777777",
)
_WIDTH, _HEIGHT = 620, 260
_LEFT, _RIGHT, _TOP, _BOTTOM = 62, 12, 14, 46


def line_chart(x: ArrayLike, series: Mapping[str, ArrayLike], x_label: str, y_label: str) -> str:
    """An SVG element: one line a series over common x values (count,), zero on the y axis; the legend is below.

    Values that are not finite leave a gap.
    """
    across = np.asarray(x, np.float64)
    lines = {name: np.asarray(values, np.float64) for name, values in series.items()}
    finite = np.concatenate([values[np.isfinite(values)] for values in lines.values()] or [np.zeros(1)])
    bottom, top = min(0.0, float(finite.min(initial=0))), max(float(finite.max(initial=0)), 1e-12)
    left, right = float(across.min()), float(across.max())

    def place(value_x: float, value_y: float) -> tuple[float, float]:
        share_x = (value_x - left) / max(right - left, 1e-12)
        share_y = (value_y - bottom) / (top - bottom)
        return _LEFT + share_x * (_WIDTH - _LEFT - _RIGHT), _HEIGHT - _BOTTOM - share_y * (_HEIGHT - _TOP - _BOTTOM)

    parts = []
    for tick in _ticks(bottom, top):
        y = place(left, tick)[1]
        parts.append(f'<path d="M{_LEFT} {y:.1f}H{_WIDTH - _RIGHT}" stroke="#ddd"/>')
        parts.append(f'<text x="{_LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{tick:g}</text>')
    under = _HEIGHT - _BOTTOM + 16
    for tick in _ticks(left, right):
        x = place(tick, bottom)[0]
        parts.append(f'<text x="{x:.1f}" y="{under}" text-anchor="middle">{tick:g}</text>')
    for colour, values in zip(_series_colors(len(lines)), lines.values(), strict=True):
        parts.append(f'<path d="{_path(across, values, place)}" fill="none" stroke="{colour}" stroke-width="1.8"/>')
    middle = (_TOP + _HEIGHT - _BOTTOM) / 2
    parts.append(f'<text x="{(_LEFT + _WIDTH) / 2}" y="{_HEIGHT - 8}" text-anchor="middle">{escape(x_label)}</text>')
    parts.append(
        f'<text x="14" y="{middle}" text-anchor="middle" transform="rotate(-90 14 {middle})">{escape(y_label)}</text>'
    )
    legend = " ".join(
        f'<span><b style="color:{colour}">━</b> {escape(name)}</span>'
        for colour, name in zip(_series_colors(len(lines)), lines, strict=True)
    )
    return (
        f'<svg viewBox="0 0 {_WIDTH} {_HEIGHT}" width="{_WIDTH}" role="img">{"".join(parts)}</svg>'
        f'<div class="legend">{legend}</div>'
    )


def _path(across: np.ndarray, values: np.ndarray, place: Callable[[float, float], tuple[float, float]]) -> str:
    commands, drawing = [], False
    for x, y in zip(across.tolist(), values.tolist(), strict=True):
        if not np.isfinite(y):
            drawing = False
            continue
        shown_x, shown_y = place(x, y)
        commands.append(f"{'L' if drawing else 'M'}{shown_x:.1f} {shown_y:.1f}")
        drawing = True
    return "".join(commands)


def _series_colors(count: int) -> Sequence[str]:
    return [SERIES_COLORS[index % len(SERIES_COLORS)] for index in range(count)]


def _ticks(low: float, high: float) -> list[float]:
    """Round numbers (about five) between low and high."""
    rough = (high - low) / 5
    power = 10 ** np.floor(np.log10(rough)) if rough > 0 else 1.0
    step = next(float(power * each) for each in (1, 2, 5, 10) if power * each >= rough * 0.999)
    first = int(np.ceil(low / step - 1e-9))
    return [round(index * step, 12) for index in range(first, int(np.floor(high / step + 1e-9)) + 1)]
