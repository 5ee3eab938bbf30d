"""The graph of a lesson on what a person has."""

from __future__ import annotations

from contextlib import ExitStack, closing
from pathlib import Path
from typing import Any

from ros_visualise.core.errors import UsageError
from ros_visualise.graph import Graph, SourceNode
from ros_visualise.graph.pipelines import alone
from ros_visualise.lessons.lesson import Lesson
from ros_visualise.lessons.pipeline import lesson_pipeline
from ros_visualise.nodes import find_source
from ros_visualise.nodes.player import player
from ros_visualise.simulation.robots import ROBOTS
from ros_visualise.sources.opening import is_recording, open_recording
from ros_visualise.sources.pictures import is_pictures
from ros_visualise.sources.recordings import Recording
from ros_visualise.sources.recordings.images import image_topic


def lesson_graph(
    lesson: Lesson, path: str | None, folder: Path, at_end: bool, undo: ExitStack
) -> Graph:
    """A lesson on what a person has, or on its own sample.

    Args:
        lesson: what is explained.
        path: a file, or the name of a robot; None: the sample.
        folder: where the lesson is written down.
        at_end: write it when the source ends.
        undo: closes what is opened.

    Raises:
        OpenError: the file cannot be opened.
        UsageError: no images in the file.
    """
    source, topic = _source(path, lesson, undo)
    return lesson_pipeline(lesson, source, topic, folder, at_end)


def _source(path: str | None, lesson: Lesson, undo: ExitStack) -> tuple[SourceNode, str]:
    """A source, and its topic of images."""
    if path is None:
        name, settings = lesson.sample
        return _alone(name, **settings), "/image_raw"
    if path in ROBOTS.names():
        return _alone(path, mission="default"), "/image_raw"
    if is_pictures(path) and not lesson.streams:
        return _alone("pictures", path=path), "/image_raw"
    if not is_recording(path) and not lesson.streams:
        return _alone("streamer", path=path), "/image_raw"
    if lesson.streams and Path(path).is_file() and not is_recording(path):
        robot = " or ".join(ROBOTS.names())
        raise UsageError(f"{path} is no recording: {lesson.name} takes one, or {robot}, or nothing")
    return _recorded(undo.enter_context(closing(open_recording(path))), lesson)


def _alone(name: str, **settings: Any) -> SourceNode:
    source = alone(find_source(name)).configured({name: settings}).source
    assert source is not None
    return source


def _recorded(recording: Recording, lesson: Lesson) -> tuple[SourceNode, str]:
    topic = "" if lesson.streams else image_topic(recording, None)
    declared = player(recording, [topic] if topic else ())
    outputs = {name: name for name in declared.outputs}
    return SourceNode("player", declared, declared.params(), {}, outputs), topic
