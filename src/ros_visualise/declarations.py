"""What a node or a source declares of itself; `ros_visualise.nodes` tells how it is written."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol, TypeVar

from ros_visualise.data import Message, Transforms
from ros_visualise.declaration_checks import (
    check_calibrated,
    check_join,
    check_kinds,
    check_made,
    check_name,
    check_step,
)
from ros_visualise.errors import UsageError
from ros_visualise.joining import EACH, Join
from ros_visualise.messages.recorded import TopicType
from ros_visualise.sources.series import Series

T = TypeVar("T")

VELOCITY_AXES = ("linear.x", "linear.y", "linear.z", "angular.z")
"""Components of a Twist along and about which a robot may be driven."""

TRANSFORMS = {"tf": Transforms, "tf_static": Transforms}
"""The inputs from which a node with frames knows them."""


@dataclass(frozen=True)
class NoParams:
    """The parameters of a node that has none."""


@dataclass(frozen=True)
class NodeType:
    """A declared node.

    ``on_demand`` names the outputs that are only made while somebody wants them; ``latched`` those
    whose last message holds until the next, so that whoever comes later gets it; ``drops`` is the
    reason under which an answer of None is counted, where that means a dropped message;
    ``timed`` where its step wants to know when a message came; ``stateless`` where the
    same message and parameters always give the same answer; ``actions`` are the names of its
    actions, and what each does. ``stepped`` are the inputs whose messages its step is given, and
    ``join`` is how they come together; ``frames`` where it is also given the frames that there are,
    which come by the inputs of `TRANSFORMS`. ``calibrated`` where its images are to come with their
    calibration, also on a graph on which that is a topic of its own. ``topics`` maps outputs to
    topics, where these do not follow from its name and the outputs' (`ros_visualise.graph.place`).
    """

    name: str
    make: Callable[[Any], Any]
    params: type
    inputs: Mapping[str, type]
    outputs: Mapping[str, type]
    on_demand: frozenset[str] = frozenset()
    drops: str | None = None
    timed: bool = False
    stateless: bool = True
    doc: str = ""
    latched: frozenset[str] = frozenset()
    actions: Mapping[str, str] = field(default_factory=dict)
    stepped: Mapping[str, type[Message]] = field(default_factory=dict)
    join: Join = EACH
    frames: bool = False
    calibrated: bool = False
    topics: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class SourceType:
    """A declared source; ``live`` where it cannot wait for whoever is slow, as a camera.

    ``makes_time`` where its messages tell what time it is, as those of a recording and of a
    simulation; else they are stamped with the time that there is. ``ros`` are the types of those
    outputs for which their class does not say it, as of a recording. ``velocity_axes`` are those of
    `VELOCITY_AXES` along which it follows a Twist: only a robot has any. ``seamless`` where its end
    leads back to its start, so that it is looped while somebody looks on. ``extend`` is the name of
    a parameter that brings more of them, and what gives the parameters with these. ``recording`` is
    the file or folder that it plays, which can be opened once more; its outputs are the topics.
    ``series`` are those of its outputs that are known whole, by the times at which they are played.
    """

    name: str
    make: Callable[[Any, Any], Source]
    params: type
    outputs: Mapping[str, type]
    live: bool = False
    doc: str = ""
    inputs: Mapping[str, type] = field(default_factory=dict)
    on_demand: frozenset[str] = frozenset()
    latched: frozenset[str] = frozenset()
    actions: Mapping[str, str] = field(default_factory=dict)
    ros: Mapping[str, TopicType] = field(default_factory=dict)
    makes_time: bool = False
    velocity_axes: tuple[str, ...] = ()
    seamless: bool = False
    extend: tuple[str, Callable[[Any], Any]] | None = None
    recording: Path | None = None
    series: Sequence[Series] = ()


class Source(Protocol):
    """What a declared source class offers to a runtime."""

    def messages(self) -> Iterator[tuple[str, Any]]:
        """(Output name, message) until the end."""

    def close(self) -> None:
        """Let go of what is open; may be called from any thread."""

    def receive(self, port: str, message: Any) -> None:
        """Take a message of an input; may be called from any thread."""

    def awaits(self, port: str) -> bool:
        """Whether what nodes make of its messages, and tell it on an input, decides how it goes on.

        Then it hears that before it gives its next message.
        """

    def configure(self, params: Any, changed: Collection[str]) -> None:
        """Take over changed parameters, or raise ParameterError; may be called from any thread."""

    def set_demand(self, is_wanted: Callable[[str], bool]) -> None:
        """Make costly messages only while ``is_wanted``, asked with the output's name, says so."""

    def report(self) -> dict[str, Any]:
        """Figures of its own for the run report."""


class _Optional:
    """What a node's or a source's class may leave out."""

    def reset(self) -> None:
        pass

    def finish(self) -> Any:
        return None

    def tick(self, params: Any) -> Any:
        return None

    def receive(self, port: str, message: Any) -> None:
        pass

    def awaits(self, port: str) -> bool:
        return False

    def configure(self, params: Any, changed: Collection[str]) -> None:
        pass

    def set_demand(self, is_wanted: Callable[[str], bool]) -> None:
        pass

    def report(self) -> dict[str, Any]:
        return {}


class _Function(_Optional):
    def __init__(self, function: Callable[..., Any]) -> None:
        self.step = function


def node(
    name: str,
    *,
    inputs: Mapping[str, type],
    outputs: Mapping[str, type],
    params: type = NoParams,
    on_demand: tuple[str, ...] = (),
    latched: tuple[str, ...] = (),
    drops: str | None = None,
    timed: bool = False,
    join: Join = EACH,
    frames: bool = False,
    calibrated: bool = False,
    topics: Mapping[str, str] | None = None,
) -> Callable[[T], T]:
    """Declare the decorated function or class as a node; see `NodeType`.

    Raises:
        UsageError: the name is none that ROS takes too, an input or output is not a message of
            `ros_visualise.data`, there is no such output, nothing to join, or the class or its
            step does not take what it is given.
    """
    check_name(f"node {name}", name)
    for port in (*on_demand, *latched, *(topics or {})):
        if port not in outputs:
            raise UsageError(f"node {name}: no output {port!r}; choose from {', '.join(outputs)}")
    check_kinds(name, inputs)
    check_kinds(name, outputs)
    check_join(name, join, inputs)
    check_calibrated(name, calibrated, inputs)
    extras = ["params", *(["arrival_ns"] if timed else []), *(["frames"] if frames else [])]

    def declare(target: T) -> T:
        check_made(name, target)
        for given in [[port] for port in inputs] if join == EACH else [[*inputs]]:
            check_step(name, target, [*given, *extras])
        target.declared = NodeType(  # type: ignore[attr-defined]
            name,
            _completed(target) if isinstance(target, type) else lambda _: _Function(target),  # type: ignore[arg-type]
            params,
            {**inputs, **(TRANSFORMS if frames else {})},
            outputs,
            frozenset(on_demand),
            drops,
            timed,
            stateless=not isinstance(target, type),
            doc=_first_line(target),
            latched=frozenset(latched),
            actions=_actions_of(target),
            stepped=inputs,
            join=join,
            frames=frames,
            calibrated=calibrated,
            topics=topics or {},
        )
        return target

    return declare


def source(
    name: str,
    *,
    params: type,
    outputs: Mapping[str, type],
    inputs: Mapping[str, type] | None = None,
    on_demand: tuple[str, ...] = (),
    latched: tuple[str, ...] = (),
    live: bool = False,
    makes_time: bool = False,
    velocity_axes: tuple[str, ...] = (),
    seamless: bool = False,
    extend: tuple[str, Callable[[Any], Any]] | None = None,
) -> Callable[[T], T]:
    """Declare the decorated class as a source; see `SourceType`.

    Raises:
        UsageError: the name is none that ROS takes too, or one of ``velocity_axes`` is none of
            `VELOCITY_AXES`.
    """
    check_name(f"source {name}", name)
    for axis in velocity_axes:
        if axis not in VELOCITY_AXES:
            there = ", ".join(VELOCITY_AXES)
            raise UsageError(f"source {name}: no velocity axis {axis!r}; choose from {there}")

    def declare(target: T) -> T:
        target.declared = SourceType(  # type: ignore[attr-defined]
            name,
            _completed(target),  # type: ignore[arg-type]
            params,
            outputs,
            live,
            doc=_first_line(target),
            inputs=inputs or {},
            on_demand=frozenset(on_demand),
            latched=frozenset(latched),
            actions=_actions_of(target),
            makes_time=makes_time,
            velocity_axes=velocity_axes,
            seamless=seamless,
            extend=extend,
        )
        return target

    return declare


def action(help: str) -> Callable[[T], T]:
    """Declare the decorated method as an action: something that a person may ask a node to do.

    Args:
        help: what it does, in a few words.
    """

    def declare(method: T) -> T:
        method.action = help  # type: ignore[attr-defined]
        return method

    return declare


def _completed(cls: type) -> type:
    """The class, with what it leaves out."""
    return type(cls.__name__, (cls, _Optional), {})


def _actions_of(target: Any) -> dict[str, str]:
    """Name -> help of each action of a class, its base classes' included; a function has none."""
    found: dict[str, str] = {}
    for cls in inspect.getmro(target) if isinstance(target, type) else ():
        for name, method in vars(cls).items():
            help = getattr(method, "action", None)
            if isinstance(help, str):
                found.setdefault(name, help)
    return found


def _first_line(target: Any) -> str:
    return (inspect.getdoc(target) or "").partition("\n")[0]
