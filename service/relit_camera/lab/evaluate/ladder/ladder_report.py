"""The ladder's figures as text, JSON and an HTML report with contact sheets."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from relit_camera.base.images.contact_sheet import contact_sheet
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.lab.evaluate.ladder.ladder_evaluation import RoomPictures, RoomResult, RungFigures
from relit_camera.lab.evaluate.ladder.ladder_rungs import RUNGS, TINT
from relit_camera.lab.evaluate.report.html_page import (
    Better,
    Block,
    Figure,
    Heading,
    Paragraph,
    picture,
    render_page,
    table,
)

CELL_PX = 180
"""Width of one picture on a sheet."""
TINT_SUMMARY = "the webcam's picture times one color, by which the person's mean color becomes the truth's"


@dataclass(frozen=True)
class RoomFigures:
    """The figures of one person in one room, and their sheet for the page.

    Attributes:
        person, room: names.
        figures: by rung, lowest first.
        sheet: how the rungs look.
    """

    person: str
    room: str
    figures: Mapping[str, RungFigures]
    sheet: Figure


def room_figures(result: RoomResult, sheet: DisplayImage) -> RoomFigures:
    """What the page keeps of a result, with the sheet that `room_sheet` makes of it."""
    caption = f"{result.person}, live in {result.room}: the truth, then the live picture in the light of each column."
    return RoomFigures(result.person, result.room, result.figures, picture(sheet, caption, lossless=False))


def room_sheet(pictures: RoomPictures, room: str) -> DisplayImage:
    """The truth and every rung in rows, under each environment but the room, over black; uint8 sRGB."""
    matte = pictures.matte[..., None]

    def cut_out(picture: DisplayImage | None) -> DisplayImage | None:
        return None if picture is None else np.asarray(np.rint(picture * matte), np.uint8)

    columns = [name for name in pictures.truths if name != room]
    rows: list[list[DisplayImage | None]] = [[pictures.live, *(pictures.truths[name] for name in columns)]]
    rows += [[None, *(cut_out(relit.get(name)) for name in columns)] for relit in pictures.relit.values()]
    return contact_sheet(rows, ["truth", *pictures.relit], [f"live: {room}", *columns], CELL_PX)


def ladder_json(rooms: Sequence[RoomFigures]) -> dict[str, object]:
    """The figures: person → room → rung, and means over rooms and people."""
    people: dict[str, dict[str, object]] = {}
    for each in rooms:
        people.setdefault(each.person, {})[each.room] = {
            name: _figures_json(figures) for name, figures in each.figures.items()
        }
    means = {
        name: {
            "ratio_db_by_room": {room: _finite(value) for room, value in _by_room(rooms, name).items()},
            "ratio_db": _finite(_mean(_ratios(rooms, name))),
            "inner_ratio_db": _finite(_inner(rooms, name)),
            "field_db": _finite(_mean(_fields(rooms, name))),
            "white_balanced_field_db": _finite(_mean(_fields(rooms, name, white_balanced=True))),
        }
        for name in _names(rooms)
    }
    return {"people": people, "means": means}


def ladder_text(rooms: Sequence[RoomFigures]) -> str:
    """A table a person: ratio by room, and the field."""
    lines = ["ratio: dB of the displayed picture by the room that the person sits in; field: linear dB"]
    for person in dict.fromkeys(each.person for each in rooms):
        chosen = [each for each in rooms if each.person == person]
        head = [*(each.room[:12] for each in chosen), "mean", "inner", "EV off", "field", "balanced"]
        lines.append(f"{person:<10}" + "".join(f"{name:>13}" for name in head))
        for rung in _names(chosen):
            values = [*_ratios(chosen, rung), _mean(_ratios(chosen, rung)), _inner(chosen, rung), _ev_off(chosen, rung)]
            values += [_mean(_fields(chosen, rung)), _mean(_fields(chosen, rung, white_balanced=True))]
            lines.append(f"  {rung:<8}" + "".join(f"{_number(value):>13}" for value in values))
            lines += [f"    {each.room}: {each.figures[rung].failure}" for each in chosen if each.figures[rung].failure]
    return "\n".join(lines)


def ladder_page(rooms: Sequence[RoomFigures]) -> str:
    """The HTML document."""
    return render_page("Instant, desk and film", _blocks(rooms))


def _blocks(rooms: Sequence[RoomFigures]) -> Iterator[Block]:
    summaries = {TINT: TINT_SUMMARY, **{name: rung.summary for name, rung in RUNGS.items()}}
    yield Paragraph(
        "People whose reflectance field is known sit before a simulated webcam in a room. Each rung makes a subject of "
        "them; with it, mode live estimates the room's light and takes the live picture into other light. "
        + " ".join(f"{name}: {summaries[name]}." for name in _names(rooms))
    )
    order = list(dict.fromkeys(each.room for each in rooms))
    means = [
        [name, *(_by_room(rooms, name).get(room, float("nan")) for room in order), _mean(_ratios(rooms, name))]
        for name in _names(rooms)
    ]
    yield table(
        ["rung", *order, "mean"],
        means,
        "Ratio: mean PSNR in dB over people and environments of what is displayed, with one gain, inside the matte, by "
        "the room that the person sits in. Larger is better.",
        better="larger",
    )
    for person in dict.fromkeys(each.person for each in rooms):
        chosen = [each for each in rooms if each.person == person]
        yield Heading(person)
        larger: list[Better | None] = ["larger"] * (len(chosen) + 2)
        yield table(
            ["rung", *(each.room for each in chosen), "mean", "well inside", "EV off", "field", "white balanced"],
            [
                [
                    name,
                    *_ratios(chosen, name),
                    _mean(_ratios(chosen, name)),
                    _inner(chosen, name),
                    _ev_off(chosen, name),
                    _mean(_fields(chosen, name)),
                    _mean(_fields(chosen, name, white_balanced=True)),
                ]
                for name in _names(chosen)
            ],
            "Ratio in dB by room; their mean; the same of pixels well inside the person; how far the pictures' "
            "brightness is off before that gain, RMS over rooms, in stops. Field: mean PSNR in linear "
            "light under all environments, of the subject's own pictures, as they are and with one gain a channel.",
            better=[None, *larger, "smaller", "larger", "larger"],
        )
        for each in chosen:
            failures = [f"{name}: {figures.failure}." for name, figures in each.figures.items() if figures.failure]
            if failures:
                yield Paragraph(f"In {each.room} " + " ".join(failures))
            yield each.sheet


def _figures_json(figures: RungFigures) -> dict[str, object]:
    field = figures.field
    return {
        "ratio_db": dict(figures.ratio_db),
        "inner_ratio_db": dict(figures.inner_db),
        "mean_ratio_db": _finite(figures.mean_ratio_db),
        "field_db": None if field is None else field.as_is_db.tolist(),
        "white_balanced_field_db": None if field is None else field.white_balanced_db.tolist(),
        "brightness_ev": figures.brightness_ev,
        "residual": figures.residual,
        "build_s": figures.build_s,
        "failure": figures.failure or None,
    }


def _names(rooms: Sequence[RoomFigures]) -> list[str]:
    return list(dict.fromkeys(name for each in rooms for name in each.figures))


def _ratios(rooms: Sequence[RoomFigures], rung: str) -> list[float]:
    return [each.figures[rung].mean_ratio_db for each in rooms if rung in each.figures]


def _by_room(rooms: Sequence[RoomFigures], rung: str) -> dict[str, float]:
    by_room: dict[str, list[float]] = {}
    for each in rooms:
        if rung in each.figures:
            by_room.setdefault(each.room, []).append(each.figures[rung].mean_ratio_db)
    return {room: _mean(values) for room, values in by_room.items()}


def _inner(rooms: Sequence[RoomFigures], rung: str) -> float:
    return _mean([each.figures[rung].mean_inner_db for each in rooms if rung in each.figures])


def _ev_off(rooms: Sequence[RoomFigures], rung: str) -> float:
    found = [each.figures[rung].brightness_ev for each in rooms if rung in each.figures]
    known = [value**2 for value in found if value is not None]
    return float(np.sqrt(np.mean(known))) if known else float("nan")


def _fields(rooms: Sequence[RoomFigures], rung: str, white_balanced: bool = False) -> list[float]:
    fields = [each.figures[rung].field for each in rooms if rung in each.figures]
    return [
        float((field.white_balanced_db if white_balanced else field.as_is_db).mean())
        for field in fields
        if field is not None
    ]


def _mean(values: Sequence[float]) -> float:
    """Mean of those that are numbers; NaN of none."""
    known = [value for value in values if np.isfinite(value)]
    return float(np.mean(known)) if known else float("nan")


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None


def _number(value: float) -> str:
    return f"{value:.1f}" if np.isfinite(value) else "-"
