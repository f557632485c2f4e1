"""Replays that a worker process can import, so this file imports little."""

from __future__ import annotations

import threading
from pathlib import Path

from relit_camera.app.replay.replay_worker import ReplayOutcome, ReplayWork
from relit_camera.base.concurrency.worker_process import Progress
from relit_camera.base.errors import VideoError
from relit_camera.subject.subject import Subject

VIDEO = b"a video" * 1000


def write_quickly(work: ReplayWork, out: Path, tell: Progress) -> ReplayOutcome:
    """A file that says what was asked for."""
    assert work.video.read_bytes() == VIDEO
    tell("Relighting", 15, 30)
    lighting = work.scene.look.lighting
    who = f"{work.subject.metadata.width} pixels" if isinstance(work.subject, Subject) else work.subject or "nobody"
    out.write_text(f"{who} at {lighting.yaw_deg:g}, split {lighting.split:g} by {work.settings.tracker.name}")
    return ReplayOutcome(30, 28, ("slow: a network is missing",))


def write_half_and_wait(work: ReplayWork, out: Path, tell: Progress) -> ReplayOutcome:
    """Half of a file, and no end."""
    out.write_bytes(b"half a video")
    tell("Relighting", 15, 30)
    threading.Event().wait(120)
    raise AssertionError


def refuse_video(work: ReplayWork, out: Path, tell: Progress) -> ReplayOutcome:
    """Find no face."""
    raise VideoError(f"no face was found in {work.video}, which gave {out.parent}/half.mp4", "look toward the camera")
