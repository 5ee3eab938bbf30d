"""The registry: a node or a source is declared once, with a decorator, in a file of its own.

    @node("edge_detector", params=EdgeParams, inputs={"image": Image}, outputs={"edges": Image})
    def edge_detector(image, params):
        '''Canny edges of one image.'''
        return ...

A node is a function or, where it keeps a state, a class with

- ``__init__(params)``,
- ``step(<an input by name>, params)``, called for each message, and where needed
- ``reset()``, when time has jumped backwards,
- ``finish()``, at the end of the stream,
- ``tick(params)``, now and then where messages come from outside, so that nobody knows whether
  another comes: what is due by now,
- ``report()``, figures of its own for the run report,
- methods decorated with `action`: buttons on the page, services on a ROS graph.

A node of several inputs gets each message alone, so its ``step`` has a default for each of them.
``step``, ``tick``, ``finish`` and actions answer with the message of its only output, with a dict
of output name to message, or with None: nothing for this one.

A source is a class with ``__init__(params, playback)``, which opens it or raises OpenError;
``messages()``, an iterator of (output name, message) until the source ends or ``playback`` is
closed; ``close()``; and where needed ``report()``, actions, ``receive(port, message)`` for the
inputs that it declares, and ``spare(wants)``, called before ``messages``: ``wants(output)`` tells
whether anybody listens to what is dear to make. Actions and ``receive`` are called from other
threads than ``messages``.
"""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import pkgutil
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any, Protocol, TypeVar

from ros_visualise.data import MESSAGES
from ros_visualise.errors import OpenError, UsageError
from ros_visualise.messages.recorded import TopicType

T = TypeVar("T")


@dataclass(frozen=True)
class NoParams:
    """The parameters of a node that has none."""


@dataclass(frozen=True)
class NodeType:
    """A declared node.

    ``on_demand`` names the outputs that are only made while somebody wants them; ``latched`` those
    whose last message holds until the next, so that whoever comes later gets it; ``drops`` is the
    reason under which an answer of None is counted, where that means a dropped message;
    ``stateless`` where the same message and parameters always give the same answer; ``actions``
    are the names of its actions, and what each does.
    """

    name: str
    make: Callable[[Any], Any]
    params: type
    inputs: Mapping[str, type]
    outputs: Mapping[str, type]
    on_demand: frozenset[str] = frozenset()
    drops: str | None = None
    stateless: bool = True
    doc: str = ""
    latched: frozenset[str] = frozenset()
    actions: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class SourceType:
    """A declared source; ``live`` where it cannot wait for whoever is slow, as a camera.

    ``makes_time`` where its messages tell what time it is, as those of a recording and of a
    simulation; else they are stamped with the time that there is. ``ros`` are the types of those
    outputs for which their class does not say it, as of a recording.
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


class Source(Protocol):
    """What a declared source class offers to a runtime."""

    def messages(self) -> Iterator[tuple[str, Any]]:
        """(Output name, message) until the end."""

    def close(self) -> None:
        """Let go of what is open; may be called from any thread."""

    def receive(self, port: str, message: Any) -> None:
        """Take a message of an input; may be called from any thread."""

    def spare(self, wants: Callable[[str], bool]) -> None:
        """Make no message for which nobody asks; ``wants`` tells of an output by its name."""

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

    def spare(self, wants: Callable[[str], bool]) -> None:
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
) -> Callable[[T], T]:
    """Declare the decorated function or class as a node; see the module's docstring.

    Raises:
        UsageError: an input or output is not a message of `ros_visualise.data`, or there is no
            such output.
    """
    for port in (*on_demand, *latched):
        if port not in outputs:
            raise UsageError(f"node {name}: no output {port!r}; there is {', '.join(outputs)}")
    for kind in (*inputs.values(), *outputs.values()):
        if kind not in MESSAGES:
            there = ", ".join(message.__name__ for message in MESSAGES)
            raise UsageError(f"node {name}: {kind.__name__} is no message; there is {there}")

    def declare(target: T) -> T:
        target.declared = NodeType(  # type: ignore[attr-defined]
            name,
            _completed(target) if isinstance(target, type) else lambda _: _Function(target),  # type: ignore[arg-type]
            params,
            inputs,
            outputs,
            frozenset(on_demand),
            drops,
            stateless=not isinstance(target, type),
            doc=_first_line(target),
            latched=frozenset(latched),
            actions=_actions_of(target),
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
) -> Callable[[T], T]:
    """Declare the decorated class as a source; see the module's docstring."""

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


def find(name: str) -> NodeType | SourceType:
    """The built-in node or source of that name, from its file ``nodes/<name>.py``."""
    module = importlib.import_module(f"{__name__}.{name}")
    return _declared_in(module)[name]


def find_all() -> list[NodeType | SourceType]:
    """Every built-in source and node, by name."""
    names = sorted(module.name for module in pkgutil.iter_modules(__path__))
    return [find(name) for name in names]


def load(path: str, name: str) -> NodeType:
    """A node of one's own, from ``path``; ``name`` is the function's, the class's or the node's.

    Raises:
        OpenError: there is no such file, or it does not run.
        UsageError: it declares no such node; those that it does are listed.
    """
    declared = _declared_in(_run_file(path))
    if name not in declared:
        there = ", ".join(sorted(declared)) or "none: decorate a function with @node"
        raise UsageError(f"{path} declares no node {name!r}; there is {there}")
    found = declared[name]
    if not isinstance(found, NodeType):
        raise UsageError(f"{path}: {name} is a source, not a node")
    return found


def _run_file(path: str) -> ModuleType:
    if not Path(path).is_file():
        raise OpenError.missing(path, "give a node as FILE.py:NAME")
    spec = importlib.util.spec_from_file_location(f"own_{Path(path).stem}", path)
    if spec is None or spec.loader is None:
        raise OpenError(f"{path}: not a Python file; give a node as FILE.py:NAME")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    sys.path.insert(0, str(Path(path).parent))  # as for a script: it may have files beside it
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        raise OpenError(f"{path}: {type(error).__name__}: {error}") from error
    return module


def _declared_in(module: ModuleType) -> dict[str, NodeType | SourceType]:
    found: dict[str, NodeType | SourceType] = {}
    for attribute, value in vars(module).items():
        declared = getattr(value, "declared", None)
        if isinstance(declared, NodeType | SourceType):
            found[attribute] = found[declared.name] = declared
    return found


def _completed(cls: type) -> type:
    """The class, with what it leaves out."""
    return type(cls.__name__, (cls, _Optional), {})


def _actions_of(target: Any) -> dict[str, str]:
    found = {name: getattr(method, "action", None) for name, method in vars(target).items()}
    return {name: help for name, help in found.items() if isinstance(help, str)}


def _first_line(target: Any) -> str:
    return (inspect.getdoc(target) or "").partition("\n")[0]
