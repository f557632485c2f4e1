"""`relit run` itself in a session: the bundled person, moved by the bundled clip."""

from __future__ import annotations

import json
import subprocess
import threading
import urllib.request
from pathlib import Path
from typing import Any, Self

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.app.demo.demo_files import CLIP, MATTES, SUBJECT, TRACK
from tests.cli.relit_command import COMMAND
from tests.pipewire.session import WAIT_S, Session, wait_for

SIZE = (1280, 720)


class RelitRun:
    """A process of the command: started with the block, killed at its end."""

    def __init__(self, session: Session, *options: str) -> None:
        self._session, self._options = session, options
        self._said: list[str] = []
        self._listener = threading.Thread(target=self._listen)

    def __enter__(self) -> Self:
        folder = self._session.folder
        material = ["--source", CLIP, "--subject", SUBJECT, "--tracker", f"recorded:{TRACK}", "--environment", "sunset"]
        with (folder / "relit.log").open("ab") as log:
            self.process = subprocess.Popen(
                [*COMMAND, "run", *map(str, material), "--port", "0", *self._options],
                env={
                    **self._session.environment,
                    "RELIT_MATTE": f"recorded:{MATTES}",
                    "RELIT_STORAGE__DATA_DIR": str(folder / "relit"),
                },
                cwd=Path(__file__).resolve().parents[2],
                stdout=subprocess.PIPE,
                stderr=log,
                text=True,
            )
        self._listener.start()
        try:
            wait_for(lambda: self._said or self.process.poll() is not None, "relit run")
            assert self._said, (folder / "relit.log").read_text()
        except BaseException:
            self.__exit__()
            raise
        self.api = self._said[-1].rpartition(" ")[2] + "api/v1/"
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()
        self.process.wait()
        self._listener.join()
        assert self.process.stdout is not None
        self.process.stdout.close()

    def get(self, path: str) -> Any:
        """What a resource of the API says."""
        with urllib.request.urlopen(self.api + path, timeout=WAIT_S) as answer:
            return json.load(answer)

    def put(self, path: str, value: object) -> None:
        """Set a resource of the API."""
        headers = {"Content-Type": "application/json"}
        request = urllib.request.Request(
            self.api + path, data=json.dumps(value).encode(), headers=headers, method="PUT"
        )
        with urllib.request.urlopen(request, timeout=WAIT_S):
            pass

    def snapshot(self) -> NDArray[np.uint8]:
        """The newest published picture, sRGB RGB."""
        with urllib.request.urlopen(self.api + "snapshot.jpg", timeout=WAIT_S) as answer:
            image = cv2.imdecode(np.frombuffer(answer.read(), np.uint8), cv2.IMREAD_COLOR)
        assert image is not None
        return np.asarray(image[..., ::-1], np.uint8)

    def _listen(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            if "the panel is at" in line:
                self._said.append(line.strip())
