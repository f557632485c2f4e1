"""Truth of a capture as JSON: all that a perfect `relit capture` would find, and the parameters of the simulation."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relit_studio.cameras.camera_simulation import Gains
from relit_studio.cameras.pinhole import Pinhole
from relit_studio.capture.ball.ball_reflection import highlight_px
from relit_studio.capture.ball.mirror_ball import MirrorBall
from relit_studio.capture.capture_scene import FrameState, Scene
from relit_studio.capture.flash.flash_timing import flash_state
from relit_studio.capture.flash.torch import BEAM_EXPONENT, RADIUS_CM, REFERENCE_CM
from relit_studio.capture.persons.captured_person import to_rest
from relit_studio.capture.phone import SENSOR, Stages

VERSION = 1


def capture_truth(scene: Scene, stages: Stages, video: str, room: str, seed: int, face: NDArray) -> dict[str, Any]:
    """Truth of the whole video. `face` are the face's surface points (count, 3) in camera axes."""
    camera = scene.camera
    return {
        "version": VERSION,
        "video": video,
        "person": scene.person.name,
        "room": room,
        "seed": seed,
        "width_px": camera.width,
        "height_px": camera.height,
        "focal_px": camera.focal_px,
        "head_origin_cm": _numbers(scene.person.origin),
        "face_centroid_cm": _numbers(face.mean(axis=0)),
        **{name: _ball(ball, camera) for name, ball in zip(("ball", "second_ball"), scene.balls, strict=False)},
        "torch": {
            "frequency_hz": scene.schedule.frequency_hz,
            "duty": scene.schedule.duty,
            "phase_s": scene.schedule.phase_s,
            "radius_cm": RADIUS_CM,
            "unit_irradiance_at_cm": REFERENCE_CM,
            "beam_exponent": BEAM_EXPONENT,
        },
        "shutter": {
            "fps": scene.timing.fps,
            "exposure_s": scene.timing.exposure_s,
            "readout_s": scene.timing.readout_s,
        },
        "sensor_value_of_white": SENSOR.white,
        "stages": asdict(stages),
        "credits": list(scene.person.credits),
    }


def frame_truth(scene: Scene, state: FrameState, gains: Gains, face: NDArray) -> dict[str, Any]:
    """Truth of one frame. `face` as in `capture_truth`."""
    torch, motion = state.torch, state.motion
    centroid = face.mean(axis=0)
    to_face = torch.position - centroid
    picture = to_rest(scene.person, face, motion)
    origin = scene.person.origin + motion.apply(np.zeros(3))
    return {
        "index": state.index,
        "time_s": state.time_s,
        "light": {
            "position_cm": _numbers(torch.position),
            "aim": _numbers(torch.aim),
            "off_aim_deg": float(np.degrees(np.arccos(np.clip(torch.off_axis_cosine(centroid), 0, 1)))),
            "distance_cm": float(np.linalg.norm(to_face)),
            "irradiance": float(torch.irradiance(centroid)),
            "direction": _numbers(_unit(to_face)),
            **{
                name: _numbers(_unit(torch.position - ball.center))
                for name, ball in zip(("at_ball", "at_second_ball"), scene.balls, strict=False)
            },
        },
        "flash": {
            "state": flash_state(state.lit),
            "lit_share": float(state.lit.mean()),
            "lit_rows_px_share": [[round(row, 4), round(fraction, 6)] for row, fraction in state.knots],
        },
        "head": {
            "pose_deg": motion.angles._asdict(),
            "origin_cm": _numbers(origin),
            "to_rest": {
                "rotation_deg": picture.rotation_deg,
                "translation_px": list(picture.translation_px),
                "residual_px": picture.residual_px,
            },
        },
        **{
            name: list(highlight_px(ball, scene.camera, torch))
            for name, ball in zip(("highlight_px", "second_highlight_px"), scene.balls, strict=False)
        },
        "exposure_gain": gains.exposure,
        "white_balance_gain": list(gains.white_balance),
    }


def _ball(ball: MirrorBall, camera: Pinhole) -> dict[str, Any]:
    outline = ball.outline(camera)
    return {
        "x_px": outline.x,
        "y_px": outline.y,
        "radius_px": outline.radius,
        "semi_radial_px": outline.semi_radial,
        "semi_tangential_px": outline.semi_tangential,
        "centre_cm": _numbers(ball.center),
        "radius_cm": ball.radius_cm,
        "reflectance": _numbers(ball.reflectance),
    }


def _unit(vector: NDArray) -> NDArray:
    return np.asarray(vector / np.linalg.norm(vector))


def _numbers(vector: NDArray) -> list[float]:
    return [round(float(value), 6) for value in vector]
