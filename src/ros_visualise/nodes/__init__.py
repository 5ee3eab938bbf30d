"""Nodes and sources: each is declared once, with a decorator, in a file of its own.

    from ros_visualise.data import Image
    from ros_visualise.nodes import node, param

    @dataclass(frozen=True)
    class EdgeParams:
        low: int = param(100, "hysteresis low threshold", min=0, max=800)

    @node("edge_detector", params=EdgeParams, inputs={"image": Image}, outputs={"edges": Image})
    def edge_detector(image, params):
        '''Canny edges of one image.'''
        return ...

A node is a function or, if it keeps state, a class with

- ``__init__(params)``,
- ``step(<inputs by name>, params)``, called for each message; if declared ``timed``, it also takes
  ``arrival_ns``, the arrival time by the recording's clock or the wall clock,

and, as needed,

- ``reset()``, called when time jumps: after a seek, after the source is reopened, or when the
  stamps of a topic go back by more than a second,
- ``finish()``, called at the end of the stream,
- ``tick(params)``, called periodically on a ROS graph, where the next message may never come;
  returns what is due,
- ``report()``, figures for the run report; ``lost`` and ``unplayed`` count data that could not be
  read or played, and set the exit status to 1,
- methods decorated with `action`: buttons on the page, services on a ROS graph; one that takes
  ``params`` gets the present ones, even if they have changed since the last step.

A node with several inputs declares how their messages are matched by stamp:

    @node("locator", inputs={"image": Image, "boxes": PoseArray}, sync=Exact(), frames=True, ...)
    def locator(image, boxes, params, frames): ...

``sync`` is ``Exact()``: equal stamps; ``Approximate(slop_s)``: the nearest stamps; or
``Latest("image")``: each image with the latest message of every other input. Without ``sync`` each
message arrives alone, so ``step`` needs a default for every input. Unmatched messages are dropped
and counted.

With ``frames=True`` the step also takes ``frames``, a `ros_visualise.geometry.frames.FrameTree` of
``/tf`` and ``/tf_static`` at the message's stamp; a message waits up to half a second for its
transforms. A step that raises NoTransform drops its message. With ``calibrated=True`` every image
comes with its ``camera_info``, even where that is a topic of its own; it is None if the camera is
not calibrated.

With ``splittable=False`` a node needs the whole recording, as one that makes a map or a path; of
others ``ros-visualise batch`` may run several parts at once, each after a time to warm up.

``step``, ``tick``, ``finish`` and actions return a message (if the node has one output), a dict of
output name -> message, or None for no result.

A source is a class with

- ``__init__(params, playback)``, which opens it or raises OpenError,
- ``messages()``, an iterator of (output name, message) that ends with the source or when
  ``playback`` is closed,
- ``close()``,
- any of the optional methods of `ros_visualise.sources.declarations.Source`.

``messages`` runs on its own thread; the other methods are called from other threads.
``extend=("device", FUNCTION)`` names a parameter that brings further parameters, such as a camera's
controls: FUNCTION takes the parameters and returns an extended copy.
"""

from __future__ import annotations

import importlib.util
import os
import sys
import zlib
from pathlib import Path
from types import ModuleType
from typing import Any

from ros_visualise.core.declarations import NodeType, NoParams, action, node
from ros_visualise.core.errors import OpenError, UsageError, did_you_mean
from ros_visualise.core.params import param
from ros_visualise.core.registry import Registry
from ros_visualise.core.synchronizer import Approximate, Each, Exact, Latest
from ros_visualise.simulation.robots import ROBOTS, RobotType
from ros_visualise.sources.declarations import Source, SourceType, source

__all__ = [
    "NODES",
    "Approximate",
    "Each",
    "Exact",
    "Latest",
    "NoParams",
    "NodeType",
    "Source",
    "SourceType",
    "action",
    "find",
    "find_all",
    "find_node",
    "find_source",
    "load",
    "node",
    "param",
    "source",
]


def _read(held: Any, name: str) -> NodeType | SourceType:
    """The node or source that a module, or what an entry point names, declares by this name.

    Raises:
        UsageError: no such declaration.
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
    """The node or source of that name, or one in a file as ``FILE.py:NAME``.

    Raises:
        OpenError: no such file, or it does not run.
        UsageError: unknown name; the known ones are listed.
    """
    path, _, own = name.rpartition(":")
    if own and Path(path).suffix == ".py":
        return load(path, own)
    try:
        return NODES.find(name)
    except UsageError as error:
        raise UsageError(f"{error} (give a node of your own as FILE.py:NAME)") from None


def find_node(name: str) -> NodeType:
    """The node of that name; raises as `find`, and UsageError for a source."""
    found = find(name)
    if not isinstance(found, NodeType):
        raise UsageError(f"{name} is a source, not a node")
    return found


def find_source(name: str) -> SourceType:
    """The source of that name; raises as `find`, and UsageError for a node."""
    found = find(name)
    if not isinstance(found, SourceType):
        raise UsageError(f"{name} is a node, not a source")
    return found


def find_all() -> list[NodeType | SourceType]:
    """Every source and node, ours by name before those of other packages."""
    return list(NODES.all())


def load(path: str, name: str) -> NodeType | SourceType:
    """The node or source in a file, by the name of its function, its class or its declaration.

    Raises:
        OpenError: no such file, or it does not run.
        UsageError: the file declares no such node; the declared ones are listed.
    """
    declared = _declared_in(_run_file(path))
    if name not in declared:
        hint = did_you_mean(name, sorted(declared)) if declared else "; decorate one with @node"
        raise UsageError(f"{path} declares no node {name!r}{hint}")
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
