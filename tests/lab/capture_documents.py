"""A rendered capture's truth, and the report of a capture that finds all of it."""

from __future__ import annotations

from typing import Any

import numpy as np

from relit_camera.light.directions import direction_from_degrees

Document = dict[str, Any]

STATES = ("dark", "partial", "bright", "bright", "partial", "dark") * 5


def documents() -> tuple[Document, Document]:
    """Truth and report of 30 frames."""
    noise = np.random.default_rng(8)
    true_frames, frames = [], []
    for index, state in enumerate(STATES):
        head, ball = (direction_from_degrees(noise.uniform(-60, 60), noise.uniform(-40, 40)).tolist() for _ in range(2))
        turn, shift = float(noise.normal()), noise.normal(size=2).tolist()
        true_frames.append(
            {
                "index": index,
                "light": {"direction": head, "at_ball": ball, "distance_cm": 100.0},
                "flash": {"state": state, "lit_share": 0.5},
                "head": {"to_rest": {"rotation_deg": turn, "translation_px": shift, "residual_px": 0.0}},
            }
        )
        found = {"direction": head, "at_ball": ball} if state == "bright" else {}
        frames.append({"index": index, "kind": state, "rotation_deg": turn, "translation_px": shift, **found})
    truth = {"ball": {"x_px": 100.0, "y_px": 50.0, "radius_px": 20.0}, "focal_px": 800.0, "frames": true_frames}
    return truth, {"ball": {"x": 100.0, "y": 50.0, "radius": 20.0}, "focal_px": 800.0, "frames": frames}
