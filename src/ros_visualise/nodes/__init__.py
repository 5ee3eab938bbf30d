"""The registry: a node or a source is declared once, with a decorator, in a file of its own.

    @node("edge_detector", params=EdgeParams, inputs={"image": Image}, outputs={"edges": Image})
    def edge_detector(image, params):
        '''Canny edges of one image.'''
        return ...

A node is a function or, where it keeps a state, a class with

- ``__init__(params)``,
- ``step(<an input by name>, params)``, called for each message; declared ``timed``, it is also
  given ``arrival_ns``: when the message came, by the clock of the recording that it is from or by
  one of ours,
and where needed
- ``reset()``, when time has jumped: somebody went elsewhere in what is played, the source was
  opened anew, or the stamps on a topic went back by more than a second,
- ``finish()``, at the end of the stream,
- ``tick(params)``, now and then where messages come from outside, so that nobody knows whether
  another comes: what is due by now,
- ``report()``, figures of its own for the run report; ``lost`` and ``unplayed`` are kept there for
  data that could not be read or played, which makes the exit status 1,
- methods decorated with `action`: buttons on the page, services on a ROS graph.

A node of several inputs says how their messages come together, by their stamps:

    @node("locator", inputs={"image": Image, "boxes": PoseArray}, join=Exact(), frames=True, ...)
    def locator(image, boxes, params, frames): ...

``join`` is one of `ros_visualise.joining`: ``Exact()``, the same stamp; ``Approx(slop_s)``, the
nearest; ``Latest("image")``, each image with the latest of the others. Without it each message
comes alone, so that ``step`` has a default for each of them. Messages that come into no step are
counted. With ``frames`` the step is also given a `ros_visualise.geometry.frames.FrameTree`, by
``/tf`` and ``/tf_static`` as they were known then; a message waits for the transforms of its time,
half a second at most. A step that ends with NoTransform costs that message. Declared
``calibrated``, a node gets images with their ``camera_info``, wherever that travels; of an
uncalibrated camera that is None.

``step``, ``tick``, ``finish`` and actions answer with the message of its only output, with a dict
of output name to message, or with None: nothing for this one.

A source is a class with ``__init__(params, playback)``, which opens it or raises OpenError;
``messages()``, an iterator of (output name, message) until the source ends or ``playback`` is
closed; ``close()``; and where needed ``report()``, actions, ``receive(port, message)`` for the
inputs that it declares, and ``set_demand(is_wanted)``, called before ``messages``:
``is_wanted(output)`` tells whether anybody listens to an output, so that a costly message is made
only then; ``awaits(port)``, whether it needs to hear what nodes make of its messages, which it then
does before its next one; and ``configure(params, changed)``, the parameters as they
are to be and the names of those that change: ParameterError refuses the change. Actions,
``receive`` and ``configure`` are called from other threads than ``messages``.
``extend=("device", FUNCTION)`` declares a parameter that decides which others there are: the
function takes the parameters and gives those with more.
"""

from __future__ import annotations

import importlib.util
import os
import sys
import zlib
from pathlib import Path
from types import ModuleType
from typing import Any

from ros_visualise.declarations import (
    NodeType,
    NoParams,
    Source,
    SourceType,
    action,
    node,
    source,
)
from ros_visualise.errors import OpenError, UsageError
from ros_visualise.near import near
from ros_visualise.registry import Registry
from ros_visualise.simulation.robots import ROBOTS, RobotType

__all__ = [
    "NODES",
    "NoParams",
    "NodeType",
    "Source",
    "SourceType",
    "action",
    "choose",
    "choose_node",
    "find",
    "find_all",
    "find_node",
    "find_source",
    "load",
    "node",
    "source",
]


def _read(held: Any, name: str) -> NodeType | SourceType:
    """The node or source that a module, or what an entry point names, declares by this name.

    Raises:
        UsageError: there is no such declaration.
    """
    if isinstance(held, RobotType):
        held = held.source
    found = _declared_in(held) if isinstance(held, ModuleType) else _declared_by(held)
    if name not in found:
        raise UsageError(
            f"declares no node {name!r}; decorate a function with @node({name!r}, ...)"
        )
    return found[name]


NODES = Registry("nodes", __name__, _read, more=ROBOTS)
"""All nodes and sources: those in this folder, the robots, and those of other packages."""


def find(name: str) -> NodeType | SourceType:
    """The node or source of that name; raises as `ros_visualise.registry.Registry.find`."""
    return NODES.find(name)


def find_node(name: str) -> NodeType:
    """The node of that name.

    Raises:
        UsageError: unknown name, or a source.
    """
    found = find(name)
    if not isinstance(found, NodeType):
        raise UsageError(f"{name} is a source, not a node")
    return found


def find_source(name: str) -> SourceType:
    """The source of that name.

    Raises:
        UsageError: unknown name, or a node.
    """
    found = find(name)
    if not isinstance(found, SourceType):
        raise UsageError(f"{name} is a node, not a source")
    return found


def find_all() -> list[NodeType | SourceType]:
    """Every source and node, ours by name before those of other packages."""
    return list(NODES.all())


def choose(text: str) -> NodeType | SourceType:
    """The node or source of that name, or one's own as ``FILE.py:NAME``.

    Raises:
        OpenError: there is no such file, or it does not run.
        UsageError: it is neither.
    """
    path, _, name = text.rpartition(":")
    if name and Path(path).suffix == ".py":
        return load(path, name)
    try:
        return find(text)
    except UsageError as error:
        raise UsageError(f"{error}; one of your own is FILE.py:NAME") from None


def choose_node(text: str) -> NodeType:
    """As `choose`, of nodes alone."""
    found = choose(text)
    if not isinstance(found, NodeType):
        raise UsageError(f"{text} is a source, not a node")
    return found


def load(path: str, name: str) -> NodeType | SourceType:
    """A node or source of one's own; ``name`` is the function's, the class's or what it declares.

    Raises:
        OpenError: there is no such file, or it does not run.
        UsageError: it declares nothing of that name; what it does is listed.
    """
    declared = _declared_in(_run_file(path))
    if name not in declared:
        there = near(name, sorted(declared)) if declared else "; decorate a function with @node"
        raise UsageError(f"{path} declares no node {name!r}{there}")
    return declared[name]


def _run_file(path: str) -> ModuleType:
    if not os.path.isfile(path):
        raise OpenError.missing(path, "give a node as FILE.py:NAME")
    name = f"own_{Path(path).stem}_{zlib.crc32(str(Path(path).resolve()).encode()):08x}"
    spec = importlib.util.spec_from_file_location(name, path)
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
        for name, declared in _declared_by(value).items():
            found[attribute] = found[name] = declared
    return found


def _declared_by(value: Any) -> dict[str, NodeType | SourceType]:
    declared = getattr(value, "declared", None)
    return {declared.name: declared} if isinstance(declared, NodeType | SourceType) else {}
