"""The report of a run: figures of its topics, nodes and recordings.

Summary, ``--json``, page and ``/diagnostics`` are all rendered from it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from ros_visualise.core.supervision import PROCESS


@dataclass(frozen=True)
class TopicReport:
    """Counts and rates of a topic; ``hz`` goes by the stamps, ``wall_hz`` by the wall clock."""

    type: str
    messages: int
    hz: float | None
    wall_hz: float | None


@dataclass(frozen=True)
class OutputReport:
    """Rates of a topic that a node publishes, and messages dropped on the way to subscribers."""

    hz: float | None = None
    wall_hz: float | None = None
    dropped: int = 0


@dataclass(frozen=True)
class TravelReport:
    """Distance and speeds of a robot, and the number of its rejected poses."""

    length_m: float
    duration_s: float
    mean_mps: float | None
    top_mps: float | None
    refused: int


@dataclass(frozen=True)
class NodeReport:
    """Figures of a node.

    Attributes:
        received, processed: messages.
        dropped: reason -> messages that it did not process, or answered with nothing.
        p50_ms, p99_ms: median and 99th percentile of the time from the source to the end of a step.
        step_ms: median duration of a step.
        errors: errors outside of messages, as at its end.
        own: the node's own figures.
        inputs: name of an input -> topic.
        outputs: topic -> its rates; the main output first.
        gate: reason of the drops that the node is there for, as it declares.
    """

    received: int = 0
    processed: int = 0
    dropped: Mapping[str, int] = field(default_factory=dict)
    p50_ms: float | None = None
    p99_ms: float | None = None
    step_ms: float | None = None
    errors: int = 0
    own: Mapping[str, Any] = field(default_factory=dict)
    inputs: Mapping[str, str] = field(default_factory=dict)
    outputs: Mapping[str, OutputReport] = field(default_factory=dict)
    gate: str | None = None

    @property
    def lost(self) -> int:
        """Messages dropped for another reason than its gate."""
        return sum(count for reason, count in self.dropped.items() if reason != self.gate)

    @property
    def requested_hz(self) -> float | None:
        """Target rate, of a node that controls one."""
        return self.own.get("requested_hz")

    @property
    def achieved_hz(self) -> float | None:
        """Rate of its main output, by the stamps."""
        return next((output.hz for output in self.outputs.values()), None)

    @property
    def ended(self) -> bool:
        """True for a remote source that waits at its end to be played again."""
        return bool(self.own.get("ended"))

    @property
    def travel(self) -> TravelReport | None:
        """Distance and speeds, of a node that measures a robot's path."""
        names = TravelReport.__dataclass_fields__
        if not names.keys() <= self.own.keys():
            return None
        return TravelReport(**{name: self.own[name] for name in names})

    @property
    def unread(self) -> Sequence[str]:
        """Notes on unreadable parts of a recording."""
        return tuple(self.own.get("lost", {}).get("notes", ()))

    @property
    def is_incomplete(self) -> bool:
        """True if messages could not be read, played or decoded."""
        unread, unplayed = self.own.get("lost"), self.own.get("unplayed")
        return bool(unread or unplayed or self.dropped.get("damaged"))

    def figures(self) -> dict[str, Any]:
        """Its figures by name, the node's own among them; some are mappings."""
        figures = {
            "received": self.received,
            "processed": self.processed,
            "dropped": dict(self.dropped),
            "errors": self.errors,
            "p50_ms": self.p50_ms,
            "p99_ms": self.p99_ms,
            "step_ms": self.step_ms,
            **self.own,
        }
        if self.outputs:
            figures["achieved_hz"] = self.achieved_hz
        return figures


@dataclass(frozen=True)
class RecordingReport:
    """Counts of a recording.

    ``refused`` are the dropped messages that the file cannot hold; the others were dropped because
    writing was too slow. ``files`` is the number of files written.
    """

    messages: int
    dropped: int
    refused: int = 0
    files: int = 1


@dataclass(frozen=True)
class RunReport:
    """Figures of topics and nodes by their names, and of recordings by their files.

    ``unknown`` are topics of a remote graph with unsupported types, and those types.
    """

    topics: Mapping[str, TopicReport]
    nodes: Mapping[str, NodeReport]
    recordings: Mapping[str, RecordingReport] = field(default_factory=dict)
    unknown: Mapping[str, str] = field(default_factory=dict)

    @property
    def is_incomplete(self) -> bool:
        """True if messages could not be read, played, decoded or recorded.

        Messages that a node drops by its gate, or because it is busy, do not count.
        """
        unrecorded = any(recording.dropped for recording in self.recordings.values())
        return unrecorded or any(node.is_incomplete for node in self.nodes.values())


def to_json(report: RunReport) -> dict[str, Any]:
    """A run report in the layout of ``--json``, with the failures of this process."""
    return {
        "topics": {name: asdict(topic) for name, topic in report.topics.items()},
        "nodes": {name: node.figures() for name, node in report.nodes.items()},
        "recordings": {path: asdict(one) for path, one in report.recordings.items()},
        "failures": [{**one._asdict(), "count": n} for one, n in PROCESS.failures.items()],
    }
