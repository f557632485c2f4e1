"""Evaluation of a reflectance field as HTML report, as text and as JSON."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np

from relit_camera.base.images.color import luminance, uint8_from_linear
from relit_camera.base.images.contact_sheet import contact_sheet
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.capture.reflectance.sampled_region import ring_directions
from relit_camera.lab.evaluate.field.candidates import BLACK_RING_METHOD
from relit_camera.lab.evaluate.field.field_evaluation import PROFILE_BINS, FieldReport, pixel_positions
from relit_camera.lab.evaluate.field.ghost_shadow_report import ghost_blocks
from relit_camera.lab.evaluate.field.ground_truth import sampled_region
from relit_camera.lab.evaluate.field.map_pictures import (
    map_pixels,
    reflectance_picture,
    triangle_edges,
    values_on_light_map,
)
from relit_camera.lab.evaluate.report.html_page import Block, Heading, Paragraph, picture, render_page, table
from relit_camera.lab.evaluate.report.plots import heat_maps, light_directions, line_plot, marked_pixels
from relit_camera.light.directions import texel_directions
from relit_camera.light.light_map import LightMap
from relit_camera.light.spherical_harmonics import coefficient_count, project, reconstruct

MAP_CAPTION = (
    "The map's middle is the direction from the face to the camera, its right is light from the picture's right, its "
    "top is light from above, both ends are light from behind."
)
REGION_SIZE = (160, 320)
"""Rows and columns of the map that shows the sampled region."""


def field_json(report: FieldReport) -> dict[str, object]:
    """The figures for JSON; errors are the thesis's measure of linear colors, unscaled."""
    return {
        "captured_lights": len(report.captured),
        "truth_lights": len(report.truth.directions),
        "truth_lights_in_region": int(report.in_region.sum()),
        "pixels": len(report.truth.inside),
        "truth": {"mid_tone_share": report.truth_mid_tones},
        "candidates": {
            each.name: {
                "error_whole": float(each.error_whole.mean()),
                "error_in_region": float(each.error_region.mean()),
                "sides_over_middle": report.sides_over_middle(each.error_whole),
                "light_psnr_db": each.light_psnr_db,
                "mid_tone_share": each.mid_tone_fraction,
                "environment_psnr_db": each.psnr_db,
                "environment_ssim": each.ssim,
                "environments": {n: {"psnr_db": r.psnr_db, "ssim": r.ssim} for n, r in each.relit.items()},
            }
            for each in report.candidate_scores
        },
        "harmonics": {
            name: {f"degree_{degree}_psnr_db": relit.psnr_db for degree, relit in by_degree.items()}
            for name, by_degree in report.harmonics.items()
        },
    }


def field_text(report: FieldReport) -> str:
    """A table of the most important figures as plain text."""
    lines = ["method                      error x1000: all  region   one light   environments   SSIM    mid-tones"]
    lines += [
        f"{each.name:<26} {each.error_whole.mean() * 1e3:17.3f} {each.error_region.mean() * 1e3:7.3f} "
        f"{each.light_psnr_db:8.2f} dB {each.psnr_db:11.2f} dB {each.ssim:7.4f} {each.mid_tone_fraction:9.1%}"
        for each in report.candidate_scores
    ]
    return "\n".join([*lines, f"{'truth':<26} {report.truth_mid_tones:64.1%}"])


def field_page(report: FieldReport, title: str) -> str:
    """The HTML document."""
    parts = (_summary, _directions, _heat_maps, _sides, _light_directions, _maps, ghost_blocks, _relit, _harmonics)
    return render_page(title, (block for part in parts for block in part(report)))


def _summary(report: FieldReport) -> Iterator[Block]:
    yield Paragraph(
        "A person was photographed (or rendered) under single lamps from some directions. From these pictures each "
        "method predicts the person under light from every other direction. The predictions are compared with pictures "
        f"that were taken under such light: {len(report.truth.directions)} directions, of which "
        f"{int(report.in_region.sum())} lie inside the region that the {len(report.captured)} captured lights span."
    )
    rows = [
        [
            each.name,
            each.error_whole.mean() * 1e3,
            each.error_region.mean() * 1e3,
            each.light_psnr_db,
            each.psnr_db,
            f"{each.ssim:.4f}",
            f"{each.mid_tone_fraction:.1%}",
        ]
        for each in report.candidate_scores
    ]
    head = ["method", "error ×10³, all", "in region", "one light, dB", "environments, dB", "SSIM", "ghost mid-tones"]
    yield table(
        head,
        rows,
        "Best first. Error: mean squared color distance of predicted and true reflectance maps, weighted by the cosine "
        "of the elevation, over all directions and over those inside the sampled region (smaller is better). One "
        "light: mean PSNR of the picture under a single lamp inside the region that was not captured. Environments: "
        "mean PSNR and SSIM of the picture under whole surroundings (larger is better). Ghost mid-tones: see 'Ghost "
        f"shadows'; in truth they are {report.truth_mid_tones:.1%}.",
        better=[None, "smaller", "smaller", "larger", "larger", None, None],
    )


def _directions(report: FieldReport) -> Iterator[Block]:
    yield Heading("Captured directions")
    ring = np.zeros((0, 3))
    if any(each.name == BLACK_RING_METHOD for each in report.candidate_scores):
        ring = ring_directions(report.captured)
    yield light_directions(
        sampled_region(report.captured, texel_directions(*REGION_SIZE).reshape(-1, 3)).reshape(REGION_SIZE),
        map_pixels(report.captured, REGION_SIZE),
        triangle_edges(report.captured, REGION_SIZE),
        map_pixels(ring, REGION_SIZE),
        "Green: captured lights, joined by triangles; methods interpolate between them, inside the darker region. "
        f"Crosses: black samples that the method '{BLACK_RING_METHOD}' adds, so that its prediction fades outside "
        "instead of ending. " + MAP_CAPTION,
    )


def _heat_maps(report: FieldReport) -> Iterator[Block]:
    yield Heading("Error by pixel")
    for kind, caption in (
        (
            "error_whole",
            "Error of each pixel's reflectance map, over light from all directions. Directions that were never sampled "
            "dominate; they show at the sides of the face, which light from the side and from behind reaches. The "
            "black ring lowers the error there.",
        ),
        (
            "error_region",
            "The same over light inside the sampled region only. What is left is the error of the interpolation "
            "itself, along the edges of shadows, which interpolation cannot move: beside the nose, in the eye sockets, "
            "under the chin.",
        ),
    ):
        values = [getattr(each, kind) for each in report.candidate_scores]
        top = float(np.median([np.percentile(each, 99.5) for each in values]))
        inside = report.truth.samples.matte > 0.5
        yield heat_maps(
            [np.where(inside, report.truth.picture(each), np.nan) for each in values],
            [each.name for each in report.candidate_scores],
            top,
            caption,
            columns=5,
            color_label="error",
        )


def _sides(report: FieldReport) -> Iterator[Block]:
    x = (np.arange(PROFILE_BINS) + 0.5) / PROFILE_BINS * 2 - 1
    lines = {each.name: report.across(each.error_whole) * 1e3 for each in report.candidate_scores}
    ratios = ", ".join(
        f"{each.name} {report.sides_over_middle(each.error_whole):.1f}" for each in report.candidate_scores
    )
    yield line_plot(
        x,
        lines,
        "position across the person: -1 left edge, 1 right edge",
        "error ×10³, all directions",
        "The same error from the left edge of the person to the right, averaged over the picture's rows. Where nothing "
        "is predicted outside of the sampled region the curves rise toward both sides, which light from the side and "
        f"from behind reaches. Outer sixths over middle third: {ratios}.",
        from_zero=True,
    )


def _light_directions(report: FieldReport) -> Iterator[Block]:
    yield Heading("Error by direction of light")
    values = [values_on_light_map(report.truth, each.error_of_light) for each in report.candidate_scores]
    yield heat_maps(
        values,
        [each.name for each in report.candidate_scores],
        float(np.nanpercentile(np.stack(values), 99.5)),
        "Mean error over the whole face for each direction of light. It is small where light was captured, rises a "
        "little between captured lights, and is large outside of the sampled region. " + MAP_CAPTION,
        columns=3,
        color_label="error",
        light_map=True,
    )


def _maps(report: FieldReport) -> Iterator[Block]:
    yield Heading("Reflectance maps")
    truth = report.truth
    frontal = truth.picture(truth.colors[int(truth.directions[:, 2].argmax())])
    peak = np.float32(np.percentile(frontal, 99) or 1.0)
    yield marked_pixels(
        uint8_from_linear(frontal / peak),
        {spot.name: (spot.x, spot.y) for spot in report.spots},
        "The pixels whose reflectance maps are shown below.",
    )
    columns: list[list[DisplayImage]] = []
    for index, place in enumerate(pixel_positions(report.spots, truth)):
        known = values_on_light_map(truth, truth.colors[:, place])
        white = float(np.nanpercentile(known, 99.5))
        shown = [reflectance_picture(each.maps[index].reshape(known.shape), white) for each in report.candidate_scores]
        columns.append([reflectance_picture(known, white), *shown])
    rows = list(zip(*columns, strict=True))
    names = [each.name for each in report.candidate_scores]
    yield picture(
        contact_sheet(rows, ["truth", *names], [spot.name for spot in report.spots], 185),
        "One map a pixel (column) and method (row): the color of that pixel under light from each direction. In truth "
        "(above) a map ends in a hard edge where another part of the face blocks the light, for example the nose at "
        "the side of the nose. Interpolation turns this edge into a slope, or into flat steps with the nearest light. "
        "Black beyond the captured lights: nothing is known there. " + MAP_CAPTION,
    )


def _relit(report: FieldReport) -> Iterator[Block]:
    yield Heading("Relit by environments")
    names = list(report.environments)
    rows = [[each.relit[name].picture for name in names] for each in report.candidate_scores]
    rows.append([report.candidate_scores[0].relit[name].truth for name in names])
    # The light comes last: every cell takes the shape of the first one, which must be the person's.
    rows.append([light_picture(report.environments[name]) for name in names])
    yield picture(
        contact_sheet(rows, [*(each.name for each in report.candidate_scores), "truth", "light"], names, 160),
        "The person under each environment by each method, then in truth, and the light itself in the last row. What "
        "differs most is light from the side and from behind: predictions are darker at the sides of the head and the "
        "hair, and lack the bright rim. Each column is scaled so that the brightest part of its truth is white. "
        + MAP_CAPTION,
        lossless=False,
    )
    figures = [
        [each.name, *(f"{each.relit[name].psnr_db:.1f} / {each.relit[name].ssim:.3f}" for name in names)]
        for each in report.candidate_scores
    ]
    yield table(["method", *names], figures, "PSNR in dB (linear light, inside the matte) / SSIM against the truth.")


def _harmonics(report: FieldReport) -> Iterator[Block]:
    yield Heading("Light through spherical harmonics")
    names = list(report.environments)
    degrees = list(next(iter(report.harmonics.values())))
    rows: list[list[DisplayImage]] = []
    for name in names:
        light_map = report.environments[name]
        peak = _white_level(light_map)
        lights = [light_map, *(reconstruct(project(light_map, degree)) for degree in degrees)]
        relit = report.harmonics[name]
        people = [relit[degrees[0]].truth, *(relit[degree].picture for degree in degrees)]
        rows.append([_light_above_person(reflectance_picture(a, peak), b) for a, b in zip(lights, people, strict=True)])
    columns = ["original", *(f"{coefficient_count(degree)} coefficients" for degree in degrees)]
    yield picture(
        contact_sheet(rows, names, columns, 210),
        "Learned relighting describes light by a few spherical harmonics, mostly 9. Each environment is projected onto "
        "them and reconstructed; below it the person under that light, from the true pictures, so that only the light "
        "differs. Small lamps become a soft glow, shadows and highlights soften, and colored lamps mix.",
        lossless=False,
    )
    figures = [[name, *(report.harmonics[name][degree].psnr_db for degree in degrees)] for name in names]
    yield table(["environment", *columns[1:]], figures, "PSNR in dB of the person under that light.", 1)


def light_picture(light_map: LightMap) -> DisplayImage:
    """Picture of a light map (32, 64, 3); its 98th percentile of luminance is white."""
    return reflectance_picture(light_map, _white_level(light_map))


def _white_level(light_map: LightMap) -> float:
    return float(np.percentile(luminance(light_map), 98)) or float(light_map.max())


def _light_above_person(light: DisplayImage, person: DisplayImage) -> DisplayImage:
    """A light map above the person it lights."""
    width = person.shape[1]
    above = cv2.resize(light, (width, width // 2), interpolation=cv2.INTER_NEAREST)
    return np.concatenate([np.asarray(above, np.uint8), person])
