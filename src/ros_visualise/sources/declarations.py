"""Declarations of sources; `ros_visualise.nodes` explains how one is written."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol, TypeVar

from ros_visualise.core.checks import check_name, check_params
from ros_visualise.core.declarations import actions_of, completed, first_line
from ros_visualise.core.errors import UsageError
from ros_visualise.core.message import Message
from ros_visualise.messages.recorded import Recorded, TopicType
from ros_visualise.sources.recordings import Recording
from ros_visualise.sources.series import Series

T = TypeVar("T")

VELOCITY_AXES = ("linear.x", "linear.y", "linear.z", "angular.z")
"""Components of a Twist that a robot may follow."""


@dataclass(frozen=True)
class SourceType:
    """A declared source.

    Attributes:
        make: opens the source, given its parameters and the `Playback`.
        live: True if it cannot wait for slow consumers, like a camera.
        on_demand: outputs that are computed only while they have subscribers.
        latched: outputs whose last message is kept for late subscribers.
        actions: name and help of each action.
        ros: ROS types of outputs that do not follow from their class, as in a recording.
        makes_time: True if its messages set the clock, as in a recording or a simulation; otherwise
            they are stamped with the wall time.
        velocity_axes: the `VELOCITY_AXES` that it follows; for robots only.
        seamless: True if its end leads back to its start, so that it is looped while watched.
        extend: name of a parameter that brings further ones, and the function that adds them.
        recording: opens once more what it plays, with its present parameters. If it ``makes_time``
            its outputs are the topics, else the topics are those of its outputs.
        series: outputs that are known in advance, with their playback times.
        publishes: True if messages can be published where it comes from, by `Source.publish`.
        shown: outputs of images that a page shows from the start; empty: one of them.
    """

    name: str
    make: Callable[[Any, Any], Source]
    params: type
    outputs: Mapping[str, type[Message]]
    live: bool = False
    doc: str = ""
    inputs: Mapping[str, type[Message]] = field(default_factory=dict)
    on_demand: frozenset[str] = frozenset()
    latched: frozenset[str] = frozenset()
    actions: Mapping[str, str] = field(default_factory=dict)
    ros: Mapping[str, TopicType] = field(default_factory=dict)
    makes_time: bool = False
    velocity_axes: tuple[str, ...] = ()
    seamless: bool = False
    extend: tuple[str, Callable[[Any], Any]] | None = None
    recording: Callable[[Any], Recording] | None = None
    series: Sequence[Series] = ()
    publishes: bool = False
    shown: Sequence[str] = ()


class Source(Protocol):
    """An open source; all methods but `messages` and `close` have defaults."""

    def messages(self) -> Iterator[tuple[str, Any]]:
        """Iterate over (output name, message) until the end."""

    def close(self) -> None:
        """Release all resources; may be called from any thread."""

    def receive(self, port: str, message: Any) -> None:
        """Take a message of an input; may be called from any thread."""

    def awaits(self, port: str) -> bool:
        """True if the source needs the answers on this input to produce its next message.

        Each answer is then passed to `receive` before the next message is requested.
        """
        return False

    def configure(self, params: Any, changed: Collection[str]) -> None:
        """Apply changed parameters, or raise ParameterError; may be called from any thread."""

    def set_demand(self, is_wanted: Callable[[str], bool]) -> None:
        """Provide a test for outputs on demand: produce them only while it is true."""

    def report(self) -> dict[str, Any]:
        """Figures for the run report."""
        return {}

    def publish(self, topic: str, message: Recorded) -> None:
        """Publish a message where the source comes from; may be called from any thread."""


def source(
    name: str,
    *,
    params: type,
    outputs: Mapping[str, type[Message]],
    inputs: Mapping[str, type[Message]] | None = None,
    on_demand: tuple[str, ...] = (),
    latched: tuple[str, ...] = (),
    live: bool = False,
    makes_time: bool = False,
    velocity_axes: tuple[str, ...] = (),
    seamless: bool = False,
    extend: tuple[str, Callable[[Any], Any]] | None = None,
) -> Callable[[T], T]:
    """Declare the decorated class as a source; see `SourceType`; raises UsageError."""
    check_name(f"source {name}", name)
    check_params(f"source {name}", params)
    for axis in velocity_axes:
        if axis not in VELOCITY_AXES:
            there = ", ".join(VELOCITY_AXES)
            raise UsageError(f"source {name}: no velocity axis {axis!r}; choose from {there}")

    def declare(target: T) -> T:
        target.declared = SourceType(  # type: ignore[attr-defined]
            name,
            completed(target, Source),  # type: ignore[arg-type]
            params,
            outputs,
            live,
            doc=first_line(target),
            inputs=inputs or {},
            on_demand=frozenset(on_demand),
            latched=frozenset(latched),
            actions=actions_of(target),
            makes_time=makes_time,
            velocity_axes=velocity_axes,
            seamless=seamless,
            extend=extend,
        )
        return target

    return declare
