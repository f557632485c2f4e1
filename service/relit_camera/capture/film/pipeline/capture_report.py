"""The report of a capture: results of all stages as JSON, and warnings of what may have made them worse."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relit_camera.capture.film.ball.ball_tracking import ObservedBall
from relit_camera.capture.film.face_localization import LocatedFace
from relit_camera.capture.film.flash.frame_classification import Flashes, FlashFrame, FrameClass
from relit_camera.capture.film.focal_length import TAG_ERROR, FocalLength
from relit_camera.capture.film.lamp.capture_layout import CaptureLayout
from relit_camera.capture.film.lamp.lamp_localization import LampPositions
from relit_camera.capture.film.lamp.light_coverage import covered_solid_angle
from relit_camera.capture.film.olat.camera_gains import FrameGains
from relit_camera.capture.film.olat.flash_strength import FlashStrengths
from relit_camera.capture.film.olat.head_crop import HeadCrop
from relit_camera.capture.film.pipeline.film_measurement import UsableFrames
from relit_camera.capture.film.stabilization.film_stabilization import Stabilization

REPORT_VERSION = 1


@dataclass(frozen=True)
class WarningTunables:
    """When the report warns; `relit evaluate capture` (docs/evaluate.md) shows what errors such films have.

    Attributes:
        min_evidence: fraction of a ball's outline that is visible, below which its position is uncertain.
        min_triangulated: fraction of the usable frames in which two balls show the lamp, below which its distance is
            uncertain.
        max_gap_deg: median gap between two balls' rays, three times what their errors make.
    """

    min_evidence: float = 0.7
    min_triangulated: float = 0.5
    max_gap_deg: float = 1.5


_TUNABLES = WarningTunables()
_OUTLIER_REASON = "its light does not fit the person's shape: the lamp was hidden, or its mirror image mistaken"


@dataclass(frozen=True, eq=False)
class CaptureFindings:
    """Results of all stages of a capture.

    Attributes:
        video: name of the film's file.
        size: width and height of its upright pictures.
        flashes: when the lamp was on, and the class of every frame.
        face: where the face was found.
        motion: how it moved.
        usable: bright and dark frames in which it was found.
        gains: the camera's, of `usable.all` in order.
        balls: the mirror balls, one or two.
        focal: focal length of the camera.
        detector_installed: whether a detector that finds the eyes is installed.
        eyes_px: distance of the pupils; None where they were not found.
        layout: positions of head and balls.
        lamps: where the lamp was in the frames that show it.
        light_distance_cm: distance of the lamp that the user gave.
        crop: the square that became the subject's picture.
        room_subtracted: whether the room's light was subtracted.
        near_field: whether the lamp's nearness was corrected.
        kept: growing indices of those frames of `lamps` that were read as pictures; of a long film, not all.
        strengths: of the flashes of the kept frames.
        misfit_if_far: median misfit of the strengths if the lamp were far away.
        good: (count,) rows of `kept` that were used.
        lights: number of pictures after merging.
        coda: index of the first frame after the flashes, where some seconds in constant light follow; else None.
    """

    video: str
    size: tuple[int, int]
    flashes: Flashes
    face: LocatedFace
    motion: Stabilization
    usable: UsableFrames
    gains: FrameGains
    balls: tuple[ObservedBall, ...]
    focal: FocalLength
    detector_installed: bool
    eyes_px: float | None
    layout: CaptureLayout
    lamps: LampPositions
    light_distance_cm: float
    crop: HeadCrop
    room_subtracted: bool
    near_field: bool
    kept: NDArray[np.intp]
    strengths: FlashStrengths
    misfit_if_far: float
    good: NDArray[np.intp]
    lights: int
    coda: int | None = None

    @property
    def warnings(self) -> list[str]:
        """What may have made the result worse, and what to do about it."""
        warnings = []
        for ball, name, option in zip(self.balls, ("ball", "second ball"), ("--ball", "--second-ball"), strict=False):
            warnings += _ball_warnings(ball, name, option)
        if self.focal.error > TAG_ERROR:
            warnings.append(
                f"the camera's focal length is a guess, give or take {self.focal.error:.0%}, directions may be "
                "degrees off: give it with --focal-px, or film with a phone that writes it into the film"
            )
        if len(self.balls) > 1:
            warnings += _two_ball_warnings(self.lamps)
        warnings += _gain_warnings(self.gains)
        if not self.detector_installed:
            warnings.append("no face detector is installed, the head's size is a guess: run `relit models pull`")
        elif self.eyes_px is None:
            warnings.append(
                "the eyes are not found, the head's size is a guess from the face's circle: look into the camera, and "
                "begin with the lamp before the face; or give the face, brow to chin, with --face X,Y,RADIUS"
            )
        return warnings

    def report(self) -> dict[str, Any]:
        """The JSON of `relit capture build --report`; docs/capture.md describes it."""
        names = ("ball", "second_ball")
        width, height = self.size
        return {
            "version": REPORT_VERSION,
            "video": self.video,
            "width_px": width,
            "height_px": height,
            "focal_px": self.focal.pixels,
            "focal": {"source": self.focal.source, "error": self.focal.error},
            **{
                name: _ball_entry(ball, self.layout.ball_radius_cm)
                for name, ball in zip(names, self.balls, strict=False)
            },
            "flash": _flash_entry(self.flashes),
            "face": {
                **self.motion.circle._asdict(),
                "found_by": self.face.by,
                "eyes_px": self.eyes_px,
                "head_cm": _numbers(self.layout.head_cm),
                "pixels_per_cm": self.layout.pixels_per_cm,
            },
            "motion": {"reference": self.motion.reference, "unsteady_px": self.motion.unsteady_px},
            "room": {"taken_off": self.room_subtracted} | _gain_entry(self.gains),
            "near_field": {
                "corrected": self.near_field,
                "light_distance_cm": self.light_distance_cm,
                "misfit": float(np.median(self.strengths.misfit[self.good])),
                "misfit_if_far": self.misfit_if_far,
            },
            "lamp_distance": _distance_entry(self.lamps, two_balls=len(self.balls) > 1),
            "light": {
                "area_sr": covered_solid_angle(self.lamps.lamps_cm),
                "frames": len(self.good),
                "lights": self.lights,
            },
            "square": {
                "left": self.crop.left,
                "top": self.crop.top,
                "side": self.crop.side,
                "size": self.crop.size,
            },
            "coda": self.coda,
            "warnings": self.warnings,
            "frames": [self._frame_entry(frame) for frame in self.flashes.frames],
        }

    def _frame_entry(self, frame: FlashFrame) -> dict[str, Any]:
        """Class, motion, gain, and lamp of one frame."""
        index, motion = frame.index, self.motion.transforms[frame.index]
        entry: dict[str, Any] = {
            "index": index,
            "time_s": frame.time_s,
            "kind": frame.kind.value,
            "reason": frame.reason,
        }
        if index in self.motion.lost:
            if frame.kind is FrameClass.BRIGHT:
                entry["kind"] = FrameClass.REJECTED.value
            return entry | {"reason": "the face is not found"}
        entry |= {"rotation_deg": motion.rotation_deg, "translation_px": [motion.x, motion.y]}
        if index in self._gain_by_frame:
            entry["gain"] = _numbers(self._gain_by_frame[index])
        if index in self.lamps.unusable:
            return entry | {"kind": FrameClass.REJECTED.value, "reason": self.lamps.unusable[index]}
        if index in self._lamp_row:
            entry |= _lamp_entry(self.lamps, self._lamp_row[index])
        if index in self._kept_row:
            row = self._kept_row[index]
            entry["strength"] = float(self.strengths.strength[row])
            if row not in self.good:
                entry |= {"kind": FrameClass.REJECTED.value, "reason": _OUTLIER_REASON}
        return entry

    @cached_property
    def _gain_by_frame(self) -> dict[int, NDArray[np.float64]]:
        return dict(zip(self.usable.all.tolist(), self.gains.rgb, strict=True))

    @cached_property
    def _lamp_row(self) -> dict[int, int]:
        return {int(index): row for row, index in enumerate(self.lamps.index)}

    @cached_property
    def _kept_row(self) -> dict[int, int]:
        return {int(index): row for row, index in enumerate(self.kept)}


def _ball_warnings(ball: ObservedBall, name: str, option: str) -> list[str]:
    warnings = []
    evidence = ball.found.evidence
    if evidence is not None and evidence < _TUNABLES.min_evidence:
        warnings.append(
            f"only {evidence:.0%} of the {name}'s outline shows, directions may be degrees off: "
            f"film it before something plain, or give its circle with {option} X,Y,RADIUS"
        )
    warnings += [
        f"the {name} was {each.kind} in the frames {each.first} to {each.last}: fix it in its place"
        for each in ball.episodes
    ]
    return warnings


def _two_ball_warnings(lamps: LampPositions) -> list[str]:
    warnings = []
    fraction = len(lamps.triangulated) / max(len(lamps.index), 1)
    if fraction < _TUNABLES.min_triangulated:
        warnings.append(
            f"both balls show the lamp in {fraction:.0%} of the flashes' frames only, its distance is uncertain in "
            "the others: stand them on either side of the head, where lamp and camera see both"
        )
    gap_deg = _median_gap_deg(lamps)
    if gap_deg is not None and gap_deg > _TUNABLES.max_gap_deg:
        warnings.append(
            f"the two balls disagree about the lamp by {gap_deg:.1f} degrees, its distance may be far off: "
            "use balls of one size, and give the camera's focal length with --focal-px"
        )
    return warnings


def _gain_warnings(gains: FrameGains) -> list[str]:
    if gains.too_dim:
        return [
            "the room is too dark, or too bright, in nearly all of the picture, so the camera's automatic exposure and "
            "white balance cannot be measured: make some light in it, or film with both locked"
        ]
    if not gains.fraction:
        return [
            "the flash reaches everything in the picture, so the camera's automatic exposure and white balance are "
            "measured only between flashes: film before something far away, or with both locked"
        ]
    return []


def _ball_entry(ball: ObservedBall, radius_cm: float) -> dict[str, Any]:
    return {
        **asdict(ball.found.outline),
        "radius_cm": radius_cm,
        "evidence": ball.found.evidence,
        "glints": ball.found.highlight_visibility,
        "episodes": [
            {"kind": each.kind, "first": each.first, "last": each.last, "shift_px": [each.dx, each.dy]}
            for each in ball.episodes
        ],
    }


def _flash_entry(flashes: Flashes) -> dict[str, Any]:
    schedule, shutter = flashes.schedule, flashes.shutter
    return {
        "frequency_hz": schedule.frequency_hz,
        "duty": schedule.duty,
        "exposure_s": shutter.exposure_s,
        "readout_s": shutter.readout_s,
    }


def _gain_entry(gains: FrameGains) -> dict[str, Any]:
    return {
        "left_as_is": gains.left_as_is,
        "left": gains.left,
        "gains_from": gains.source,
        "gains_share": gains.fraction,
        "gains_spread": gains.spread,
    }


def _distance_entry(lamps: LampPositions, *, two_balls: bool) -> dict[str, Any]:
    median_cm = float(np.median(lamps.distances.cm))
    if not two_balls:
        return {"source": "said", "median_cm": median_cm}
    return {
        "source": "two balls",
        "median_cm": median_cm,
        "error": float(np.median(lamps.distances.error)),
        "frames": len(lamps.triangulated),
        "gap_deg": _median_gap_deg(lamps),
    }


def _median_gap_deg(lamps: LampPositions) -> float | None:
    """Median angle between two balls' rays; None where no frame shows the lamp in both."""
    gaps = [each.gap_deg for each in lamps.triangulated.values()]
    return float(np.median(gaps)) if gaps else None


def _lamp_entry(lamps: LampPositions, row: int) -> dict[str, Any]:
    return {
        "direction": _numbers(lamps.directions[row]),
        "at_ball": _numbers(lamps.at_ball[row]),
        "distance_cm": round(float(lamps.distances.cm[row]), 2),
    }


def _numbers(vector: NDArray) -> list[float]:
    return [round(float(value), 6) for value in vector]
