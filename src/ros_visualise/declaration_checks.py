"""Refuses what a node or a source declares of itself, where it could not work."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ros_visualise.data import MESSAGES, Image
from ros_visualise.errors import UsageError
from ros_visualise.joining import EACH, Join, Latest


def check_name(what: str, name: str) -> None:
    """Refuse a name that cannot stand in a topic, as it does.

    Raises:
        UsageError: it is such a name.
    """
    if not re.fullmatch("[A-Za-z][A-Za-z0-9_]*", name):
        raise UsageError(f"{what}: a name is made of letters, digits and _, and begins by a letter")


def check_kinds(name: str, ports: Mapping[str, Any]) -> None:
    """Refuse inputs or outputs of a node that are no messages, or not called as a topic may be.

    Raises:
        UsageError: there is such a one.
    """
    for port, kind in ports.items():
        check_name(f"node {name}: {port}", port)
        if kind not in MESSAGES:
            there = ", ".join(message.__name__ for message in MESSAGES)
            given = getattr(kind, "__name__", repr(kind))
            raise UsageError(f"node {name}: {given} is no message; choose from {there}")


def check_join(name: str, join: Join, inputs: Mapping[str, type]) -> None:
    """Refuse what cannot join the inputs of a node.

    Raises:
        UsageError: it cannot.
    """
    if not isinstance(join, Join):
        ways = "Each(), Exact(), Approx(SECONDS) or Latest(INPUT)"
        raise UsageError(f"node {name}: join={join}: give {ways} of ros_visualise.joining")
    if join != EACH and len(inputs) < 2:
        there = ", ".join(inputs) or "none"
        raise UsageError(f"node {name}: {join} joins several inputs, and this node has {there}")
    if isinstance(join, Latest) and join.trigger not in inputs:
        raise UsageError(f"node {name}: no input {join.trigger!r}; choose from {', '.join(inputs)}")


def check_calibrated(name: str, calibrated: bool, inputs: Mapping[str, type]) -> None:
    """Refuse calibrations for a node that takes no images.

    Raises:
        UsageError: it takes none.
    """
    if calibrated and Image not in inputs.values():
        raise UsageError(f"node {name}: calibrated=True is for inputs of type Image; it has none")


def check_step(name: str, target: Any, given: Sequence[str]) -> None:
    """Refuse a step that does not take what it is given by name.

    Raises:
        UsageError: it does not.
    """
    is_class = isinstance(target, type)
    step = getattr(target, "step", None) if is_class else target
    if step is None:
        raise UsageError(f"node {name}: the class {target.__name__} has no method step")
    if twice := [one for one in given if given.count(one) > 1]:
        raise UsageError(f"node {name}: its step is given {twice[0]} already; rename the input")
    _check_call(f"node {name}: its step", step, [None] if is_class else [], given)


def check_made(name: str, target: Any) -> None:
    """Refuse a class that is not made from the parameters.

    Raises:
        UsageError: it is not.
    """
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
        raise UsageError(f"{what} is given {given}, but takes {takes or 'nothing'}") from None
