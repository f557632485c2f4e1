"""One browser for all tests of the panel, pages for each, and the cameras that they show."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import pytest
from playwright.sync_api import Browser

from relit_camera.app.setup.needed_models import missing_models
from relit_camera.base.models.model_store import FOLDER_VARIABLE, ModelStore
from tests.browser.browser_pages import OpenPage, Pages, chromium
from tests.browser.cameras import FakeServer, ProcessCamera, camera_process, fake_server
from tests.capture.instant.conftest import MODELS
from tests.cli.relit_command import finish

FAILED = pytest.StashKey[bool]()
Timed = Callable[[str], AbstractContextManager[None]]
"""Times one step of a flow, which it names, for the table at the end of the run."""


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Note a failure, so that the pages know of it when they are closed."""
    report = yield
    item.stash[FAILED] = item.stash.get(FAILED, False) or report.failed
    return report


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    with chromium() as browser:
        yield browser


@pytest.fixture
def pages(browser: Browser, request: pytest.FixtureRequest) -> Iterator[Pages]:
    """The pages of this test; no script of theirs may fail."""
    pages = Pages(browser)
    yield pages
    if request.node.stash.get(FAILED, False):
        pages.keep(request.node.name)
    pages.close()
    assert pages.errors == []


@pytest.fixture
def open_page(pages: Pages) -> OpenPage:
    return pages.open


@pytest.fixture
def fake(tmp_path: Path) -> Iterator[FakeServer]:
    """A camera without devices, whose every state a test can set."""
    with fake_server(tmp_path / "data") as server:
        yield server


@pytest.fixture
def demo(tmp_path: Path) -> Iterator[ProcessCamera]:
    """`relit demo` in a process of its own, with the bundled person, no longer than it is needed: it takes a core."""
    with camera_process(tmp_path, "demo", "--headless") as camera:
        yield camera


@pytest.fixture(scope="session")
def models(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the public networks: the installed ones, else those that can be pulled now."""
    if all(ModelStore().is_pulled(name) for name in MODELS):
        return ModelStore().folder
    folder = tmp_path_factory.mktemp("models")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(FOLDER_VARIABLE, str(folder))
        pulled = finish("models", "pull", folder=folder, timeout_s=200)
        missing = missing_models("mesh", "selfie")
    if missing:
        pytest.skip(f"the public models are not installed and cannot be pulled: {pulled.out} {pulled.err}")
    return folder


@pytest.fixture
def timed(request: pytest.FixtureRequest, note_row: Callable[[str, tuple[str, ...]], None]) -> Timed:
    """Notes how long a step of a flow took."""

    @contextmanager
    def step(name: str) -> Iterator[None]:
        began = time.monotonic()
        yield
        flow = request.node.name.removeprefix("test_").replace("_", " ")
        note_row("steps in the browser", (flow, name, f"{time.monotonic() - began:.1f} s"))

    return step
