"""User interfaces: the web page, OpenCV windows, or only a progress bar."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from ros_visualise.core.errors import UsageError
from ros_visualise.runtime.base import Runtime
from ros_visualise.sinks.names import record_folder
from ros_visualise.ui.arrangements import Arrangement
from ros_visualise.ui.shelf import Shelf


class View(Protocol):
    """One way to look at a running graph. All calls come from the main thread."""

    stays: bool
    """Whether it stays open when the source has ended."""

    @property
    def closed(self) -> bool:
        """Whether a person closed it; then the run ends."""

    @property
    def awaited(self) -> bool:
        """Whether nobody has looked at it yet, but somebody may come."""

    def open(self, runtime: Runtime) -> None:
        """Show this graph from now on."""

    def spin(self, timeout_s: float) -> None:
        """Do what has to be done on the main thread, for so long or shorter."""

    def close(self) -> None:
        """Close it."""


@dataclass(frozen=True)
class ViewOptions:
    """How a view is opened.

    Attributes:
        host, port: where the page is served.
        origins: other web sites that may use the page.
        token: whether the page opens by addresses with a token alone.
        record_dir: the only folder in which the page records, and to which it uploads.
        shelf: the files that can be opened from the page; None: none.
        title: what is shown, for the browser's tab.
        browser: whether to open one.
        arrangement: how the page is arranged at first.
        place: where on the screen the windows open; see `ros_visualise.ui.windows.Windows`.
        urdf: a file that describes the robot to draw.
        flag: how a person gives another of these: its name and its value go in.

    Raises:
        OpenError: there is no such folder to record to.
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
    shelf: Shelf | None = None
    token: bool = True
    urdf: Path | None = None

    def __post_init__(self) -> None:
        record_folder(self.record_dir)


def open_view(name: str, options: ViewOptions) -> View:
    """The view called ``web``, ``windows`` or ``none``.

    Raises:
        OpenError: the port is in use, the robot cannot be read, or there is no screen for windows.
        UsageError: there is no such view, place or origin.
    """
    if name == "web":
        from ros_visualise.ui.page import Page
        from ros_visualise.ui.scene.urdf import read_urdf

        return Page(
            options.host,
            options.port,
            origins=options.origins,
            record_dir=options.record_dir,
            flag=options.flag,
            title=options.title,
            browser=options.browser,
            arrangement=options.arrangement,
            shelf=options.shelf,
            token=options.token,
            urdf=read_urdf(options.urdf) if options.urdf else "",
        )
    if name == "windows":
        from ros_visualise.ui.windows import Windows

        return Windows(options.place)
    if name == "none":
        from ros_visualise.ui.progress import Progress

        return Progress()
    raise UsageError(f"view={name}: choose web, windows or none")
