"""The graph of a lesson: a source, the steps, and the node that writes them down."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from ros_visualise.core.errors import OpenError, UsageError
from ros_visualise.graph import Graph, Node, SourceNode, place
from ros_visualise.graph.pipelines import open_input, recorded_source, source_named
from ros_visualise.lessons.handout import handout_of, image_of, text_of
from ros_visualise.lessons.lesson import Lesson, Origin, StepResult
from ros_visualise.lessons.picture import picture_of
from ros_visualise.nodes import NodeType
from ros_visualise.simulation.robots import ROBOTS
from ros_visualise.sources.recordings.images import image_topic


def lesson_pipeline(
    lesson: Lesson,
    path: str | None,
    folder: Path,
    at_end: bool,
    undo: ExitStack,
    origin: Origin | None = None,
) -> Graph:
    """A lesson on a file of a person's own, or on its own sample.

    Args:
        lesson: what is explained.
        path: a file, or the name of a robot; None: the sample.
        folder: where the lesson is written down.
        at_end: write it when the source ends.
        undo: closes what is opened.
        origin: how the lesson was called, to be written down.

    Raises:
        OpenError: the file cannot be opened.
        UsageError: the source has no topic that any step takes.
    """
    source, topic = _source(lesson, path, undo)
    steps = _of_streams(lesson, source) if lesson.streams else _of_picture(lesson, topic)
    names = {node.name: node.type.doc.rstrip(".") for node in steps}
    called = origin or Origin(path or sample_of(lesson))
    declared = handout_of(lesson, names, folder, at_end, called).declared
    topics = {image_of(name): f"/{name}" for name in names}
    topics |= {text_of(name): f"/{name}/text" for name in names}
    handout = place(declared, topics, {"text": f"/{declared.name}/text"})
    return Graph(replace(source, aside=True), ()).joined(*steps, handout)


def sample_of(lesson: Lesson) -> str:
    """The sample of a lesson, for people."""
    name, settings = lesson.sample
    given = ", ".join(f"{key} = {value}" for key, value in settings.items())
    return f"the sample {name}{f' with {given}' if given else ''}"


def _source(lesson: Lesson, path: str | None, undo: ExitStack) -> tuple[SourceNode, str]:
    """The source, and its topic of images."""
    if path is None:
        name, settings = lesson.sample
        return source_named(name, **settings), "/image_raw"
    opened = open_input(path, undo, mission="default")
    if not isinstance(opened, SourceNode):
        topic = "" if lesson.streams else image_topic(opened, None)
        return recorded_source(opened, [topic] if topic else ()), topic
    if lesson.streams and opened.name not in ROBOTS.names():
        inputs = f"{lesson.name} takes a recording, {' or '.join(ROBOTS.names())}, or no input"
        if not os.path.exists(path):
            raise OpenError.missing(path, inputs)
        raise UsageError(f"{path}: not a recording; {inputs}")
    return opened, "/image_raw"


def _of_picture(lesson: Lesson, topic: str) -> list[Node]:
    """The picture, and each step after the one whose image it takes."""
    nodes = [_placed(picture_of(lesson).declared, {"image": topic})]
    for step in lesson.steps:
        nodes.append(_placed(step.declared, {"image": f"/{step.after or nodes[-1].name}"}))
    return nodes


def _of_streams(lesson: Lesson, source: SourceNode) -> list[Node]:
    """The steps whose first input is published, each with the topics of the types that it takes."""
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
        raise UsageError(f"{lesson.name}: no topic of type {kinds}; give another file, or none")
    return nodes


def _topic_for(port: str, kind: type, source: SourceNode) -> str | None:
    """The topic of that type whose name is most like the input's."""
    fitting = source.topics_of(kind)
    if port == "truth":
        return next((topic for topic in fitting if "truth" in topic), None)
    named = [topic for topic in fitting if topic.strip("/") == port]
    others = [topic for topic in fitting if "truth" not in topic and "static" not in topic]
    return next(iter([*named, *others]), None)


def _noting(make: Callable[[Any], Any], params: Any) -> Any:
    """The state of a step, whose images note the parameters that made them."""
    state = make(params)
    step = state.step

    def noted(**given: Any) -> Any:
        answer = step(**given)
        image = answer.get("image") if isinstance(answer, dict) else None
        if isinstance(image, StepResult):
            return {**answer, "image": replace(image, settings=given["params"])}
        return answer

    state.step = noted
    return state


def _placed(declared: NodeType, inputs: Mapping[str, str]) -> Node:
    """A node on these topics; its image has the node's name, its other outputs are below that."""
    name = declared.name
    declared = replace(declared, make=partial(_noting, declared.make))
    outputs = {p: f"/{name}" if p == "image" else f"/{name}/{p}" for p in declared.outputs}
    return place(declared, inputs, outputs)
