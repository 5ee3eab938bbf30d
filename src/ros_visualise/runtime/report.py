"""The run report: what went over the topics, what the nodes did, and what was recorded."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from ros_visualise.core.supervision import PROCESS

RATES = ("hz", "wall_hz")
"""Those of a topic: by the stamps, and by the wall clock."""

ENDED = "ended"
"""The figure of a source that says whether it waits at its end to be played again."""


@dataclass(frozen=True)
class TopicReport:
    """Counts and rates of a topic; ``hz`` goes by the stamps, ``wall_hz`` by the wall clock."""

    type: str
    messages: int
    hz: float | None
    wall_hz: float | None


@dataclass(frozen=True)
class TravelReport:
    """How far and how fast a robot went, and how many of its poses were refused."""

    length_m: float
    duration_s: float
    mean_mps: float | None
    top_mps: float | None
    refused: int


@dataclass(frozen=True)
class NodeReport:
    """What a node did.

    Attributes:
        received, processed: messages.
        dropped: reason -> messages that it did not process, or answered with nothing.
        p50_ms, p99_ms: median and 99th percentile of the time from the source to the end of a step.
        step_ms: the median of a step by itself.
        errors: how often it raised where no message was at stake, as at its end.
        own: figures of the node's own.
        publishes: whether it has outputs.
        achieved_hz: the rate of the first of them, by the stamps.
        gate: the reason for drops that it is there for, as it declares.
    """

    received: int = 0
    processed: int = 0
    dropped: Mapping[str, int] = field(default_factory=dict)
    p50_ms: float | None = None
    p99_ms: float | None = None
    step_ms: float | None = None
    errors: int = 0
    own: Mapping[str, Any] = field(default_factory=dict)
    publishes: bool = False
    achieved_hz: float | None = None
    gate: str | None = None

    @property
    def lost(self) -> int:
        """Messages that it dropped without being asked to."""
        return sum(count for reason, count in self.dropped.items() if reason != self.gate)

    @property
    def requested_hz(self) -> float | None:
        """The rate that a person asked for, where the node controls one."""
        return self.own.get("requested_hz")

    @property
    def ended(self) -> bool:
        """Whether it is a source elsewhere that waits at its end to be played again."""
        return bool(self.own.get(ENDED))

    @property
    def travel(self) -> TravelReport | None:
        """How far a robot went, where the node follows one."""
        names = TravelReport.__dataclass_fields__
        if not names.keys() <= self.own.keys():
            return None
        return TravelReport(**{name: self.own[name] for name in names})

    @property
    def unread(self) -> Sequence[str]:
        """What could not be read of a recording."""
        return tuple(self.own.get("lost", {}).get("notes", ()))

    @property
    def is_incomplete(self) -> bool:
        """Whether messages could not be read, played or processed, as they should have been."""
        unread, unplayed = self.own.get("lost"), self.own.get("unplayed")
        return bool(unread or unplayed or self.dropped.get("damaged"))


@dataclass(frozen=True)
class RecordingReport:
    """How many messages were recorded and dropped.

    ``refused`` are those of the dropped ones that the file cannot hold; for others there was no
    time. ``files`` is how many it is in.
    """

    messages: int
    dropped: int
    refused: int = 0
    files: int = 1


@dataclass(frozen=True)
class RunReport:
    """All of it: topics and nodes by their names, recordings by their files.

    ``unknown`` are topics elsewhere whose messages cannot be shown, with their types.
    """

    topics: Mapping[str, TopicReport]
    nodes: Mapping[str, NodeReport]
    recordings: Mapping[str, RecordingReport] = field(default_factory=dict)
    unknown: Mapping[str, str] = field(default_factory=dict)

    @property
    def is_incomplete(self) -> bool:
        """Whether messages could not be read, played, processed or recorded, as they should be.

        What a node leaves out as it was asked to, or for want of time, is not lost.
        """
        unrecorded = any(recording.dropped for recording in self.recordings.values())
        return unrecorded or any(node.is_incomplete for node in self.nodes.values())


def to_json(report: RunReport) -> dict[str, Any]:
    """A run report in the layout of ``--json``; with what failed beside the nodes' messages."""
    return {
        "topics": {name: asdict(topic) for name, topic in report.topics.items()},
        "nodes": {name: figures_of(node) for name, node in report.nodes.items()},
        "recordings": {path: asdict(one) for path, one in report.recordings.items()},
        "failures": [{**one._asdict(), "count": n} for one, n in PROCESS.failures.items()],
    }


def figures_of(node: NodeReport) -> dict[str, Any]:
    """A node's part of it: its own figures stand among the others."""
    return {
        "received": node.received,
        "processed": node.processed,
        "dropped": dict(node.dropped),
        "errors": node.errors,
        "p50_ms": node.p50_ms,
        "p99_ms": node.p99_ms,
        "step_ms": node.step_ms,
        **node.own,
        **({"achieved_hz": node.achieved_hz} if node.publishes else {}),
    }
