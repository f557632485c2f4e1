"""How well a subject is told from strangers: `python -m tests.identity_curve SUBJECT=CLIP[,CLIP…] … --others CLIP …`.

Each subject is shown its own clips, those of the other subjects, and the others. Printed are, for each pair, the
unlikeness of the first frame and the least until the check's delay is over; then, for thresholds, the share of subjects
and of strangers that the first frames and the watched ones let pass.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from relit_camera.app.wiring import make_follower
from relit_camera.base.concurrency.threads import limit_threads
from relit_camera.base.config.settings import TrackerSettings
from relit_camera.base.video.video_readers import VideoReader
from relit_camera.face.tracking.trackers import open_tracker
from relit_camera.live.modes.identity_check import IdentityTunables, shape_distance_cm, unlikeness
from relit_camera.live.modes.room_light_estimator import RoomLightEstimator
from relit_camera.live.reenactment.source_image import find_source_face
from relit_camera.subject.subject_file import read_subject

WATCHED_S, INTERVAL_S = 1.5, 0.25
"""How long a face is watched, and time between two measurements."""
THRESHOLDS = (0.4, 0.65, 0.8, 1.0, 1.2, 1.4, 1.6, 2.0)


@dataclass(frozen=True)
class Likeness:
    """A subject before whom a face came.

    Attributes:
        first: unlikeness of the first frame with a face.
        least: the least until `WATCHED_S`.
    """

    first: float
    least: float


def measure(subject: Path, clip: Path) -> Likeness | None:
    """Watch a clip with a subject's check; None where no face is found."""
    tracker = open_tracker("mesh")
    person = read_subject(subject)
    face = find_source_face(person, tracker)
    follower = make_follower(TrackerSettings(name="mesh"), tracker)
    room, limits = RoomLightEstimator(person, face), IdentityTunables()
    first, least, began_s, measured_s = None, np.inf, 0.0, -np.inf
    with VideoReader(clip, accurate=False) as frames:
        for frame in islice(frames, 300):
            motion = follower.follow(tracker.track(frame), frame.size, frame.time_s)
            if motion.pose is None or motion.neutral is None or motion.presence <= 0:
                continue
            seen = room.update(frame.image, motion.landmarks, motion.rotation, frame.time_s)
            if frame.time_s - measured_s < INTERVAL_S:
                continue
            measured_s = frame.time_s
            distance_cm = shape_distance_cm(motion.neutral.points + motion.expression, face)
            now = unlikeness(distance_cm, seen.residual, limits)
            if first is None:
                first, began_s = now, frame.time_s
            least = np.fmin(least, now)
            if frame.time_s - began_s >= WATCHED_S:
                break
    return None if first is None else Likeness(first, float(least))


def main() -> None:
    """See the module."""
    parser = argparse.ArgumentParser(prog="python -m tests.identity_curve", description=__doc__)
    parser.add_argument("subjects", nargs="+", metavar="SUBJECT=CLIP[,CLIP…]")
    parser.add_argument("--others", nargs="*", type=Path, default=[])
    options = parser.parse_args()
    limit_threads()
    own = {
        Path(name): [Path(each) for each in clips.split(",")]
        for name, _, clips in (each.partition("=") for each in options.subjects)
    }
    found: dict[bool, list[Likeness]] = {True: [], False: []}
    for subject, clips in own.items():
        strangers = [clip for other, theirs in own.items() if other != subject for clip in theirs]
        for clip in [*clips, *strangers, *options.others]:
            likeness, same = measure(subject, clip), clip in clips
            if likeness is not None:
                found[same].append(likeness)
                who = "same" if same else "other"
                name = f"{clip.parent.name}/{clip.name}"
                print(f"{subject.stem:10} {name:34} {who:6} {likeness.first:6.2f} {likeness.least:6.2f}", flush=True)
    print(f"\n{len(found[True])} pairs of the same person, {len(found[False])} of others; of them pass")
    print(f"up to    first frame: same, others; after {WATCHED_S} s: same, others")
    for threshold in THRESHOLDS:
        shares = [
            np.mean([value <= threshold for each in found[same] if not np.isnan(value := getattr(each, moment))])
            for moment in ("first", "least")
            for same in (True, False)
        ]
        print(f"{threshold:8.2f}   " + "  ".join(f"{100 * share:5.1f} %" for share in shares))


if __name__ == "__main__":
    main()
