"""The face in a desk recording: where it is, how large, and whether there is one and only one."""

from __future__ import annotations

import logging
import time
from dataclasses import dataclass

import numpy as np

from relit_camera.base.errors import CaptureError, ModelError
from relit_camera.base.images.image_types import DisplayImage, Frame, Mask, Points
from relit_camera.capture.desk.desk_recording import DeskSetup
from relit_camera.capture.film.face_circle import FaceCircle
from relit_camera.face.detection.installed_detector import open_face_detector
from relit_camera.face.matting import SelfieMatting
from relit_camera.face.tracking.trackers import TrackerOptions, open_tracker, track_still

log = logging.getLogger(__name__)

PUPIL_DISTANCE_CM = 6.3
"""Mean of adults (Dodgson 2004)."""
MIN_FACE_PX = 90.0
"""Least height of a face, brow to chin: it fills a fifth of a VGA frame."""
SECOND_FACE = 0.5
"""Height of another face, relative to the largest, from which there are two."""
MAX_TURN_DEG = 45.0
"""Between nose and webcam, which may stand beside and above the screen that is looked at."""
_MATTE_REPEATS = 3


@dataclass(frozen=True)
class DeskFace:
    """A face in a recording.

    Attributes:
        circle: about the face, in pixels of a frame.
        pixels_per_cm: of a frame, at the face.
    """

    circle: FaceCircle
    pixels_per_cm: float

    def from_axis_cm(self, size: tuple[int, int]) -> tuple[float, float]:
        """How far to the picture's right and up the face lies from the axis of a camera of this frame size."""
        across, down = self.circle.x - size[0] / 2, self.circle.y - size[1] / 2
        return across / self.pixels_per_cm, -down / self.pixels_per_cm


def find_face(picture: DisplayImage, setup: DeskSetup) -> DeskFace:
    """The face in a picture under white; where the setup has one and its scale, that one.

    Raises:
        CaptureError: no face, two, one that is too small, or not at the distance that the setup has.
        ModelError: the detector is not installed, and the setup lacks the face or the scale.
    """
    face, scale = setup.face, setup.pixels_per_cm
    height, width = picture.shape[:2]
    if face is None or scale is None:
        faces = sorted(open_face_detector().detect_all(picture), key=lambda each: each.box[3])
        if not faces:
            raise CaptureError(
                "no face is seen under the white screen", "sit before the webcam, your face in its middle"
            )
        if len(faces) > 1 and faces[-2].box[3] > SECOND_FACE * faces[-1].box[3]:
            raise CaptureError("two faces are seen", "only you may be in the picture: close doors, cover pictures")
        x, y, box_width, box_height = faces[-1].box
        eyes = float(np.linalg.norm(faces[-1].eyes[0] - faces[-1].eyes[1]))
        circle = FaceCircle(x + box_width / 2, y + box_height / 2, max(box_width, box_height) / 2)
        found = DeskFace(circle, scale or eyes / PUPIL_DISTANCE_CM)
    else:
        found = DeskFace(FaceCircle(face.x, face.y, face.radius), scale)
    if 2 * found.circle.radius < MIN_FACE_PX:
        what = f"the face is only {2 * found.circle.radius:.0f} pixels high, {MIN_FACE_PX:.0f} are needed"
        raise CaptureError(what, "come nearer, or film with a larger picture")
    if not (0 <= found.circle.x < width and 0 <= found.circle.y < height):
        raise CaptureError(f"the face at {found.circle.x:.0f}, {found.circle.y:.0f} is outside of the frames", "")
    return found


def find_mesh_landmarks(picture: DisplayImage) -> Points | None:
    """Landmarks (478, 2) of the scheme `mesh478`; None where the tracker is not installed.

    Raises:
        CaptureError: the tracker sees no face, or one from the side.
    """
    try:
        tracker = open_tracker("mesh", TrackerOptions(blendshapes=False))
    except ModelError as error:
        log.warning("the head's shape is taken to be an ellipsoid: %s", error)
        return None
    state = track_still(picture, tracker)
    if not state.visible or state.pose is None:
        raise CaptureError(
            "the face is seen from the side, or half hidden", "look at the screen, the webcam before you, face free"
        )
    if state.pose.turn_deg > MAX_TURN_DEG:
        what = f"the face is turned away from the webcam by {state.pose.turn_deg:.0f} degrees"
        raise CaptureError(what, "look at the screen, and put the webcam nearer to its middle")
    return state.landmarks


def segment_person(picture: DisplayImage) -> Mask | None:
    """Alpha (height, width) 0..1 of the person by the segmentation network; None where it is not installed."""
    try:
        matting = SelfieMatting()
    except ModelError as error:
        log.info("the person is told from the room by the screen's light: %s", error)
        return None
    alpha = np.zeros(picture.shape[:2], np.uint8)
    for index in range(_MATTE_REPEATS):  # it is smoothed over time
        alpha = matting.matte(Frame(picture, index, time.monotonic(), index / 30))
    return alpha.astype(np.float32) / np.float32(255)
