"""A call in headless Chromium, driven over WebDriver: call.py LABEL OUT SECONDS.

Writes OUT.jsonl, a line a second of what the page sees, OUT.png, the last picture it got, and OUT-page.png, a
screenshot. Prints the cameras that the page may choose from. Ends early when a file OUT.stop appears; exits with 1 if
the camera is not to be had.
"""

import base64
import functools
import http.server
import json
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
from pathlib import Path

DRIVER_PORT, PAGE_PORT = 9515, 8081
FLAGS = [
    "--headless=new",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--use-fake-ui-for-media-stream",
    "--autoplay-policy=no-user-gesture-required",
    "--window-size=640,603",
]
START_S = 180


class Page:
    """A page in a browser of its own."""

    def __init__(self, driver):
        self._driver = f"http://127.0.0.1:{driver}"
        options = {"binary": "/usr/bin/chromium", "args": [*FLAGS, f"--user-data-dir={tempfile.mkdtemp()}"]}
        timeouts = {"script": START_S * 1000, "pageLoad": START_S * 1000}
        wanted = {"browserName": "chrome", "goog:chromeOptions": options, "timeouts": timeouts}
        answer = self._post("/session", {"capabilities": {"alwaysMatch": wanted}})
        self._session = f"/session/{answer['sessionId']}"

    def open(self, address):
        """Go to an address."""
        self._post(f"{self._session}/url", {"url": address})

    def run(self, script):
        """Run a script's body and return what its promise gives."""
        return self._post(f"{self._session}/execute/sync", {"script": script, "args": []})

    def screenshot(self):
        """The page as PNG."""
        with urllib.request.urlopen(f"{self._driver}{self._session}/screenshot", timeout=START_S) as answer:
            return base64.b64decode(json.load(answer)["value"])

    def close(self):
        """End the browser."""
        request = urllib.request.Request(self._driver + self._session, method="DELETE")
        urllib.request.urlopen(request, timeout=START_S).close()

    def _post(self, path, body):
        request = urllib.request.Request(self._driver + path, json.dumps(body).encode())
        with urllib.request.urlopen(request, timeout=START_S) as answer:
            return json.load(answer)["value"]


def main(label, out, seconds):
    """Hold the call for so long."""
    handler = functools.partial(Quiet, directory=Path(__file__).parent)
    server = http.server.ThreadingHTTPServer(("127.0.0.1", PAGE_PORT), handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    driver = subprocess.Popen(
        ["chromedriver", f"--port={DRIVER_PORT}", "--log-level=SEVERE"], stdout=subprocess.DEVNULL
    )
    try:
        wait_for_driver()
        page = opened_page()
        try:
            found = page.run(f"return call({json.dumps(label)})")
            print(json.dumps(found), flush=True)
            if "label" in found:
                hold(page, out, seconds)
        finally:
            page.close()
        return 0 if "label" in found else 1
    finally:
        driver.kill()


def opened_page():
    """Open the page; Chromium at times does not on a slow machine, and does when it is started again."""
    for last_try in (False, False, True):
        page = None
        try:
            page = Page(DRIVER_PORT)
            page.open(f"http://localhost:{PAGE_PORT}/call.html")
        except OSError:
            if page is not None:
                page.close()
            if last_try:
                raise
        else:
            return page
    return None


def hold(page, out, seconds):
    """Note the state of the call each second, and keep a picture and a screenshot of its end."""
    ends_at = time.monotonic() + seconds
    with Path(f"{out}.jsonl").open("w") as states:
        while time.monotonic() < ends_at and not Path(f"{out}.stop").exists():
            time.sleep(1)
            print(json.dumps({"at": time.monotonic(), **page.run("return state()")}), file=states, flush=True)
    data = page.run("return picture()")
    Path(f"{out}.png").write_bytes(base64.b64decode(data.partition(",")[2]))
    Path(f"{out}-page.png").write_bytes(page.screenshot())


def wait_for_driver():
    """Wait until chromedriver answers."""
    ends_at = time.monotonic() + START_S
    while time.monotonic() < ends_at:
        try:
            urllib.request.urlopen(f"http://127.0.0.1:{DRIVER_PORT}/status", timeout=5).close()
            return
        except OSError:
            time.sleep(0.2)
    sys.exit("chromedriver does not answer")


class Quiet(http.server.SimpleHTTPRequestHandler):
    """Serves the page without a word."""

    def log_message(self, *args):
        """Say nothing."""


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2], float(sys.argv[3])))
