"""Declarations of nodes; `ros_visualise.nodes` explains how one is written."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar

from ros_visualise.core.checks import (
    check_calibrated,
    check_inputs,
    check_made,
    check_name,
    check_params,
    check_ports,
    check_sync,
    check_topics,
)
from ros_visualise.core.deprecation import deprecated
from ros_visualise.core.errors import UsageError
from ros_visualise.core.message import Message
from ros_visualise.core.synchronizer import EACH, SyncPolicy

T = TypeVar("T")

TRANSFORMS = dict.fromkeys(("tf", "tf_static"), "tf2_msgs/msg/TFMessage")
"""Inputs of a node with frames, and their ROS type."""


@dataclass(frozen=True)
class NoParams:
    """Parameters of a node without any."""


@dataclass(frozen=True)
class NodeType:
    """A declared node.

    Attributes:
        make: creates the node from its parameters.
        on_demand: outputs that are computed only while they have subscribers.
        latched: outputs whose last message is kept for late subscribers.
        drops: reason under which a result of None counts as a dropped message, such as ``rate``;
            None: it is no drop.
        timed: True if ``step`` takes the arrival time of the message.
        stateless: True if the result depends only on the message and the parameters.
        doc: first line of the docstring.
        actions: name and help of each action.
        stepped: inputs whose messages ``step`` takes: all but `TRANSFORMS`.
        sync: policy by which the messages of the inputs are matched.
        frames: True if ``step`` takes a frame tree, built from the inputs `TRANSFORMS`.
        calibrated: True if images come with their calibration, even where it is a separate topic.
        topics: output -> topic, if not derived from the names of node and output
            (see `ros_visualise.graph.place`).
        splittable: True if parts of a recording give the results of the whole, after a while.
        optional: inputs that may be missing: those for which the step has a default.
        live: True if ``tick`` brings messages from outside: in any graph it is called 200 times a
            second, each time until it answers with none.
    """

    name: str
    make: Callable[[Any], Any]
    params: type
    inputs: Mapping[str, type[Message]]
    outputs: Mapping[str, type[Message]]
    on_demand: frozenset[str] = frozenset()
    drops: str | None = None
    timed: bool = False
    stateless: bool = True
    doc: str = ""
    latched: frozenset[str] = frozenset()
    actions: Mapping[str, str] = field(default_factory=dict)
    stepped: Mapping[str, type[Message]] = field(default_factory=dict)
    sync: SyncPolicy = EACH
    frames: bool = False
    calibrated: bool = False
    topics: Mapping[str, str] = field(default_factory=dict)
    splittable: bool = True
    live: bool = False
    optional: frozenset[str] = frozenset()


class _OptionalMethods:
    """Defaults of a node's optional methods."""

    def reset(self) -> None:
        pass

    def finish(self) -> Any:
        return None

    def tick(self, params: Any) -> Any:
        return None

    def report(self) -> dict[str, Any]:
        return {}


class _Function(_OptionalMethods):
    def __init__(self, function: Any) -> None:
        self.step = function


def node(
    name: str,
    *,
    inputs: Mapping[str, type[Message]],
    outputs: Mapping[str, type[Message]],
    params: type = NoParams,
    on_demand: tuple[str, ...] = (),
    latched: tuple[str, ...] = (),
    drops: str | None = None,
    timed: bool = False,
    sync: SyncPolicy = EACH,
    frames: bool = False,
    calibrated: bool = False,
    topics: Mapping[str, str] | None = None,
    splittable: bool = True,
    live: bool = False,
    join: SyncPolicy | None = None,
) -> Callable[[T], T]:
    """Declare the decorated function or class as a node; see `NodeType`.

    ``join`` is the former name of ``sync``.

    Raises:
        UsageError: an invalid name, an input or output that is not a message, an unknown output, a
            policy without inputs to match, or a class or step with the wrong arguments.
    """
    if join is not None:
        deprecated(f"node {name}: join=", "sync=")
        sync = join
    check_name(f"node {name}", name)
    check_ports(name, inputs, outputs, (*on_demand, *latched, *(topics or {})))
    check_sync(name, sync, inputs)
    check_params(f"node {name}", params)
    check_topics(name, topics or {})
    check_calibrated(name, calibrated, inputs)
    extras = ["params", *(["arrival_ns"] if timed else []), *(["frames"] if frames else [])]
    transforms = {port: Message.kinds[kind] for port, kind in TRANSFORMS.items() if frames}

    def declare(target: T) -> T:
        check_made(name, target)
        check_inputs(name, target, [*inputs], sync, extras)
        target.declared = NodeType(  # type: ignore[attr-defined]
            name,
            _maker(target),
            params,
            {**inputs, **transforms},
            outputs,
            frozenset(on_demand),
            drops,
            timed,
            stateless=not isinstance(target, type),
            doc=first_line(target),
            latched=frozenset(latched),
            actions=actions_of(target),
            stepped=inputs,
            sync=sync,
            frames=frames,
            calibrated=calibrated,
            topics=topics or {},
            splittable=splittable,
            live=live,
            optional=_optional(target, inputs),
        )
        return target

    return declare


def _maker(target: Any) -> Callable[[Any], Any]:
    """A function that creates the node from its parameters."""
    if isinstance(target, type):
        return completed(target, _OptionalMethods)
    return lambda _: _Function(target)


def _optional(target: Any, inputs: Mapping[str, type[Message]]) -> frozenset[str]:
    """Inputs for which the step has a default."""
    parameters = inspect.signature(getattr(target, "step", target)).parameters
    having = [name for name, one in parameters.items() if one.default is not one.empty]
    return frozenset(inputs) & frozenset(having)


def declaration_of(target: Any) -> NodeType:
    """The declaration of a node, or of a function or class that was decorated as one.

    Raises:
        UsageError: neither.
    """
    found = getattr(target, "declared", target)
    if not isinstance(found, NodeType):
        name = getattr(target, "__name__", repr(target))
        raise UsageError(f"{name}: not a node; decorate it with @node(NAME, inputs=, outputs=)")
    return found


def action(help: str) -> Callable[[T], T]:
    """Declare the decorated method as an action: a button, or a service on a graph.

    A method of a node that has an argument ``params`` is given the node's present parameters.

    Args:
        help: what it does, in a few words.
    """

    def declare(method: T) -> T:
        method.action = help  # type: ignore[attr-defined]
        return method

    return declare


def completed(cls: type, optional: type) -> type:
    """Subclass with defaults from ``optional`` for the methods that ``cls`` lacks."""
    return type(cls.__name__, (cls, optional), {})


def actions_of(target: Any) -> dict[str, str]:
    """Name and help of each action of a class and its base classes; empty for a function."""
    found: dict[str, str] = {}
    for cls in inspect.getmro(target) if isinstance(target, type) else ():
        for name, method in vars(cls).items():
            help = getattr(method, "action", None)
            if isinstance(help, str):
                found.setdefault(name, help)
    return found


def first_line(target: Any) -> str:
    """First line of a docstring."""
    return (inspect.getdoc(target) or "").partition("\n")[0]
