"""Standard layouts of the workspace, by what a graph has to show."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, sqrt
from typing import Any

from ros_visualise.data import Transforms
from ros_visualise.graph import Graph
from ros_visualise.lessons.handout import NAME as LESSON
from ros_visualise.ui.live.robot import velocity_topic
from ros_visualise.ui.scene.kinds import is_spatial, is_track
from ros_visualise.ui.scene.thread import topics_of
from ros_visualise.ui.shown import first_panes, first_shown, robot_status

Place = dict[str, Any]
"""A panel, or a row, column or tabs of them; see `ros_visualise.ui.shell.workspace.read_layout`."""
_MOST_IMAGES, _MOST_BESIDE = 6, 3
_LEFT = 0.24
_PICTURES = "pictures"  # the source


def standard_layout(graph: Graph | None) -> Place:
    """The layout for addresses without one: parameters at the left, then 3D, then images.

    Without 3D, images have the room; without both, as in a log of numbers, a plot has it. In a
    recording without images, the topics come first and a plot stands below 3D.
    """
    if graph is None or not graph.members:
        return _tabs(["files", "nodes", "topics"])
    kinds = {name: topic.type for name, topic in graph.topics.items()}
    has_scene = bool(topics_of(graph)) and not _is_about_images(graph)
    shown = images_to_show(graph)
    if has_scene and not shown and graph.source is not None and graph.source.type.recording:
        views = {"column": [{"panel": "space"}, _plot(graph)], "at": [0.5, 0.5]}
        return {"row": [_tabs(["topics", "nodes", "files"]), views], "at": [0.3, 0.7]}
    images = _column(shown[:_MOST_BESIDE]) if has_scene else _grid(shown[:_MOST_IMAGES])
    parts: list[tuple[Place, float]] = [(_controls(graph), _LEFT)]
    if has_scene:
        is_small = images is not None and is_track(kinds)
        parts.append(({"panel": "space"}, 0.3 if is_small else 0.48))
    if images is not None:
        parts.append((images, 1 - sum(share for _, share in parts)))
    if len(parts) == 1:
        parts += [(_plot(graph), 0.48), (_tabs(["topics", "messages"]), 0.28)]
    shares = [share for _, share in parts]
    at = [round(share / sum(shares), 3) for share in shares]
    return {"row": [place for place, _ in parts], "at": at}


def _is_about_images(graph: Graph) -> bool:
    """True for lessons on a picture that draw nothing in 3D, though it may have a position."""
    steps = {topic for node in graph.nodes for topic in node.outputs.values()}
    is_lesson = any(node.name == LESSON for node in graph.nodes)
    is_of_picture = graph.source is not None and graph.source.type.name == _PICTURES
    draws = any(is_spatial(graph.topics[topic].type) for topic in steps)
    return is_lesson and is_of_picture and not draws


def _controls(graph: Graph) -> Place:
    """Parameters and files, below a robot that can be driven."""
    controls = _tabs(["nodes", "files"])
    if robot_status(graph)[0] is None and velocity_topic(graph) is None:
        return controls
    return {"column": [{"panel": "robot"}, controls], "at": [0.5, 0.5]}


def images_to_show(graph: Graph) -> list[str]:
    """Topics that the source shows, and one of each node with images that is not aside."""
    source = graph.source
    first = [] if source is None else [source.outputs[port] for port in source.type.shown]
    found = [first_shown(graph, one) for one in graph.members if not one.aside]
    return [topic for topic in dict.fromkeys([*first, *found]) if topic is not None]


def _grid(topics: Sequence[str]) -> Place | None:
    """Panels of images in columns; None without any."""
    tall = max(ceil(sqrt(len(topics))), 1)
    columns = [_column(topics[i : i + tall]) for i in range(0, len(topics), tall)]
    return {"row": columns} if len(columns) > 1 else next(iter(columns), None)


def _column(topics: Sequence[str]) -> Place | None:
    """Panels of images below one another; None without any."""
    panels: list[Place] = [{"panel": "image", "state": {"topic": topic}} for topic in topics]
    return {"column": panels} if len(panels) > 1 else next(iter(panels), None)


def _plot(graph: Graph) -> Place:
    """A plot of the numbers that people look at first; without any, the frames or the messages."""
    panes = first_panes(graph)
    if panes:
        return {"panel": "plots", "state": {"panes": panes}}
    kinds = {topic.type for topic in graph.topics.values()}
    if kinds == {Transforms}:
        return {"panel": "frames"}
    topics = [] if graph.source is None else [*graph.source.outputs.values()]
    return {"panel": "messages", "state": {"topic": topics[0]}} if topics else {"panel": "plots"}


def _tabs(names: Sequence[str]) -> Place:
    return {"tabs": [{"panel": name} for name in names], "shown": 0}
