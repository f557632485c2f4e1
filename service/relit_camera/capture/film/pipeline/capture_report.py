"""What the chain found in a video, and the report that tells it."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relit_camera.capture.film.flash.frame_classification import FrameClass
from relit_camera.capture.film.focal_length import TAG_ERROR
from relit_camera.capture.film.lamp.flash_strength import FlashStrengths
from relit_camera.capture.film.lamp.head_crop import HeadCrop
from relit_camera.capture.film.pipeline.ball_observations import ObservedBall
from relit_camera.capture.film.pipeline.capture_options import CaptureOptions
from relit_camera.capture.film.pipeline.film_analysis import FilmAnalysis
from relit_camera.capture.film.pipeline.lamp_localization import UsableLamps

REPORT_VERSION = 1

_DOUBTFUL_BALL = 0.7
"""Share of the ball's outline that shows, below which its place is uncertain."""
_FEW_LOCATED = 0.5
"""Share of the usable frames in which two balls show the lamp, below which they hardly tell its distance."""
_DISAGREE_DEG = 1.5
"""Gap between two balls' rays that is thrice what their errors make."""
_UNLIKE_REASON = "its light does not fit the person's shape: the lamp was hidden, or its mirror image mistaken"


@dataclass(frozen=True, eq=False)
class Findings:
    """All that the chain found.

    Attributes:
        video: file name.
        options: what was asked for.
        analysis: what the video shows.
        lamps: where the lamp was in the usable frames.
        kept: growing indices of those frames that were read as pictures: of a long film's not all are needed.
        square: what was cut out.
        room_taken_off: whether the room's light was.
        strengths: of the kept frames' flashes.
        misfit_if_far: how far skin would be from the law of the cosine if the lamp were far away.
        good: (some,) which of those were used.
        lights: pictures left after those under nearly the same light were merged.
    """

    video: str
    options: CaptureOptions
    analysis: FilmAnalysis
    lamps: UsableLamps
    kept: NDArray[np.intp]
    square: HeadCrop
    room_taken_off: bool
    strengths: FlashStrengths
    misfit_if_far: float
    good: NDArray[np.intp]
    lights: int

    @property
    def warnings(self) -> list[str]:
        """What may have made the result worse, and what to do about it."""
        analysis, told = self.analysis, []
        for ball, name, option in zip(
            analysis.balls, ("ball", "second ball"), ("--ball", "--second-ball"), strict=False
        ):
            if ball.found.evidence is not None and ball.found.evidence < _DOUBTFUL_BALL:
                told.append(
                    f"only {ball.found.evidence:.0%} of the {name}'s outline shows, directions may be degrees off: "
                    f"film it before something plain, or give its circle with {option} X,Y,RADIUS"
                )
            told += [
                f"the {name} was {each.kind} in the frames {each.first} to {each.last}: fix it in its place"
                for each in ball.episodes
            ]
        if analysis.focal.error > TAG_ERROR:
            told.append(
                f"the camera's focal length is a guess, give or take {analysis.focal.error:.0%}, directions may be "
                "degrees off: give it with --focal-px, or film with a phone that writes it into the film"
            )
        told += self._of_two_balls()
        if analysis.gains.too_dim:
            told.append(
                "the room is too dark, or too bright, in nearly all of the picture, so that it does not tell what the "
                "camera's automatics did: make some light in it, or film with exposure and white balance locked"
            )
        elif not analysis.gains.share:
            told.append(
                "the flash reaches everything in the picture, so that the camera's automatics are known only between "
                "flashes: film before something far away, or with exposure and white balance locked"
            )
        if not analysis.detector:
            told.append("no face detector is installed, the head's size is a guess: run `relit models pull`")
        elif analysis.eyes_px is None:
            told.append(
                "the eyes are not found, the head's size is a guess from the face's circle: look into the camera, and "
                "begin with the lamp before the face; or give the face, brow to chin, with --face X,Y,RADIUS"
            )
        return told

    def report(self) -> dict[str, Any]:
        """The report of `relit capture build`; docs/capture.md tells what is in it."""
        analysis = self.analysis
        return {
            "version": REPORT_VERSION,
            "video": self.video,
            "width_px": analysis.size[0],
            "height_px": analysis.size[1],
            "focal_px": analysis.focal.pixels,
            "focal": {"source": analysis.focal.source, "error": analysis.focal.error},
            **{name: self._ball(ball) for name, ball in zip(("ball", "second_ball"), analysis.balls, strict=False)},
            "flash": {
                "frequency_hz": analysis.flashes.schedule.frequency_hz,
                "duty": analysis.flashes.schedule.duty,
                "exposure_s": analysis.flashes.shutter.exposure_s,
                "readout_s": analysis.flashes.shutter.readout_s,
            },
            "face": {
                **analysis.motion.circle._asdict(),
                "found_by": analysis.face.by,
                "eyes_px": analysis.eyes_px,
                "head_cm": _numbers(self.lamps.place.head_cm),
                "pixels_per_cm": self.lamps.place.pixels_per_cm,
            },
            "motion": {"reference": analysis.motion.reference, "unsteady_px": analysis.motion.unsteady_px},
            "room": {
                "taken_off": self.room_taken_off,
                "left_as_is": analysis.gains.left_as_is,
                "left": analysis.gains.left,
                "gains_from": analysis.gains.source,
                "gains_share": analysis.gains.share,
                "gains_spread": analysis.gains.spread,
            },
            "near_field": {
                "corrected": self.options.near_field,
                "light_distance_cm": self.options.light_distance_cm,
                "misfit": float(np.median(self.strengths.misfit[self.good])),
                "misfit_if_far": self.misfit_if_far,
            },
            "lamp_distance": self._lamp_distance(),
            "light": {"area_sr": self.lamps.area_sr, "frames": len(self.good), "lights": self.lights},
            "square": {
                "left": self.square.left,
                "top": self.square.top,
                "side": self.square.side,
                "size": self.square.size,
            },
            "warnings": self.warnings,
            "frames": [self._frame(index) for index in range(len(analysis.flashes.frames))],
        }

    def _of_two_balls(self) -> list[str]:
        """Warnings of what two balls tell of the lamp's distance."""
        if len(self.analysis.balls) == 1:
            return []
        told, share = [], len(self.lamps.located) / max(len(self.lamps.index), 1)
        if share < _FEW_LOCATED:
            told.append(
                f"both balls show the lamp in {share:.0%} of the flashes' frames only, its distance is uncertain in "
                "the others: stand them on either side of the head, where lamp and camera see both"
            )
        if self.lamps.located and self._gap_deg > _DISAGREE_DEG:
            told.append(
                f"the two balls disagree about the lamp by {self._gap_deg:.1f} degrees, its distance may be far off: "
                "use balls of one size, and give the camera's focal length with --focal-px"
            )
        return told

    @property
    def _gap_deg(self) -> float:
        return float(np.median([each.gap_deg for each in self.lamps.located.values()]))

    def _lamp_distance(self) -> dict[str, Any]:
        told: dict[str, Any] = {"median_cm": float(np.median(self.lamps.distances.cm))}
        if len(self.analysis.balls) == 1:
            return {"source": "said"} | told
        located = {"frames": len(self.lamps.located), "gap_deg": self._gap_deg if self.lamps.located else None}
        return {"source": "two balls"} | told | {"error": float(np.median(self.lamps.distances.error))} | located

    def _ball(self, ball: ObservedBall) -> dict[str, Any]:
        return {
            **asdict(ball.found.outline),
            "radius_cm": self.lamps.place.ball_radius_cm,
            "evidence": ball.found.evidence,
            "glints": ball.found.glints,
            "episodes": [
                {"kind": each.kind, "first": each.first, "last": each.last, "shift_px": [each.dx, each.dy]}
                for each in ball.episodes
            ],
        }

    def _frame(self, index: int) -> dict[str, Any]:
        analysis = self.analysis
        frame, motion = analysis.flashes.frames[index], analysis.motion.transforms[index]
        told: dict[str, Any] = {
            "index": index,
            "time_s": frame.time_s,
            "kind": frame.kind.value,
            "reason": frame.reason,
        }
        if index in analysis.motion.lost:
            rejected = frame.kind is FrameClass.BRIGHT
            return told | {
                "kind": FrameClass.REJECTED.value if rejected else told["kind"],
                "reason": "the face is not found",
            }
        told |= {"rotation_deg": motion.rotation_deg, "translation_px": [motion.x, motion.y]}
        if index in self._gain:
            told["gain"] = _numbers(self._gain[index])
        if index in self.lamps.unusable:
            return told | {"kind": FrameClass.REJECTED.value, "reason": self.lamps.unusable[index]}
        if index in self._place:
            place = self._place[index]
            told |= {
                "direction": _numbers(self.lamps.directions[place]),
                "at_ball": _numbers(self.lamps.at_ball[place]),
                "distance_cm": round(float(self.lamps.distances.cm[place]), 2),
            }
        if index in self._kept:
            kept = self._kept[index]
            told["strength"] = float(self.strengths.strength[kept])
            if kept not in self.good:
                told |= {"kind": FrameClass.REJECTED.value, "reason": _UNLIKE_REASON}
        return told

    @cached_property
    def _gain(self) -> dict[int, NDArray[np.float64]]:
        return dict(zip(self.analysis.frames.tolist(), self.analysis.gains.rgb, strict=True))

    @cached_property
    def _place(self) -> dict[int, int]:
        return {int(index): place for place, index in enumerate(self.lamps.index)}

    @cached_property
    def _kept(self) -> dict[int, int]:
        return {int(index): place for place, index in enumerate(self.kept)}


def _numbers(vector: NDArray) -> list[float]:
    return [round(float(value), 6) for value in vector]
