"""The work that a batch does with each recording: the pipeline, its settings, and what it keeps."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from ros_visualise.batch.tables import SOURCES, TABLES
from ros_visualise.core.errors import UsageError
from ros_visualise.core.regular_files import read_file
from ros_visualise.graph import IMAGE_NODES, Graph, place, place_source
from ros_visualise.graph.landmarks import (
    GEOREFERENCE,
    LOCALIZER,
    NAVIGATOR,
    POSE_ERROR,
    RECORDED_TAGS,
    TAGS,
)
from ros_visualise.graph.visual_odometry import VISUAL_ODOMETRY
from ros_visualise.landmarks.networks.remote import is_served
from ros_visualise.landmarks.networks.session import Provider, is_available
from ros_visualise.nodes import find_node, find_source
from ros_visualise.running.arguments import parse_setting
from ros_visualise.running.graphs import (
    Selection,
    film,
    graph_of,
    parse_insertion,
    recording,
    with_settings,
)
from ros_visualise.running.options import NodeOptions
from ros_visualise.runtime.saving import load
from ros_visualise.sinks.names import parse_target
from ros_visualise.sources.formats import named
from ros_visualise.sources.opening import is_recording

_IMAGES = (*IMAGE_NODES, "path")
_TAGS = (*_IMAGES, TAGS, GEOREFERENCE)
_NODES = {
    "images": _IMAGES,
    "landmarks": (*_TAGS, LOCALIZER),
    "navigate": (*_TAGS, RECORDED_TAGS, VISUAL_ODOMETRY, NAVIGATOR, POSE_ERROR),
    "none": (),
}
"""Pipeline -> the nodes that it has, if the recording has what they need.

They are those of `ros-visualise FILE`; with ``--landmarks``; with ``--navigate``; none, the source
alone. Of the second and third, image nodes that nothing asks for are omitted.
"""


@dataclass(frozen=True)
class Work:
    """The work done with each recording; all that its results depend on beside its content.

    Fields are as the options of ``batch``; ``version`` is that of this package.
    """

    pipeline: str = "images"
    node: tuple[str, ...] = ()
    set: tuple[str, ...] = ()
    params: str = ""
    preset: str = ""
    topics: tuple[str, ...] = ()
    image: str | None = None
    odom: str | None = None
    fields: tuple[str, ...] = ()
    record: tuple[str, ...] = ()
    export: tuple[str, ...] = ()
    device: str = "cpu"
    version: str = ""

    @classmethod
    def restored(cls, values: Mapping[str, Any]) -> Work:
        """The work whose `dataclasses.asdict` these values are, from JSON."""
        known: dict[str, Any] = {
            name: tuple(one) if isinstance(one, list) else one for name, one in values.items()
        }
        return cls(**known)

    def digest(self) -> str:
        """A digest of it; files that it names count by their content."""
        values = asdict(self)
        for name in ("node", "set"):
            values[name] = [_by_content(text) for text in values[name]]
        values["params"] = _by_content(self.params)
        values["tables"] = repr(TABLES)
        return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()

    def graph(self, path: str) -> Graph:
        """The graph that runs for a recording.

        Raises:
            OpenError: the recording, or a file that is named, cannot be opened.
            UsageError: the settings do not fit the recording.
        """
        graph = self._on_device(graph_of(self._selection(path), self._options()))
        if self.pipeline in ("landmarks", "navigate"):
            return _without(graph, {*IMAGE_NODES, "path"} - _named(self, graph))
        return graph

    def check(self) -> None:
        """Reject nodes and parameters that the graph of no recording has.

        Raises:
            OpenError: a file that is named cannot be opened.
            UsageError: no such node or parameter, or a value out of its range.
        """
        inserted = [parse_insertion(text) for text in self.node]
        names = [*(one.node for one in inserted), *_NODES[self.pipeline]]
        nodes = tuple(place(find_node(name), {}) for name in names)
        options = self._options()
        meant = {text.partition(".")[0] for text in self.set}
        meant |= {*load(options.params)} if options.params else set()
        meant |= {one.after for one in inserted if one.after}
        source = next((name for name in SOURCES if name in meant), SOURCES[0])
        graph = Graph(place_source(find_source(source)), nodes)
        for name in sorted(meant):
            if "=" in name:
                continue  # a setting without its node, for which the right one is suggested below
            try:
                graph.node(name)
            except UsageError as error:
                raise UsageError(f"--pipeline {self.pipeline}: {error}") from None
        with_settings(graph, options)

    def _options(self) -> NodeOptions:
        return NodeOptions(
            set=self.set,
            params=Path(self.params) if self.params else None,
            landmarks=self.pipeline == "landmarks",
            preset=self.preset,
            navigate="" if self.pipeline == "navigate" else None,
            node=self.node,
        )

    def _on_device(self, graph: Graph) -> Graph:
        """The graph with its networks on the GPU, if asked for and where there is one."""
        provider = Provider(self.device)
        if provider is Provider.CPU or not (is_served() or is_available(provider)):
            return graph
        networks = [node.name for node in graph.nodes if hasattr(node.params, "provider")]
        return graph.configured({name: {"provider": self.device} for name in networks})

    def _selection(self, path: str) -> Selection:
        if is_recording(path) or named(Path(path)):
            found = recording(path, self.topics, self.image, self.odom)
        else:
            found = film(path, "")
        if self.pipeline != "none":
            return found

        def alone(undo: ExitStack) -> Graph:
            return Graph(found.graph(undo).source, ())

        return replace(found, graph=alone)


def absolute(text: str) -> str:
    """``FILE.py:NAME`` or ``NODE.PARAM=FILE`` with the absolute path of its file, if it has one."""
    before, path, after = _file_in(text)
    return f"{before}{os.path.abspath(path)}{after}" if path else text


def _by_content(text: str) -> str:
    before, path, after = _file_in(text)
    if not path:
        return text
    return f"{before}{hashlib.sha256(read_file(path)).hexdigest()}{after}"


def _file_in(text: str) -> tuple[str, str, str]:
    """A text around the path of an existing file in it; an empty path: it names none."""
    before, equals, value = text.rpartition("=")
    if os.path.isfile(value):
        return before + equals, value, ""
    path, colon, name = text.rpartition(":")
    return ("", path, colon + name) if os.path.isfile(path) else (text, "", "")


def _without(graph: Graph, names: set[str]) -> Graph:
    return replace(graph, nodes=tuple(node for node in graph.nodes if node.name not in names))


def _named(work: Work, graph: Graph) -> set[str]:
    """Nodes that the options name, and those that the topics to record come from."""
    names = {parse_setting(text)[0] for text in work.set}
    names |= set(load(Path(work.params))) if work.params else set()
    names |= {after for text in work.node if (after := parse_insertion(text).after)}
    recorded = [parse_target(text) for text in work.record]
    topics = {topic for _, several in recorded for topic in several}
    names |= {graph.topics[topic].publisher for topic in topics if topic in graph.topics}
    if work.preset or not all(several for _, several in recorded):
        names |= {*IMAGE_NODES}
    for node in reversed(graph.nodes):  # and those whose results they take
        if node.name in names or node.name not in (*IMAGE_NODES, "path"):
            taken = (graph.topics.get(topic) for topic in node.inputs.values())
            names |= {topic.publisher for topic in taken if topic is not None}
    return names
