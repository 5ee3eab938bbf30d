"""The seam between the nodes, what runs them, and who looks on."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, Protocol

from ros_visualise.core.errors import RecordingError
from ros_visualise.core.params import Parameters
from ros_visualise.graph import Graph
from ros_visualise.runtime.report import RunReport
from ros_visualise.sinks.parts import Split
from ros_visualise.sources.playback import Playback


class Subscription(Protocol):
    """The newest messages of one topic, for whoever looks on; it never holds up a node."""

    @property
    def epoch(self) -> int:
        """How often time had jumped before the message taken last."""

    def take(self, timeout_s: float, decode: bool = True) -> Any | None:
        """The oldest message that waits; None if none came in time or the topic ended.

        It is of the topic's class, decoded where it comes from a recording, unless ``decode`` is
        false: then it may be a `Recorded`.
        """

    def close(self) -> None:
        """End it."""


class ActiveRecording(Protocol):
    """A file that is being written."""

    @property
    def path(self) -> Path:
        """The file."""

    @property
    def files(self) -> int:
        """How many files it is in by now."""

    @property
    def written(self) -> int:
        """Messages written so far."""

    @property
    def dropped(self) -> int:
        """Messages that were not written, for want of time or as the file cannot hold them."""

    @property
    def refused(self) -> int:
        """Those of the dropped messages that the file cannot hold."""

    @property
    def error(self) -> RecordingError | None:
        """What ended it early, if anything did."""


class Runtime(Protocol):
    """A running graph, as page, windows and command line see it.

    Attributes:
        name: of the node that this process is where the graph runs elsewhere; else empty.
    """

    name: str

    @property
    def graph(self) -> Graph:
        """What runs."""

    @property
    def diagnostic_topics(self) -> Mapping[str, type]:
        """Topics of logs and diagnostics, which are not part of the graph, with their types."""

    @property
    def parameters(self) -> Mapping[str, Parameters[Any]]:
        """Node name -> its live parameters."""

    @property
    def playback(self) -> Playback | None:
        """None where the source cannot be paused or sought from here."""

    def subscribe(self, topic: str, depth: int = 1) -> Subscription:
        """Look at a topic; an on-demand output is made from now on.

        Args:
            topic: of the graph.
            depth: how many messages may wait to be taken; 1 is always the newest.
        """

    def publish(self, topic: str, message: Any) -> None:
        """Publish a message on a topic that comes from outside the graph; see ``graph.inputs``."""

    def act(self, node: str, action: str) -> None:
        """Run an action of a node."""

    def report(self, window_s: float | None = None) -> RunReport:
        """Topics and nodes with their counts, and rates of the whole run or of its last seconds."""

    def start_recording(
        self,
        path: str | Path,
        overwrite: bool = False,
        topics: Collection[str] = (),
        split: Split | None = None,
    ) -> ActiveRecording:
        """Record to a file from now on.

        Args:
            path, overwrite: as of `ros_visualise.sinks.open_recorder`.
            topics: those to record; none: those that are recorded where nobody chooses.
            split: when another file begins.

        Raises:
            OpenError: it exists or cannot be written.
        """

    def stop_recording(self, recording: Any) -> None:
        """End and close a recording that `start_recording` gave."""
