"""`python -m tests.api.api_fuzz --cases 10000`: schemathesis on the whole API of a camera without devices.

Requests are made from the description that the camera serves, right ones and wrong ones, alone and in sequences; every
answer is held to that description. A short run is a test of CI. Exits with 1 where there is a finding.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from relit_camera.api.app import create_app
from relit_camera.api.server.http_server import start_api_server
from relit_camera.base.config.settings import RelitSettings, ServerSettings, StorageSettings
from relit_camera.subject.subject_file import write_subject
from tests.api.fake_camera import FakeCamera
from tests.generated_subject import small_subject

CONFIGURATION = Path(__file__).with_name("schemathesis.toml")
ENDLESS = r"/(events|preview\.mjpg)$"
"""Answers that do not end."""
FEWEST, MOST_EXAMPLES = 2, 2000
_GENERATED = re.compile(r"^\s*([\d,]+) generated", re.MULTILINE)


def fuzz(cases: int, seed: int | None = None) -> tuple[int, int, str]:
    """Try the API with `cases` requests or more.

    Returns:
        Schemathesis' exit status, 0 where it found nothing; how many cases it made; and what it printed.
    """
    with tempfile.TemporaryDirectory() as folder:
        data = Path(folder)
        camera = FakeCamera(data)
        write_subject(camera.scene_controller.subjects.new_path("ada"), small_subject())
        app = create_app(camera, RelitSettings(storage=StorageSettings(data_dir=data)))
        with start_api_server(app, ServerSettings(port=0)) as server:
            made, text, examples = 0, "", FEWEST if cases < 2000 else cases // 250
            while made < cases:
                status, count, said = _run(f"{server.address.url}api/v1/openapi.json", examples, folder, seed)
                made, text = made + count, text + said
                if status or not count:
                    return status or 1, made, text
        camera.stop()
    return 0, made, text


def _run(url: str, examples: int, folder: str, seed: int | None) -> tuple[int, int, str]:
    command = [
        *(str(Path(sys.executable).with_name("schemathesis")), "--no-color", "--config-file", str(CONFIGURATION)),
        *("run", url, "--max-examples", str(min(examples, MOST_EXAMPLES)), "--continue-on-failure"),
        *("--phases", "coverage,fuzzing,stateful" if examples > FEWEST else "fuzzing"),
        *("--exclude-path-regex", ENDLESS, "--request-timeout", "30", "--generation-database", "none"),
        *(("--seed", str(seed)) if seed is not None else ()),
    ]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    count = _GENERATED.search(done.stdout)
    said = done.stdout + done.stderr
    return done.returncode, int(count[1].replace(",", "")) if count else 0, said


def main() -> None:
    """Try it as the command line says."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=10_000)
    parser.add_argument("--seed", type=int)
    arguments = parser.parse_args()
    status, made, text = fuzz(arguments.cases, arguments.seed)
    print(text)
    print(f"{made} cases, {'no finding' if status == 0 else 'findings: see above'}")
    sys.exit(status)


if __name__ == "__main__":
    main()
