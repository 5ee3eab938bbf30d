"""User interfaces: the web page, OpenCV windows, or only a progress bar."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from ros_visualise.core.errors import OpenError, UsageError
from ros_visualise.core.yaml_files import open_yaml
from ros_visualise.graph import Graph
from ros_visualise.runtime.base import Runtime
from ros_visualise.sinks.names import record_folder
from ros_visualise.ui.file_chooser import FileChooser

Value = bool | int | float | str
Arrangement = Mapping[str, Value]
"""Place of an element, such as ``filters/threshold`` or ``windows/path`` -> its value."""
_SPIN_S = 0.1


class View(Protocol):
    """One way to look at a running graph. All calls come from the main thread."""

    stays: bool
    """True if it stays open when the source has ended."""

    @property
    def closed(self) -> bool:
        """True once a person has closed it; then the run ends."""

    @property
    def awaited(self) -> bool:
        """True until the first browser connects."""

    def open(self, runtime: Runtime) -> None:
        """Show this graph from now on."""

    def spin(self, timeout_s: float) -> None:
        """Do the work for the main thread, for so long or shorter."""

    def close(self) -> None:
        """Close it."""


@dataclass(frozen=True)
class ViewOptions:
    """Options of a view.

    Attributes:
        host, port: the address of the page.
        origins: other web sites that may use the page.
        record_dir: the only folder for recordings and uploads of the page.
        title: of the browser's tab.
        browser: open one.
        arrangement: initial settings of the page.
        place: of windows on the screen; see `ros_visualise.ui.windows.Windows`.
        flag: the form of a command-line option, for hints, with a name and a value to fill in.
        chooser: the files that can be opened from the page; None: none.
        token: the page opens by addresses with a token only.
        urdf: a file that describes the robot to draw.
        tiles: address or MBTiles file of the map's tiles; empty: none.
        control: browsers may publish any messages.

    Raises:
        OpenError: the folder to record to is missing.
    """

    host: str = "127.0.0.1"
    port: int = 8080
    origins: Collection[str] = ()
    record_dir: Path = Path()
    title: str = "ros_visualise"
    browser: bool = False
    arrangement: Arrangement = field(default_factory=dict)
    place: str = ""
    flag: str = "--{} {}"
    chooser: FileChooser | None = None
    token: bool = True
    urdf: Path | None = None
    tiles: str = ""
    control: bool = False

    def __post_init__(self) -> None:
        record_folder(self.record_dir)


def open_view(name: str, options: ViewOptions) -> View:
    """The view called ``web``, ``windows`` or ``none``.

    Raises:
        OpenError: the port is in use, the robot cannot be read, or the display is missing.
        UsageError: an unknown view, place or origin.
    """
    if name == "web":
        from ros_visualise.ui.page import Page

        return Page(options)
    if name == "windows":
        from ros_visualise.ui.windows import Windows

        return Windows(options.place)
    if name == "none":
        from ros_visualise.ui.progress import Progress

        return Progress()
    raise UsageError(f"view={name}: choose web, windows or none")


def read_arrangement(path: Path) -> Arrangement:
    """The settings in a YAML file that the page has saved.

    Raises:
        OpenError: it cannot be read, or has another form.
    """
    found = open_yaml(path, "give a file written by 'Save layout'") or {}
    is_one = isinstance(found, dict) and all(isinstance(name, str) for name in found)
    if not is_one or not all(isinstance(value, Value) for value in found.values()):
        raise OpenError(
            f"{path}: must contain lines of the form SETTING: VALUE, such as windows/path: false"
        )
    return dict(found)


def watch(
    runtime: Runtime, open_one: Callable[[], View], is_over: Callable[[], bool], reopens: bool
) -> None:
    """Show a graph that others change, until it is over or a person closes the view.

    To be called on the main thread.

    Args:
        runtime: its ``graph`` is another object after each change.
        open_one: opens a view.
        is_over: True to end.
        reopens: reopen the view to follow a change; it is open only while there is a topic to show.

    Raises:
        OpenError: the view cannot be opened.
    """
    view: View | None = None
    shown: Graph | None = None
    try:
        while not is_over() and not (view is not None and view.closed):
            graph = runtime.graph
            if view is not None and reopens and shown is not graph:
                view.close()
                view = None
            if view is None and (graph.topics or not reopens):
                view, shown = open_one(), graph
                view.open(runtime)
            if view is None:
                time.sleep(_SPIN_S)
            else:
                view.spin(_SPIN_S)
    finally:
        if view is not None:
            view.close()
