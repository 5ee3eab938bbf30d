"""Graph that the command `landmarks` runs."""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import ExitStack, closing
from importlib.util import find_spec
from typing import Any

from ros_visualise.commands.landmarks import LandmarksOptions
from ros_visualise.core.errors import UsageError
from ros_visualise.data import Detections, Image, Imu, Odometry, Transforms
from ros_visualise.graph import Graph, SourceNode
from ros_visualise.graph.landmarks import (
    LOCALIZER,
    OBJECTS,
    RECORDED_TAGS,
    TAGS,
    tags_of_world,
    with_landmarks,
)
from ros_visualise.graph.pipelines import alone, made_topics
from ros_visualise.nodes import find_source
from ros_visualise.nodes.landmark_detector import OWN_MODEL
from ros_visualise.nodes.player import player
from ros_visualise.running.graphs import with_settings
from ros_visualise.simulation.robots import OURS, ROBOTS
from ros_visualise.sources.calibration import read_calibration
from ros_visualise.sources.opening import NoRecording, is_recording, open_recording
from ros_visualise.sources.pictures import is_pictures, no_pictures
from ros_visualise.sources.recordings import Recording
from ros_visualise.sources.recordings.images import first_image

_NONE = "none"
_OWN_CLASSES = "helipad, post, vehicle"
"""What our own network is asked for: tags are told better by `tag_detector`."""
_FIELD = "field"
_OWN = "default"  # mission of a robot
_MAPPED = (Transforms, Odometry)
"""What a map of landmarks needs beside the detections; an IMU tells how the camera is mounted."""


def landmark_graph(options: LandmarksOptions) -> Graph:
    """A source of any kind, the nodes that find landmarks in it, and the parameters asked for.

    Raises:
        OpenError: the source, or a file that an option names, cannot be opened.
        UsageError: an option asks for what is not there.
    """
    if options.calibration:
        read_calibration(options.calibration)  # a source would wait for it
    with ExitStack() as undo:
        graph, topic = _source(options, undo)
        detectors = _detectors(options, is_image=graph.topics[topic].type is Image)
        graph = with_landmarks(graph, topic, detectors, _settings(options))
        graph = with_settings(graph, options)
        undo.pop_all()  # a recording is the graph's now
        return graph


def _source(options: LandmarksOptions, undo: ExitStack) -> tuple[Graph, str]:
    """A graph of a source alone, and the topic that landmarks are looked for on."""
    path = options.input
    if not path:
        raise UsageError(f"give a picture, a folder of pictures, a video, a recording, {OURS}")
    is_robot = path in ROBOTS.names() and not os.path.exists(path)
    if not is_robot and is_recording(path) and not is_pictures(path):
        _refuse_scenario(options)
        try:
            recording = undo.enter_context(closing(open_recording(path)))
        except NoRecording:
            raise no_pictures(path) from None
        return _recorded(recording, options)
    if options.topic:
        raise UsageError(f"--topic {options.topic}: only a recording has several topics")
    if is_robot:
        if options.calibration:
            raise UsageError("--calibration: a simulated camera knows its own; leave it out")
        return alone(find_source(path)).configured(
            {path: {"mission": _OWN, **_scenario(options)}}
        ), "/image_raw"
    _refuse_scenario(options)
    kind = "pictures" if is_pictures(path) else "streamer"
    settings = {"path": path, "camera_info_url": options.calibration}
    return alone(find_source(kind)).configured({kind: settings}), "/image_raw"


def _scenario(options: LandmarksOptions) -> dict[str, Any]:
    """What was asked for of a simulation."""
    asked = {"world": options.world, "mission": options.mission, "seed": options.seed}
    return {name: value for name, value in asked.items() if value is not None}


def _refuse_scenario(options: LandmarksOptions) -> None:
    if asked := _scenario(options):
        raise UsageError(f"--{next(iter(asked))}: only a simulated robot has one; leave it out")


def _recorded(recording: Recording, options: LandmarksOptions) -> tuple[Graph, str]:
    """A recording's images, or the detections in it, and what tells where its camera is."""
    kinds = {name: topic.type.data_class for name, topic in recording.topics.items()}
    images = [name for name, kind in kinds.items() if kind is Image]
    found = [name for name, kind in kinds.items() if kind is Detections]
    topic = options.topic or first_image(recording, images) or next(iter(found), None)
    if topic not in (*images, *found):
        there = ", ".join([*images, *found]) or "none"
        what = (
            f"--topic {options.topic}: no such topic"
            if options.topic
            else f"{options.input}: no topic"
        )
        raise UsageError(f"{what} with images or detections; its topics with these: {there}")
    wanted = _MAPPED if options.map is None else (*_MAPPED, Imu)
    made = made_topics()
    beside = [
        name
        for name, kind in kinds.items()
        if kind in wanted and name not in made and not recording.topics[name].unreadable
    ]
    declared = player(recording, [topic, *beside], camera_info_url=options.calibration)
    outputs = {name: name for name in declared.outputs}
    return Graph(SourceNode("player", declared, declared.params(), {}, outputs), ()), topic


def _detectors(options: LandmarksOptions, is_image: bool) -> Sequence[str]:
    """The nodes that are wanted of what is there."""
    if is_image:
        return (TAGS, OBJECTS) if _has_network(options.model) else (TAGS,)
    for option, given in {"--families": options.families, "--model": options.model}.items():
        if given:
            raise UsageError(
                f"{option}: this recording has no images, only tags that were "
                "found before; leave it out"
            )
    return (RECORDED_TAGS,)


def _has_network(model: str) -> bool:
    """Whether objects are looked for: by a file that is given, else by our own where it runs."""
    if model:
        return model != _NONE
    return OWN_MODEL.is_file() and find_spec("onnxruntime") is not None


def _settings(options: LandmarksOptions) -> dict[str, dict[str, Any]]:
    """Node -> the parameters that options set."""
    is_robot = options.input in ROBOTS.names()
    tags = options.tags or (tags_of_world(options.world or _FIELD) if is_robot else "")
    sizes: dict[str, Any] = {"tags": tags} if tags else {}
    if options.size is not None:
        sizes["size"] = options.size
    return {
        TAGS: {**sizes, **({"families": options.families} if options.families else {})},
        RECORDED_TAGS: sizes,
        OBJECTS: {"model": options.model} if options.model else {"classes": _OWN_CLASSES},
        LOCALIZER: {} if options.map is None else {"save_to": str(options.map)},
    }
