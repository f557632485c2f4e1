"""The faces in a picture besides the one that the camera is for, each followed by a tracker of its own.

They share the networks of the camera's tracker. Each face is looked for in its own place: whoever hides theirs for a
moment is not taken for the person beside them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from relit_camera.base.images.image_types import Frame
from relit_camera.face.detection.face_detector import Box, Detection, is_same_face
from relit_camera.face.face_state import FaceState, Tracker
from relit_camera.face.landmarks.rotated_crop import bounding_box
from relit_camera.face.motion.face_follower import FaceFollower, FaceMotion
from relit_camera.face.tracking.interval_tracker import IntervalTracker
from relit_camera.face.tracking.landmark_tracker import LandmarkTracker


@dataclass(frozen=True)
class FurtherFacesTunables:
    """When further faces are looked for.

    Attributes:
        most: so many are followed.
        least_px: longer side of the box of a face from which on it is: smaller ones hardly show their light.
        look_s: from one look at the whole picture to the next.
        sought_s: the same while one of them is lost.
        forgotten_s: for so long a lost one is expected where it was.
        left_s: after so long without the face that the camera is for, it takes the largest of them instead.
        turns: one of them is looked at in one of two frames, each of several in one of so many.
    """

    most: int = 3
    least_px: float = 40.0
    look_s: float = 1.0
    sought_s: float = 0.25
    forgotten_s: float = 5.0
    left_s: float = 2.0
    turns: int = 3


TUNABLES = FurtherFacesTunables()


class _FollowedFace:
    """One of them."""

    def __init__(self, tracker: LandmarkTracker, follower: FaceFollower, frame: Frame, found: Detection) -> None:
        self._tracker, self._follower = tracker, follower
        self._measured = IntervalTracker(tracker)
        self.box = found.box
        self.seen_s = frame.time_s
        self.take(frame, found)

    @property
    def is_lost(self) -> bool:
        return not self._state.visible

    def take(self, frame: Frame, found: Detection) -> None:
        self._note(frame, self._tracker.take(frame, found))

    def track(self, frame: Frame, every: int, besides: tuple[Box, ...]) -> None:
        """Follow it into the next frame; one that is lost is not looked for here."""
        if self.is_lost:
            self._note(frame, self._state)
            return
        self._tracker.besides = besides
        self._measured.set_interval(every, follow_lips=False)
        self._note(frame, self._measured.track(frame))
        if self.is_lost:
            self._measured.reset()

    def _note(self, frame: Frame, state: FaceState) -> None:
        self._state = state
        self.motion = self._follower.follow(state, frame.size, frame.time_s)
        if state.visible:
            self.box, self.seen_s = bounding_box(state.landmarks), frame.time_s


class FurtherFaces:
    """Follows them from frame to frame. Not thread-safe."""

    def __init__(self, tracker: Tracker, make_follower: Callable[[], FaceFollower]) -> None:
        """Set up.

        Args:
            tracker: of the face that the camera is for. Only a `LandmarkTracker` can be shared; with another one no
                further face is followed.
            make_follower: makes what smooths the states of one face.
        """
        self._tracker = tracker if isinstance(tracker, LandmarkTracker) else None
        self._make_follower = make_follower
        self._faces: dict[int, _FollowedFace] = {}
        self._count = self._frames = 0
        self._looked_s = self._first_s = self._time_s = float("-inf")

    def forget(self) -> None:
        """Follow none of them: the next call of `follow` looks anew."""
        self._faces.clear()
        self._looked_s = self._first_s = float("-inf")
        self.release()

    def release(self) -> None:
        """Leave all faces of the next picture to the tracker of the first."""
        if self._tracker is not None:
            self._tracker.besides = ()

    def follow(self, frame: Frame, first: FaceState, every: int) -> Mapping[int, FaceMotion]:
        """Their motion in the next frame, each under a number that it keeps. One that is lost stays for a while.

        They take turns: in a frame that is not a face's turn its motion is the same object as before.

        Args:
            frame: the live frame.
            first: the face that the camera is for.
            every: of so many of its turns a face is measured in one.
        """
        if self._tracker is None:
            return {}
        if frame.time_s < self._time_s:  # a film begins again
            self.forget()
        self._time_s = frame.time_s
        if first.visible:
            self._first_s = frame.time_s
        taken = (bounding_box(first.landmarks),) if first.visible else ()
        self._frames += 1
        turns = min(len(self._faces) + 1, TUNABLES.turns)
        for place, face in enumerate(self._faces.values()):
            if (self._frames + place) % turns:
                continue
            others = (*taken, *(each.box for each in self._faces.values() if each is not face and not each.is_lost))
            face.track(frame, every, others)
        self._drop(frame.time_s, taken)
        if self._is_due(frame.time_s):
            self._look(self._tracker, frame, taken)
        if frame.time_s - self._first_s > TUNABLES.left_s and self._faces:
            del self._faces[max(self._faces, key=lambda number: max(self._faces[number].box[2:]))]
        self._tracker.besides = tuple(face.box for face in self._faces.values() if not face.is_lost)
        return {number: face.motion for number, face in self._faces.items()}

    def _drop(self, now_s: float, taken: tuple[Box, ...]) -> None:
        """Forget those that were lost for long, and those that have slid onto another face."""
        kept = list(taken)
        for number, face in sorted(self._faces.items(), key=lambda each: each[1].is_lost):
            doubled = any(is_same_face(face.box, each) for each in kept)
            if doubled or now_s - face.seen_s > TUNABLES.forgotten_s:
                del self._faces[number]
            else:
                kept.append(face.box)

    def _is_due(self, now_s: float) -> bool:
        sought = any(face.is_lost for face in self._faces.values())
        if len(self._faces) >= TUNABLES.most and not sought:
            return False
        return now_s - self._looked_s >= (TUNABLES.sought_s if sought else TUNABLES.look_s)

    def _look(self, tracker: LandmarkTracker, frame: Frame, taken: tuple[Box, ...]) -> None:
        """Take those that are seen and not followed, the largest first."""
        self._looked_s = frame.time_s
        if not taken:
            return  # the largest may be the one that the camera is for
        found = [face for face in tracker.faces(frame.image) if max(face.box[2:]) >= TUNABLES.least_px]
        for detection in sorted(found, key=lambda face: -max(face.box[2:])):
            if any(is_same_face(detection.box, box) for box in taken):
                continue
            there = [face for face in self._faces.values() if is_same_face(detection.box, face.box)]
            if there and there[0].is_lost:
                there[0].take(frame, detection)
            elif not there and len(self._faces) < TUNABLES.most:
                face = _FollowedFace(tracker.beside(), self._make_follower(), frame, detection)
                if not face.is_lost:
                    self._count += 1
                    self._faces[self._count] = face
