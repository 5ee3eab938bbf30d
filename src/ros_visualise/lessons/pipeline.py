"""The graph of a lesson: a source, the steps, and what writes them down."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from ros_visualise.core.errors import UsageError
from ros_visualise.graph import Graph, Node, SourceNode, place
from ros_visualise.lessons.handout import handout_of, image_of, text_of
from ros_visualise.lessons.lesson import Lesson
from ros_visualise.lessons.picture import picture_of
from ros_visualise.nodes import NodeType


def lesson_pipeline(
    lesson: Lesson, source: SourceNode, topic: str, folder: Path, at_end: bool = False
) -> Graph:
    """A lesson on what a source gives.

    Args:
        lesson: what is explained.
        source: where the messages come from.
        topic: its images; of a lesson without a picture this says nothing.
        folder: where the lesson is written down.
        at_end: write it when the source ends.

    Raises:
        UsageError: the source has no topic that any step takes.
    """
    nodes = _of_streams(lesson, source) if lesson.streams else _of_picture(lesson, topic)
    names = {node.name: node.type.doc.rstrip(".") for node in nodes}
    declared = handout_of(lesson, names, folder, at_end).declared
    topics = {image_of(name): f"/{name}" for name in names}
    topics |= {text_of(name): f"/{name}/text" for name in names}
    handout = place(declared, topics, {"text": f"/{declared.name}/text"})
    return Graph(replace(source, aside=True), (*nodes, handout)).with_frames()


def _of_picture(lesson: Lesson, topic: str) -> list[Node]:
    """The picture, and each step after the one whose image it takes."""
    nodes = [_placed(picture_of(lesson).declared, {"image": topic})]
    for step in lesson.steps:
        nodes.append(_placed(step.declared, {"image": f"/{step.after or nodes[-1].name}"}))
    return nodes


def _of_streams(lesson: Lesson, source: SourceNode) -> list[Node]:
    """The steps whose first input there is, each with the topics of the types that it takes."""
    nodes = []
    for step in lesson.steps:
        ports = step.declared.stepped
        found = {port: _topic_for(port, kind, source) for port, kind in ports.items()}
        inputs = {port: topic for port, topic in found.items() if topic is not None}
        if next(iter(ports)) in inputs:
            nodes.append(_placed(step.declared, inputs))
    if not nodes:
        needed = [next(iter(step.declared.stepped.values())).__name__ for step in lesson.steps]
        kinds = " or ".join(dict.fromkeys(needed))
        raise UsageError(
            f"{lesson.name}: there is no topic of type {kinds} in it; give another file, or none"
        )
    return nodes


def _topic_for(port: str, kind: type, source: SourceNode) -> str | None:
    """The topic of that type that is called most as the input is."""
    fitting = [topic for topic, made in source.topics.items() if made.type is kind]
    if port == "truth":
        return next((topic for topic in fitting if "truth" in topic), None)
    named = [topic for topic in fitting if topic.strip("/") == port]
    others = [topic for topic in fitting if "truth" not in topic and "static" not in topic]
    return next(iter([*named, *others]), None)


def _placed(declared: NodeType, inputs: Mapping[str, str]) -> Node:
    """A node on these topics; its image is called as itself, the rest is below that."""
    name = declared.name
    outputs = {p: f"/{name}" if p == "image" else f"/{name}/{p}" for p in declared.outputs}
    return place(declared, inputs, outputs)
