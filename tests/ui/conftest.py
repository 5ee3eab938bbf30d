"""A page that shows a real graph, and real browsers to look at it."""

from collections.abc import Callable, Iterator

import pytest
from page_client import IMAGES, TOKEN, VIEW_TOKEN
from ports import free_port
from space_client import Nodes
from waiting import wait_for

from ros_visualise.graph.pipelines import image_pipeline
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sources.playback import Playback
from ros_visualise.ui import ViewOptions
from ros_visualise.ui.live.space.tree import SpaceTree
from ros_visualise.ui.page import Page
from ros_visualise.ui.scene.scene import Scene


@pytest.fixture(autouse=True)
def tokens(monkeypatch: pytest.MonkeyPatch) -> None:
    """All pages have the same two tokens."""
    monkeypatch.setenv("ROS_VISUALISE_TOKEN", TOKEN)
    monkeypatch.setenv("ROS_VISUALISE_VIEW_TOKEN", VIEW_TOKEN)


@pytest.fixture
def port() -> int:
    """A port that is free."""
    return free_port()


@pytest.fixture
def runtime() -> Iterator[LocalRuntime]:
    """The demo through the filters to the edges, paused at its first image."""
    playback = Playback(hold=True)
    playback.pause()
    graph = image_pipeline("landscape").configured({"filters": {"threshold": 128}})
    running = LocalRuntime(graph, playback)
    running.start()
    yield running
    running.stop()


@pytest.fixture
def page(port: int, runtime: LocalRuntime) -> Iterator[Page]:
    """A page that shows it."""
    shown = Page(ViewOptions(port=port))
    shown.open(runtime)
    yield shown
    shown.close()


@pytest.fixture
def browse(chromium, page: Page) -> Iterator[Callable[..., object]]:
    """Opens the page in a browser of its own, until its images have come."""
    contexts = []

    def open_browser(path: str = "", images: bool = True) -> object:
        context = chromium.new_context(viewport={"width": 1280, "height": 720})
        contexts.append(context)
        tab = context.new_page()
        tab.goto(page.url + path)
        if images and not path:
            tab.wait_for_function(IMAGES, timeout=120_000)
        return tab

    yield open_browser
    for context in contexts:
        context.close()


class Clock:
    """Seconds that a test sets."""

    now_s = 0.0

    def __call__(self) -> float:
        return self.now_s


@pytest.fixture
def clock() -> Clock:
    """The time of the scene."""
    return Clock()


@pytest.fixture
def tree() -> SpaceTree:
    """An empty 3D view."""
    return SpaceTree()


@pytest.fixture
def scene(tree: SpaceTree, clock: Clock) -> Scene:
    """A scene in it."""
    return Scene(tree, clock)


class Look:
    """The nodes as a browser has them that hears of all changes."""

    def __init__(self, tree: SpaceTree) -> None:
        self.nodes = Nodes()
        self._reader = tree.reader()

    def update(self) -> Nodes:
        """Hear of what has changed."""
        packet = self._reader.read()
        if packet is not None:
            self.nodes.take(packet)
        return self.nodes

    def __call__(self, name: str, check: Callable[[dict], object] = lambda node: True) -> dict:
        """A node below the world, as soon as it is as it should be."""
        name = f"/world/{name}".rstrip("/")

        def is_so() -> bool:
            try:
                return bool(check(self.update()[name]))
            except KeyError:  # the node, or what is asked of it, is not there yet
                return False

        wait_for(is_so)
        return self.nodes[name]


@pytest.fixture
def look(tree: SpaceTree) -> Look:
    """A browser's view of the scene."""
    return Look(tree)
