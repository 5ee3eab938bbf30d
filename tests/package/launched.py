"""What launch files start, of whichever ROS."""

from __future__ import annotations

from os.path import normpath
from pathlib import Path
from typing import Any

from ros_visualise.graph import Graph
from ros_visualise.graph.pipelines import alone, build
from ros_visualise.nodes import find

PACKAGE = Path(__file__).parents[2]
LAUNCH = PACKAGE / "launch"
NEEDED = {"video": "flight.mp4", "bag": "/flight.bag", "node": "own.py:own", "recording": "/a.bag"}
"""The arguments that have no default."""

PLAYER_OPTIONS = {"path", "topics", "image", "wait_for", "max_memory"}
OPTIONS = {"view", "host", "port", "token", "allow_origin", "window", "record_dir"}
OPTIONS |= {"image_transport", "start", "duration", "stay", "clock"}
PIPELINE_OPTIONS = OPTIONS | {"source", "nodes"}


class LaunchedGraph:
    """The nodes of ours that a launch file starts, joined by their topics."""

    ours: dict[str, Any]
    """Each process of ours by its name, with its ``type``, which is its executable."""

    def params(self, node: str) -> dict[str, Any]:
        """A node's private parameters."""
        raise NotImplementedError

    def resolve(self, node: str, topic: str) -> str:
        """A topic's name on the graph, after the node's remappings."""
        raise NotImplementedError

    def graph(self) -> dict[str, dict[str, str]]:
        """Node -> its inputs and outputs with their topics on the graph."""
        joined = {}
        for node in self._graph_nodes():
            process = node.name if node.name in self.ours else "pipeline"
            ports = {**node.inputs, **{f"{port} out": t for port, t in node.outputs.items()}}
            joined[node.name] = {port: self.resolve(process, t) for port, t in ports.items()}
        return joined

    def _graph_nodes(self) -> list[Any]:
        if "pipeline" in self.ours:
            given = self.params("pipeline")
            nodes = given["nodes"].split()
            return list(build(given.get("source"), "/image_raw", through=nodes).members)
        nodes = [process for process in self.ours if process != "player"]
        return [n for process in nodes for n in alone(find(process)).members]


def joined(graph: Graph) -> dict[str, dict[str, str]]:
    """Node -> its inputs and outputs with their topics."""
    return {
        node.name: {**node.inputs, **{f"{port} out": t for port, t in node.outputs.items()}}
        for node in graph.members
    }


def effective(params: dict[str, Any]) -> dict[str, Any]:
    """Parameters without those of nodes that are not there, and those that say "none"."""
    said = {name: _value(value) for name, value in params.items() if value != "none"}
    there = {"", said.get("source"), *str(said.get("nodes", "")).split()}
    return {name: value for name, value in said.items() if name.rpartition("/")[0] in there}


def _value(value: Any) -> Any:
    return normpath(value) if "/../" in str(value) else value
