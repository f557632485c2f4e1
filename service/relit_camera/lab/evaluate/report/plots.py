"""Plots for HTML reports, drawn with matplotlib: lines, heat maps, directions of light, marked pixels.

matplotlib comes with the optional extra `evaluate`, and is imported only when a plot is drawn. Plots are drawn on
figures of their own, never through pyplot's global state.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from io import BytesIO
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from relit_camera.base.images.image_types import DisplayImage
from relit_camera.lab.evaluate.report.html_page import Figure, data_uri

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

REFERENCE = "truth"
"""Name of the series that is drawn in black and above the others."""

_SERIES_COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#7a5195")
"""Colors that people with color-vision deficiency tell apart (Okabe and Ito 2008), but for yellow."""
_LINE_STYLES: tuple[Literal["-", "--", ":", "-."], ...] = ("-", "--", ":", "-.")
"""Each next one begins when the colors are used up."""
_MARKED_POINTS = 80
"""Largest number of points of a line at which each point is marked."""
_LEGEND_COLUMN_FROM = 6
"""Number of series from which the legend is a column beside the plot."""
_UNKNOWN_COLOR = "#56606e"
"""Where a heat map has no value."""
_RASTER_DPI = 110


def line_plot(
    x: ArrayLike,
    series: Mapping[str, ArrayLike],
    x_label: str,
    y_label: str,
    caption: str,
    *,
    from_zero: bool = False,
    logarithmic: bool = False,
    bounds: Mapping[str, ArrayLike] | None = None,
    bounds_label: str = "",
) -> Figure:
    """Figure of one line a series over common x values (count,), as SVG. Values that are not finite leave a gap.

    Args:
        x: values of the horizontal axis.
        series: name → values (count,).
        x_label: name of the horizontal axis.
        y_label: name of the vertical axis.
        caption: of the figure.
        from_zero: whether the vertical axis begins at zero.
        logarithmic: whether both axes are; the horizontal one is then marked at the x values.
        bounds: name of a series → values (count,), a dashed line in its color.
        bounds_label: what such a line is, for the legend.
    """
    from matplotlib.ticker import LogLocator

    across = np.asarray(x, np.float64)
    with _style():
        canvas = _canvas(10.2, 3.6)
        axes = canvas.add_subplot()
        others = [name for name in series if name != REFERENCE]
        for name, values in series.items():
            index = others.index(name) if name in others else -1
            axes.plot(
                across,
                np.asarray(values, np.float64),
                label=name,
                color=_SERIES_COLORS[index % len(_SERIES_COLORS)] if index >= 0 else "black",
                linestyle=_LINE_STYLES[index // len(_SERIES_COLORS) % len(_LINE_STYLES)] if index >= 0 else "-",
                linewidth=1.6 if index >= 0 else 2.2,
                marker="." if len(across) <= _MARKED_POINTS else "",
                zorder=2 if index >= 0 else 3,
            )
            if bounds and name in bounds:
                color, label = axes.lines[-1].get_color(), f"{name}: {bounds_label}"
                axes.plot(across, np.asarray(bounds[name], np.float64), "--", label=label, color=color, linewidth=1)
        axes.set_xlabel(x_label)
        axes.set_ylabel(y_label)
        axes.margins(x=0.01)
        if logarithmic:
            axes.set_xscale("log")
            axes.set_yscale("log")
            axes.set_xticks(across, [f"{each:.0f}" for each in across])
            axes.minorticks_off()
            axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
            axes.yaxis.set_major_formatter("{x:g}")
        if from_zero:
            axes.set_ylim(bottom=0)
        if len(axes.lines) >= _LEGEND_COLUMN_FROM:
            axes.legend(loc="center left", bbox_to_anchor=(1, 0.5))
        elif len(series) > 1:
            axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1), ncols=len(series))
        return _figure(canvas, caption, "svg")


def heat_maps(
    values: Sequence[NDArray[np.floating]],
    names: Sequence[str],
    top: float,
    caption: str,
    *,
    columns: int,
    color_label: str,
    light_map: bool = False,
) -> Figure:
    """Figure of arrays (height, width) of one shape as colors: black is 0, pale yellow `top` and above, gray is NaN.

    Args:
        values: what is shown.
        names: one a map.
        top: end of the common color scale.
        caption: of the figure.
        columns: maps side by side.
        color_label: what the color scale measures.
        light_map: whether the arrays are light maps; their axes then name the directions.
    """
    cell = 9.6 / columns
    columns = min(columns, len(values))
    rows = math.ceil(len(values) / columns)
    height, width = values[0].shape
    from matplotlib import colormaps

    with _style():
        colors = colormaps["inferno"].with_extremes(bad=_UNKNOWN_COLOR)
        canvas = _canvas(cell * columns + 1, rows * (cell * height / width + (0.55 if light_map else 0.3)))
        grid = canvas.subplots(rows, columns, squeeze=False).ravel()
        for axes, shown, name in zip(grid, values, names, strict=False):
            known = np.ma.masked_invalid(shown)
            image = axes.imshow(known, cmap=colors, vmin=0, vmax=top or 1.0, interpolation="nearest")
            axes.set_title(name, fontsize=9.5)
            axes.grid(visible=False)
            if light_map:
                _name_directions(axes, height, width)
                axes.label_outer()
            else:
                axes.set_axis_off()
        for axes in grid[len(values) :]:
            axes.set_visible(False)
        canvas.colorbar(image, ax=grid.tolist(), shrink=0.7, aspect=30, label=color_label, extend="max")
        return _figure(canvas, caption, "png")


def light_directions(
    region: NDArray[np.bool_],
    captured: NDArray[np.float64],
    edges: Sequence[NDArray[np.float64]],
    added: NDArray[np.float64],
    caption: str,
) -> Figure:
    """Figure of the sphere of directions as a map, with what was captured of it.

    Args:
        region: (height, width) which texels lie in the sampled region.
        captured: (lights, 2) row and column of the captured lights.
        edges: lines (points, 2) of rows and columns that join captured lights.
        added: (lights, 2) row and column of black samples that a method adds.
        caption: of the figure.
    """
    height, width = region.shape
    with _style():
        canvas = _canvas(10.2, 5.0)
        axes = canvas.add_subplot()
        axes.imshow(np.where(region, 0.82, 0.95), cmap="gray", vmin=0, vmax=1, interpolation="nearest")
        for edge in edges:
            axes.plot(edge[:, 1], edge[:, 0], color="#8494a6", linewidth=0.7)
        axes.scatter(captured[:, 1], captured[:, 0], s=22, color="#009e73", zorder=3, label="captured")
        if len(added):
            axes.scatter(added[:, 1], added[:, 0], s=22, color="black", marker="x", zorder=3, label="added as black")
        axes.set_xlim(-0.5, width - 0.5)
        axes.set_ylim(height - 0.5, -0.5)
        axes.grid(visible=False)
        _name_directions(axes, height, width)
        axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1), ncols=2)
        return _figure(canvas, caption, "svg")


def marked_pixels(image: DisplayImage, marks: Mapping[str, tuple[int, int]], caption: str) -> Figure:
    """Figure of a uint8 sRGB picture with named pixels, given by column and row."""
    height, width = image.shape[:2]
    with _style():
        canvas = _canvas(5.2 * min(1.0, width / height), 5.2 * min(1.0, height / width))
        axes = canvas.add_subplot()
        axes.imshow(image, interpolation="nearest")
        axes.set_axis_off()
        for index, (name, (x, y)) in enumerate(marks.items()):
            color = _SERIES_COLORS[index % len(_SERIES_COLORS)]
            axes.plot(x, y, "o", markersize=8, markerfacecolor="none", markeredgewidth=2, color=color)
            axes.annotate(
                name,
                (x, y),
                (8, 0),
                textcoords="offset points",
                va="center",
                color="white",
                bbox={"boxstyle": "round,pad=0.25", "facecolor": color, "edgecolor": "none"},
            )
        return _figure(canvas, caption, "png")


def _style() -> AbstractContextManager[None]:
    """Context in which all plots are drawn alike."""
    from matplotlib import rc_context

    return rc_context(
        {
            "font.size": 9.5,
            "axes.edgecolor": "#9aa4b0",
            "axes.spines.right": False,
            "axes.spines.top": False,
            "axes.grid": True,
            "axes.axisbelow": True,
            "grid.color": "#e6eaee",
            "legend.frameon": False,
            "svg.hashsalt": "relit-camera",
        }
    )


def _canvas(width_inches: float, height_inches: float) -> Canvas:
    from matplotlib.figure import Figure as Canvas

    return Canvas(figsize=(width_inches, height_inches), layout="constrained")


def _figure(canvas: Canvas, caption: str, form: Literal["svg", "png"]) -> Figure:
    """The drawn canvas as a figure of the report; equal plots are equal bytes."""
    content = BytesIO()
    canvas.savefig(content, format=form, dpi=_RASTER_DPI, metadata={"Date": None} if form == "svg" else None)
    return Figure(data_uri(content.getvalue(), "image/svg+xml" if form == "svg" else "image/png"), caption)


def _name_directions(axes: Axes, height: int, width: int) -> None:
    """Name the directions along the axes of a light map, whose middle is the direction to the camera."""
    axes.set_xticks(
        [fraction * width - 0.5 for fraction in (0, 0.25, 0.5, 0.75, 1)],
        ["behind", "left", "camera", "right", "behind"],
    )
    axes.set_yticks([fraction * height - 0.5 for fraction in (0, 0.5, 1)], ["above", "level", "below"])
    axes.tick_params(length=2, labelsize=8)
