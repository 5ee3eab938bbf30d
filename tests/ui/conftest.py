"""A page that shows a real graph, and real browsers to look at it."""

import os
import shutil
import socket
from collections.abc import Callable, Iterator

import pytest

from ros_visualise.pipelines import image_pipeline
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sources.playback import Playback
from ros_visualise.ui.page import Page

FLAGS = [
    "--no-sandbox",
    "--disable-gpu",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
]


@pytest.fixture
def port() -> int:
    """A port that is free."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        return server.getsockname()[1]


@pytest.fixture
def runtime() -> Iterator[LocalRuntime]:
    """The demo through the filters to the edges, paused at its first image."""
    playback = Playback(hold=True)
    playback.pause()
    running = LocalRuntime(image_pipeline("landscape"), playback)
    running.start()
    yield running
    running.stop()


@pytest.fixture
def page(port: int, runtime: LocalRuntime) -> Iterator[Page]:
    """A page that shows it."""
    shown = Page(port=port)
    shown.open(runtime)
    yield shown
    shown.close()


@pytest.fixture(scope="session")
def chromium() -> Iterator[object]:
    """One browser for all tests, skipped where there is none."""
    playwright = pytest.importorskip("playwright.sync_api")
    found = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("chrome")
    if found is None:
        if os.environ.get("CI"):
            pytest.fail("no chromium: apt-get install chromium")
        pytest.skip("no chromium: apt-get install chromium, to run this")
    with playwright.sync_playwright() as started:
        browser = started.chromium.launch(executable_path=found, args=FLAGS)
        yield browser
        browser.close()


@pytest.fixture
def browse(chromium, page: Page) -> Iterator[Callable[[], object]]:
    """Opens the page in a browser of its own, until its four images are there."""
    contexts = []

    def open_browser() -> object:
        context = chromium.new_context(viewport={"width": 1280, "height": 720})
        contexts.append(context)
        tab = context.new_page()
        tab.goto(page.url)
        tab.wait_for_function(
            "document.querySelectorAll(\"img[src^='blob:']\").length == 4", timeout=30_000
        )
        return tab

    yield open_browser
    for context in contexts:
        context.close()
