"""The graph of a lesson: a source, the picture, the steps, and what writes them down."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from ros_visualise.graph import Graph, Node, SourceNode, place
from ros_visualise.lessons.handout import handout_of, image_of, text_of
from ros_visualise.lessons.lesson import Lesson
from ros_visualise.lessons.picture import picture_of
from ros_visualise.nodes import NodeType


def lesson_pipeline(
    lesson: Lesson, source: SourceNode, topic: str, folder: Path, at_end: bool = False
) -> Graph:
    """A lesson on the images of a source.

    Args:
        lesson: what is explained.
        source: where the images come from.
        topic: on which of its topics.
        folder: where the lesson is written down.
        at_end: write it when the source ends.
    """
    nodes = [_placed(picture_of(lesson).declared, topic)]
    for step in lesson.steps:
        before = step.after or nodes[-1].name
        nodes.append(_placed(step.declared, f"/{before}"))
    names = {node.name: node.type.doc.rstrip(".") for node in nodes}
    declared = handout_of(lesson, names, folder, at_end).declared
    topics = {image_of(name): f"/{name}" for name in names}
    topics |= {text_of(name): f"/{name}/text" for name in names}
    handout = place(declared, topics, {"text": f"/{declared.name}/text"})
    return Graph(replace(source, aside=True), (*nodes, handout)).with_frames()


def _placed(declared: NodeType, topic: str) -> Node:
    """A node that takes this topic; its image is called as itself, the rest is below that."""
    name = declared.name
    outputs = {
        port: f"/{name}" if port == "image" else f"/{name}/{port}" for port in declared.outputs
    }
    return place(declared, dict.fromkeys(declared.stepped, topic), outputs)
