"""`python -m tests.crash --kills 200`: `kill -9` at random moments, and what is stored afterwards.

A camera is driven over HTTP (presets are replaced, environments and backgrounds come and go) while another process
writes a subject into the same folder. Both are killed at a random moment. Then everything stored must be whole, and
either what was there before the change under way or what it was to become; the camera must start again, and find no
leftovers of killed writers. 3 kills run in CI.
"""

from __future__ import annotations

import argparse
import json
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import count
from pathlib import Path

import cv2
import httpx
import numpy as np
import yaml

from relit_camera.base.config.preset_store import PresetStore
from relit_camera.base.errors import RelitError
from relit_camera.light.environments.builtin.builtin_environments import BUILTIN_NAMES
from relit_camera.light.environments.environment_store import EnvironmentStore
from relit_camera.live.scene.background_store import BackgroundStore
from relit_camera.subject.subject_file import read_subject, write_subject
from relit_camera.subject.subject_store import SubjectStore
from tests.cli.relit_command import environment, start, write_material
from tests.small_camera import WAIT_S

ROOT = Path(__file__).resolve().parents[1]
NAMES = ("one", "two")
MOST_S = 2.5
"""The moment of a kill is within so long of the first change."""
Versions = set[int | None]
"""What may be stored: the number of a version, or None for nothing."""


@dataclass
class Expected:
    """What may be stored under each (collection, name): one version, or two while a change is under way."""

    versions: dict[tuple[str, str], Versions] = field(default_factory=dict)

    def of(self, collection: str, name: str) -> Versions:
        """What may be there now."""
        return self.versions.setdefault((collection, name), {None})

    def change(self, collection: str, name: str, version: int | None, make: Callable[[], httpx.Response]) -> None:
        """Make a change: until it is answered both may be there."""
        before = self.of(collection, name)
        self.versions[collection, name] = before | {version}
        answer = make()
        assert answer.status_code in (200, 201, 204), answer.text
        self.versions[collection, name] = {version}


def panorama(version: int) -> bytes:
    """A panorama file of some 1.5 MB that holds its version."""
    noise = np.random.default_rng(version).uniform(0.1, 1, (256, 512, 3)).astype(np.float32)
    return bytes(cv2.imencode(".hdr", noise)[1])


def picture(version: int) -> bytes:
    """A background whose grey is its version."""
    return bytes(cv2.imencode(".png", np.full((720, 1280, 3), version % 250, np.uint8))[1])


def changes(http: httpx.Client, expected: Expected, numbers: Iterator[int], chance: random.Random) -> Iterator[None]:
    """Change one thing after another, without end."""
    for version in numbers:
        name, collection = chance.choice(NAMES), chance.choice(("presets", "environments", "backgrounds"))
        name = f"{name}-{collection}"  # a picture may not be called as an environment is
        path = f"{collection}/{name}"
        stored = expected.of(collection, name) != {None}
        if stored and (collection != "presets" or version % 4 == 0):
            expected.change(collection, name, None, lambda path=path: http.delete(path))  # type: ignore[misc]
        elif collection == "presets":
            look = {"lighting": {"transition_s": version / 1000, "lamps": [{"intensity": version / 1000}] * 16}}
            expected.change(collection, name, version, lambda path=path, look=look: http.put(path, json=look))  # type: ignore[misc]
        else:
            data = panorama(version) if collection == "environments" else picture(version)
            form = {"data": {"name": name}, "files": {"file": ("a.hdr", data)}}
            expected.change(collection, name, version, lambda c=collection, form=form: http.post(c, **form))  # type: ignore[misc]
        yield


def write_subjects(folder: Path) -> None:
    """The other process: once told to by a line of input, replace one subject again and again."""
    folder.mkdir(parents=True, exist_ok=True)
    subject = read_subject(folder.parent.parent / "small.relit")
    sys.stdin.readline()
    for version in count(1):
        meta = subject.metadata.model_copy(update={"source": f"version {version}"})
        write_subject(folder / "ada.relit", replace(subject, metadata=meta))


def wrong_things(data: Path, expected: Expected) -> list[str]:
    """What is stored and must not be, or not so; afterwards what there is counts as expected."""
    wrong = []
    stores = {
        "presets": lambda name: _preset_version(PresetStore(data / "presets"), name),
        "environments": lambda name: _panorama_version(data / "environments", name, expected),
        "backgrounds": lambda name: _picture_version(BackgroundStore(data / "backgrounds"), name, expected),
    }
    for collection, version_of in stores.items():
        for name in (f"{each}-{collection}" for each in NAMES):
            allowed = expected.of(collection, name)
            try:
                found = version_of(name)
            except (RelitError, ValueError, OSError) as error:
                wrong.append(f"{collection}/{name} cannot be read: {error}")
                continue
            if found not in allowed:
                wrong.append(f"{collection}/{name} is version {found}, not one of {allowed}")
            expected.versions[collection, name] = {found}
    subjects = SubjectStore(data / "subjects")
    try:
        if "ada" in subjects.names():
            assert subjects.load("ada").metadata.source.startswith("version ")
    except RelitError as error:
        wrong.append(f"subjects/ada cannot be read: {error}")
    return wrong


def _preset_version(store: PresetStore, name: str) -> int | None:
    if name not in store.names():
        return None
    lighting = store.load(name).lighting
    versions = {round(lighting.transition_s * 1000), *(round(lamp.intensity * 1000) for lamp in lighting.lamps)}
    if len(versions) != 1 or len(lighting.lamps) != 16:
        raise ValueError(f"it mixes versions: {yaml.safe_dump(lighting.model_dump(mode='json'))}")
    return versions.pop()


def _panorama_version(folder: Path, name: str, expected: Expected) -> int | None:
    store = EnvironmentStore(folder)
    if name not in store.names()[len(BUILTIN_NAMES) :]:
        return None
    data = (folder / f"{name}.hdr").read_bytes()
    store.load(name)
    known = [v for v in expected.of("environments", name) if v is not None and panorama(v) == data]
    return known[0] if known else -1


def _picture_version(store: BackgroundStore, name: str, expected: Expected) -> int | None:
    if name not in store.names():
        return None
    grey = store.load(name).reshape(-1, 3)
    known = [
        v
        for v in expected.of("backgrounds", name)
        if v is not None and abs(int(grey.min()) - v % 250) < 2 and abs(int(grey.max()) - v % 250) < 2
    ]
    return known[0] if known else -1


def leftovers(data: Path) -> list[str]:
    """Files that a killed writer left."""
    return sorted(path.name for path in data.rglob(".*"))


def run(kills: int, seed: int, say: Callable[[str], None] = lambda line: None) -> dict[str, object]:
    """Kill so many times; `wrong` lists what is not as it must be."""
    chance, expected, numbers = random.Random(seed), Expected(), count(1)
    wrong, left, starts_s, done = list[str](), Counter[str](), list[float](), 0
    with tempfile.TemporaryDirectory(prefix="relit-crash.") as name:
        folder = Path(name)
        material, data = write_material(folder, 10), folder / "data"
        options = ["--source", material.clip, "--tracker", material.tracker, "--sink", "null", "--port", 0]
        options += ["--mode", "portrait"]  # which has nothing to do while nobody is chosen
        for number in range(kills + 1):
            began = time.monotonic()
            camera = start("run", *options, folder=folder)
            writer = subprocess.Popen(
                [sys.executable, "-m", "tests.crash", "--subjects", str(data / "subjects")],
                stdin=subprocess.PIPE, cwd=ROOT, env=environment(folder),
            )  # fmt: skip
            assert camera.stdout is not None
            assert camera.stderr is not None
            ready = camera.stdout.readline()
            if not ready:
                wrong.append(f"after {number} kills the camera does not start: {camera.stderr.read()}")
                writer.kill()
                writer.communicate()
                break
            starts_s.append(time.monotonic() - began)
            if stayed := leftovers(data):
                # A file without content, made less than a minute ago, could be somebody's: it goes with a later start.
                left["stayed, empty and young"] += len(stayed)
                wrong += [f"{file} was not swept" for file in stayed if any(p.stat().st_size for p in data.rglob(file))]
            if number == kills:
                camera.send_signal(signal.SIGTERM)
                camera.communicate(timeout=WAIT_S)
                writer.kill()
                writer.communicate()
                break
            assert writer.stdin is not None
            writer.stdin.write(b"\n")
            writer.stdin.flush()
            with httpx.Client(base_url=f"{ready.split()[-1]}api/v1/", timeout=30) as http:
                killed_at = time.monotonic() + chance.uniform(0.1, MOST_S)
                killer = subprocess.Popen([sys.executable, "-S", "-c", KILLER, str(camera.pid), str(killed_at)])
                with suppress(httpx.TransportError):
                    for _ in changes(http, expected, numbers, chance):
                        done += 1
                killer.wait()
            writer.kill()
            for process in (camera, writer):
                process.communicate()
            left["found after the kills"] += len(leftovers(data))
            found = wrong_things(data, expected)
            wrong += [f"kill {number + 1}: {line}" for line in found]
            say(f"kill {number + 1}: {done} changes so far, leftovers {dict(left)}, wrong {wrong}")
    return {
        "kills": kills,
        "seed": seed,
        "changes": done,
        "leftovers": dict(left),
        "start_s": {"median": round(float(np.median(starts_s)), 2), "worst": round(max(starts_s), 2)},
        "wrong": wrong,
    }


KILLER = "import os, sys, time; time.sleep(max(0, float(sys.argv[2]) - time.monotonic())); os.kill(int(sys.argv[1]), 9)"
"""Another process: nothing that the camera's client does may decide the moment."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; 0 if all is as it must be, else 1."""
    parser = argparse.ArgumentParser(prog="python -m tests.crash", description=__doc__)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--subjects", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    if options.subjects:
        write_subjects(options.subjects)
    found = run(options.kills, options.seed, lambda line: print(line, file=sys.stderr, flush=True))
    print(json.dumps(found, indent=2))
    return int(bool(found["wrong"]))


if __name__ == "__main__":
    sys.exit(main())
