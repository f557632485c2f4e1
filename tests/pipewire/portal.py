"""A session with the desktop's portal, which gives cameras to browsers, and a call in each of them."""

from __future__ import annotations

import base64
import json
import os
import sysconfig
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from tests.pipewire.session import Session, cache_folder, wait_for

PORTAL = "org.freedesktop.portal.Desktop", "/org/freedesktop/portal/desktop"
STORE = "org.freedesktop.impl.portal.PermissionStore", "/org/freedesktop/impl/portal/PermissionStore"
CALL_S = 60.0
"""How long a browser may take to start and show the camera."""
MOST_STARTS = 3
"""Of a browser that finds no camera at all, gets no picture of it or ends by itself."""
ENDED = "Ended"
"""What is told of a browser that ended before its page had sent anything."""
FIREFOX_PREFERENCES = {
    "media.webrtc.camera.allow-pipewire": True,
    "media.navigator.permission.disabled": True,  # of Firefox's own question
    "browser.shell.checkDefaultBrowser": False,
    "datareporting.policy.dataSubmissionEnabled": False,
    "toolkit.telemetry.enabled": False,
    "app.update.enabled": False,
}
PAGE = """<!doctype html><title>call</title><video id="video" autoplay muted></video><script>
// Chromium at times gives up a camera that has only just appeared, at once or when it is to show it; a person would
// press the button once more.
async function opened(tries) {
  let stream;
  try {
    stream = await navigator.mediaDevices.getUserMedia({ video: true });
    await shown(stream);
    return stream;
  } catch (error) {
    stream?.getTracks().forEach((track) => track.stop());
    if (tries <= 1 || !["NotReadableError", "NotFoundError", "AbortError"].includes(error.name)) throw error;
    await new Promise((resolve) => setTimeout(resolve, 2000));
    return opened(tries - 1);
  }
}
async function shown(stream) {
  video.srcObject = stream;
  // Until the camera's first picture has come, Chromium plays one of its own: black, 2 x 2 pixels.
  for (let tries = 0; video.paused || video.videoWidth <= 2; tries++) {
    const ended = stream.getVideoTracks()[0].readyState === "ended";
    if (ended || tries === 100) throw new DOMException(ended ? "given up" : "no picture in 10 s", "AbortError");
    await new Promise((resolve) => setTimeout(resolve, 100));
  }
  await new Promise((resolve) => setTimeout(resolve, 1000));
}
async function named() {
  // Chromium may have no list yet where a camera has just come.
  for (let tries = 0; ; tries++) {
    const devices = await navigator.mediaDevices.enumerateDevices();
    const labels = devices.filter(({ kind }) => kind === "videoinput").map(({ label }) => label);
    if (labels.length || tries === 20) return labels;
    await new Promise((resolve) => setTimeout(resolve, 100));
  }
}
async function call() {
  const stream = await opened(3);
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [video.videoWidth, video.videoHeight];
  canvas.getContext("2d").drawImage(video, 0, 0);
  return { label: stream.getVideoTracks()[0].label, labels: await named(), picture: canvas.toDataURL("image/png") };
}
call()
  .catch((error) => ({ error: String(error) }))
  .then((found) => fetch("/", { method: "POST", body: JSON.stringify(found) }));
</script>
"""


class PortalSession(Session):
    """A session whose user has allowed every program to use cameras."""

    @property
    def environment(self) -> dict[str, str]:
        """Variables for the programs of the session."""
        root = cache_folder() / "own" / "root"  # of other suites there is PipeWire alone
        found = super().environment
        libraries = f"{root}/usr/lib/{sysconfig.get_config_var('MULTIARCH')}"
        return {
            **found,
            "PATH": f"{root}/usr/libexec:{found['PATH']}",
            "LD_LIBRARY_PATH": f"{found['LD_LIBRARY_PATH']}:{libraries}",
            "XDG_DATA_DIRS": f"{found['XDG_DATA_DIRS']}:{root}/usr/share",
            "XDG_CURRENT_DESKTOP": "tests",
            "XDG_DESKTOP_PORTAL_DIR": str(self.folder / "portals"),
        }

    def start(self) -> None:
        """Start the store of permissions, which the session manager reads, then it with PipeWire, and the portal."""
        # Without a desktop that can ask, the portal has no cameras at all; nobody is asked, for all is allowed.
        portals = self.folder / "portals"
        portals.mkdir(exist_ok=True)
        asks = "org.freedesktop.impl.portal.Access"
        (portals / "tests.portal").write_text(f"[portal]\nDBusName=tests.desktop\nInterfaces={asks}\nUseIn=tests\n")
        self._start("xdg-permission-store")
        wait_for(lambda: self.answer_for("", "yes"), "the store of permissions")
        super().start()
        self._start("xdg-desktop-portal")
        wait_for(lambda: self.camera_is_present() is not None, "the portal's cameras")

    def stop(self) -> None:
        """End all of them."""
        self._end("xdg-desktop-portal")
        self._end("xdg-permission-store")
        super().stop()

    def answer_for(self, app: str, answer: str) -> bool:
        """Note what the person has answered to a program that asked for cameras; "" is any without a sandbox."""
        change = ["string:devices", "boolean:true", "string:camera", f"string:{app}", f"array:string:{answer}"]
        return self._send(*STORE, f"{STORE[0]}.SetPermission", *change) is not None

    def forget(self, app: str) -> bool:
        """Let the store forget it, as the doctor's cure does."""
        return (
            self._send(*STORE, f"{STORE[0]}.DeletePermission", "string:devices", "string:camera", f"string:{app}")
            is not None
        )

    def camera_is_present(self) -> bool | None:
        """Whether the portal says that there is a camera; None while it does not answer."""
        get = "org.freedesktop.DBus.Properties.Get"
        answer = self._send(*PORTAL, get, "string:org.freedesktop.portal.Camera", "string:IsCameraPresent")
        return None if answer is None else "boolean true" in answer

    def _send(self, name: str, path: str, method: str, *arguments: str) -> str | None:
        """What a service answers; None where it does not."""
        command = ["dbus-send", "--session", "--print-reply", f"--dest={name}", path, method, *arguments]
        answer = self.run(*command)
        return answer.stdout.decode() if answer.returncode == 0 else None


@dataclass(frozen=True)
class Call:
    """What a page got that asked for a camera.

    Attributes:
        label: of the camera that it got.
        labels: of all that it found.
        image: a picture, uint8 sRGB RGB (height, width, 3).
    """

    label: str
    labels: tuple[str, ...]
    image: NDArray[np.uint8]


def call_in_chromium(session: Session, program: str) -> Call:
    """A call in headless Chromium, with the flag that lets it look in PipeWire."""
    profile = session.folder / f"chromium-{time.monotonic_ns()}"
    flags = ["--headless", "--disable-gpu", "--no-first-run", "--use-fake-ui-for-media-stream", "--disable-sync"]
    flags += ["--enable-features=WebRtcPipeWireCamera", f"--user-data-dir={profile}"]
    if os.geteuid() == 0:
        flags.append("--no-sandbox")
    return _call(session, program, *flags)


def call_in_firefox(session: Session, program: str) -> Call:
    """A call in headless Firefox, with the setting that lets it look in PipeWire."""
    profile = session.folder / f"firefox-{time.monotonic_ns()}"
    profile.mkdir()
    lines = [f'user_pref("{name}", {json.dumps(value)});' for name, value in FIREFOX_PREFERENCES.items()]
    (profile / "user.js").write_text("\n".join(lines))
    return _call(session, program, "--headless", "--no-remote", "--profile", str(profile))


def _call(session: Session, program: str, *arguments: str) -> Call:
    """Open the page, and wait for what it found."""
    for _ in range(MOST_STARTS):
        answer = _answer(session, program, *arguments)
        # Chromium, rarely, finds no camera of PipeWire as long as it runs, or shows none; a person would start again.
        if not answer.get("error", "").startswith(("NotFoundError", "AbortError", ENDED)):
            break
    assert "error" not in answer, answer
    data = np.frombuffer(base64.b64decode(answer["picture"].partition(",")[2]), np.uint8)
    image = cv2.imdecode(data, cv2.IMREAD_COLOR)
    assert image is not None
    return Call(answer["label"], tuple(answer["labels"]), np.asarray(image[..., ::-1], np.uint8))


def _answer(session: Session, program: str, *arguments: str) -> dict[str, Any]:
    """What the page sends from a browser that is started for it."""
    with _page() as (url, found):
        browser = session.spawn(program, *arguments, url)
        try:
            wait_for(lambda: found or browser.poll() is not None, f"the call in {Path(program).name}", CALL_S)
        finally:
            browser.terminate()
            _, said = browser.communicate()
    return found[0] if found else {"error": f"{ENDED}: {said.decode(errors='replace')[-2000:]}"}


@contextmanager
def _page() -> Iterator[tuple[str, list[dict[str, Any]]]]:
    """Serve the page, and collect what it sends."""
    found: list[dict[str, Any]] = []

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self._answer(200, PAGE.encode())

        def do_POST(self) -> None:
            found.append(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
            self._answer(204, b"")

        def log_message(self, *_: object) -> None:
            """Say nothing."""

        def _answer(self, status: int, body: bytes) -> None:
            self.send_response(status)
            self.send_header("Content-Type", "text/html")
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        try:
            yield f"http://localhost:{server.server_address[1]}/", found
        finally:
            server.shutdown()
