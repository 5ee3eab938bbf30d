"""Checks of declarations: each raises UsageError for one that could not work."""

from __future__ import annotations

import dataclasses
import inspect
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from ros_visualise.core.errors import ParameterError, UsageError
from ros_visualise.core.message import Message, topic_kinds
from ros_visualise.core.params import specs
from ros_visualise.core.synchronizer import EACH, Latest, SyncPolicy


def check_name(what: str, name: str) -> None:
    """Check that a name can be part of a topic."""
    if not re.fullmatch("[A-Za-z][A-Za-z0-9_]*", name):
        raise UsageError(f"{what}: invalid name; use letters, digits and _, starting with a letter")


def check_ports(
    name: str, inputs: Mapping[str, Any], outputs: Mapping[str, Any], named: Iterable[str]
) -> None:
    """Check inputs and outputs, and that ``named`` ones are outputs."""
    for port in named:
        if port not in outputs:
            raise UsageError(f"node {name}: no output {port!r}; choose from {', '.join(outputs)}")
    _check_kinds(name, inputs)
    _check_kinds(name, outputs)


def _check_kinds(name: str, ports: Mapping[str, Any]) -> None:
    """Check the names of inputs or outputs, and that their types are messages."""
    for port, kind in ports.items():
        check_name(f"node {name}: {port}", port)
        if kind not in (known := topic_kinds()):
            there = ", ".join(message.__name__ for message in known)
            given = getattr(kind, "__name__", repr(kind))
            raise UsageError(f"node {name}: {given} is not a message type; choose from {there}")


def check_sync(name: str, sync: SyncPolicy, inputs: Mapping[str, type]) -> None:
    """Check that a policy can match the messages of these inputs."""
    if not isinstance(sync, SyncPolicy):
        ways = "Each(), Exact(), Approximate(SECONDS) or Latest(INPUT)"
        raise UsageError(f"node {name}: invalid sync={sync}; use {ways} from ros_visualise.nodes")
    if sync != EACH and len(inputs) < 2:
        there = ", ".join(inputs) or "none"
        raise UsageError(f"node {name}: {sync} needs several inputs; this node has only: {there}")
    if isinstance(sync, Latest) and sync.trigger not in inputs:
        raise UsageError(f"node {name}: no input {sync.trigger!r}; choose from {', '.join(inputs)}")


def check_params(what: str, params: Any) -> None:
    """Check that parameters are a frozen dataclass of ``param(...)`` with valid defaults."""
    known = getattr(params, "__name__", repr(params))
    if not (isinstance(params, type) and dataclasses.is_dataclass(params)):
        raise UsageError(
            f"{what}: params={known} is not a dataclass; write @dataclass(frozen=True) above it"
        )
    if not params.__dataclass_params__.frozen:  # type: ignore[attr-defined]
        raise UsageError(f"{what}: {known} is not frozen; write @dataclass(frozen=True) above it")
    for field in dataclasses.fields(params):
        if "help" not in field.metadata:
            raise UsageError(
                f"{what}: {known}.{field.name}: write {field.name}: TYPE = param(DEFAULT, HELP)"
            )
    for spec in specs(params):
        try:
            spec.coerce(spec.default)
        except ParameterError as error:
            raise UsageError(f"{what}: {known}: the default {error}") from None


def check_topics(name: str, topics: Mapping[str, str]) -> None:
    """Check the topics that a declaration gives to outputs."""
    for output, topic in topics.items():
        if not re.fullmatch("/?[A-Za-z][A-Za-z0-9_]*(/[A-Za-z][A-Za-z0-9_]*)*", topic):
            raise UsageError(
                f"node {name}: topics={{{output!r}: {topic!r}}}: invalid topic name; write /NAME"
            )


def check_inputs(
    name: str, target: Any, inputs: Sequence[str], sync: SyncPolicy, extras: Sequence[str]
) -> None:
    """Check that the step takes the inputs: all at once or, if each comes alone, any of them."""
    if sync != EACH or len(inputs) < 2:
        check_step(name, target, [*inputs, *extras])
        return
    for port in inputs:
        try:
            check_step(name, target, [port, *extras])
        except UsageError as error:
            raise UsageError(
                f"{error}: messages arrive one at a time; to match them by stamp, add sync=Exact(),"
                f" Approximate(SECONDS) or Latest({inputs[0]!r}); otherwise give every input the"
                " default None"
            ) from None


def check_calibrated(name: str, calibrated: bool, inputs: Mapping[str, type[Message]]) -> None:
    """Check that a node with calibrated images takes images."""
    if calibrated and not any(kind.has_calibration for kind in inputs.values()):
        raise UsageError(f"node {name}: calibrated=True needs an input of type Image")


def check_step(name: str, target: Any, given: Sequence[str]) -> None:
    """Check that the step of a node takes its arguments by name."""
    is_class = isinstance(target, type)
    step = getattr(target, "step", None) if is_class else target
    if step is None:
        needs = f"needs a method step({', '.join(['self', *given])})"
        raise UsageError(f"node {name}: the class {target.__name__} {needs}")
    if twice := [one for one in given if given.count(one) > 1]:
        raise UsageError(
            f"node {name}: its step function already has a parameter {twice[0]}; rename the input"
        )
    _check_call(f"node {name}: its step", step, [None] if is_class else [], given)


def check_made(name: str, target: Any) -> None:
    """Check that a class is made from the parameters."""
    if isinstance(target, type):
        _check_call(f"node {name}: its __init__", target, ["params"], [])


def _check_call(
    what: str, called: Callable[..., Any], by_place: Sequence[str | None], by_name: Sequence[str]
) -> None:
    signature = inspect.signature(called)
    try:
        signature.bind(*by_place, **dict.fromkeys(by_name))
    except TypeError:
        given = ", ".join(one for one in (*by_place, *by_name) if one)
        takes = ", ".join(one for one in signature.parameters if one != "self")
        raise UsageError(f"{what} must take {given}, not {takes or 'nothing'}") from None
