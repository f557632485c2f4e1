"""Small line charts as inline SVG, for reports that need no other file."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from html import escape

import numpy as np
from numpy.typing import ArrayLike

COLOURS = ("#111111", "#d1495b", "#00798c", "#edae49", "#66518f", "#30638e", "#8f5d2b", "#3c8d40", "#b0578d", "#777777")
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
    for colour, values in zip(_colours(len(lines)), lines.values(), strict=True):
        parts.append(f'<path d="{_path(across, values, place)}" fill="none" stroke="{colour}" stroke-width="1.8"/>')
    middle = (_TOP + _HEIGHT - _BOTTOM) / 2
    parts.append(f'<text x="{(_LEFT + _WIDTH) / 2}" y="{_HEIGHT - 8}" text-anchor="middle">{escape(x_label)}</text>')
    parts.append(
        f'<text x="14" y="{middle}" text-anchor="middle" transform="rotate(-90 14 {middle})">{escape(y_label)}</text>'
    )
    legend = " ".join(
        f'<span><b style="color:{colour}">━</b> {escape(name)}</span>'
        for colour, name in zip(_colours(len(lines)), lines, strict=True)
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


def _colours(count: int) -> Sequence[str]:
    return [COLOURS[index % len(COLOURS)] for index in range(count)]


def _ticks(low: float, high: float) -> list[float]:
    """Round numbers (about five) between low and high."""
    rough = (high - low) / 5
    power = 10 ** np.floor(np.log10(rough)) if rough > 0 else 1.0
    step = next(float(power * each) for each in (1, 2, 5, 10) if power * each >= rough * 0.999)
    first = int(np.ceil(low / step - 1e-9))
    return [round(index * step, 12) for index in range(first, int(np.floor(high / step + 1e-9)) + 1)]
