"""The interface of a running graph, which all runtimes have."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, Protocol

from ros_visualise.core.message import Message
from ros_visualise.core.params import Parameters
from ros_visualise.graph import Graph
from ros_visualise.runtime.recording import RecorderThread
from ros_visualise.runtime.report import RunReport
from ros_visualise.runtime.topics import Subscription
from ros_visualise.sinks.parts import Split
from ros_visualise.sources.playback import Playback


class Runtime(Protocol):
    """A running graph, as page, windows and command line see it.

    Attributes:
        name: of this process's node, if the graph is remote; else empty.
    """

    name: str

    @property
    def graph(self) -> Graph:
        """The running graph."""

    @property
    def diagnostic_topics(self) -> Mapping[str, type[Message]]:
        """Topics of logs and diagnostics, which are not part of the graph, with their types."""

    @property
    def parameters(self) -> Mapping[str, Parameters[Any]]:
        """Node name -> its live parameters."""

    @property
    def playback(self) -> Playback | None:
        """Playback of the source; None if it cannot be paused or sought from here."""

    def subscribe(self, topic: str, depth: int = 1) -> Subscription:
        """Look at a topic; an on-demand output is made from now on.

        Args:
            topic: of the graph.
            depth: number of messages that may wait to be taken; 1 is always the newest.
        """

    @property
    def publishes(self) -> bool:
        """True if `publish` takes any topic, and messages of any type as `Recorded`."""

    def publish(self, topic: str, message: Any) -> None:
        """Publish a message on a topic that comes from outside the graph; see ``graph.inputs``.

        Raises:
            RosVisualiseError: it cannot be published.
        """

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
    ) -> RecorderThread:
        """Record to a file from now on.

        Args:
            path, overwrite: as of `ros_visualise.sinks.open_recorder`.
            topics: topics to record; empty: the usual ones.
            split: the length or size of each file.

        Raises:
            OpenError: it exists or cannot be written.
        """

    def stop_recording(self, recording: RecorderThread) -> None:
        """End and close a recording that `start_recording` gave."""
