"""The graph that the command `landmarks` runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack, closing
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from ros_visualise.commands.landmarks import LandmarksOptions
from ros_visualise.core.errors import UsageError
from ros_visualise.core.printing import print_status
from ros_visualise.data import Detections, Image, Imu, NavSatFix, Odometry, Transforms
from ros_visualise.graph import Graph, SourceNode
from ros_visualise.graph.landmarks import (
    LENS,
    LOCALIZER,
    OBJECTS,
    RECORDED_TAGS,
    TAGS,
    check_poses,
    with_landmarks,
    with_places,
)
from ros_visualise.graph.pipelines import made_topics, open_input, recorded_source
from ros_visualise.landmarks.tags.known import parse_ids
from ros_visualise.nodes.landmark_detector import OWN_MODEL
from ros_visualise.running.graphs import with_settings
from ros_visualise.simulation.robots import OURS, ROBOTS
from ros_visualise.sources.alignment import read_offsets
from ros_visualise.sources.calibration import read_calibration
from ros_visualise.sources.opening import open_joined, open_source
from ros_visualise.sources.recordings import Recording
from ros_visualise.sources.recordings.images import first_image, own_cameras

_NONE = "none"
_OWN_CLASSES = "helipad, post, vehicle"
"""Classes asked of our own network: `tag_detector` is better at tags."""
_OWN = "default"  # mission of a robot
_MAPPED = (Transforms, Odometry)
"""Topics that a map of landmarks needs beside the detections; an IMU gives the camera's tilt."""


def landmark_graph(options: LandmarksOptions) -> Graph:
    """A source of any kind, the nodes that find landmarks in it, and the parameters asked for.

    Raises:
        OpenError: the source, or a file that an option names, cannot be opened.
        UsageError: an option does not fit the source.
    """
    for file in files_of(options):
        read_calibration(file)  # a source would wait for it
    with ExitStack() as undo:
        source, topics = _source(options, undo)
        graph = Graph(source, ())
        detectors = _detectors(options, is_image=graph.topics[topics[0]].type is Image)
        graph = with_landmarks(
            graph,
            topics,
            detectors,
            _settings(options),
            on_earth=options.geo is not None,
            follow=options.tracks,
        )
        if options.places:
            graph = with_places(graph, topics[0], str(options.map))
        graph = with_settings(graph, options)
        check_poses(graph, options.beside)
        undo.pop_all()  # the graph closes the recording
        return graph


def files_of(options: LandmarksOptions) -> list[str]:
    """The files of ``--calibration``."""
    return [one for one in options.calibration.split(",") if one]


def _source(options: LandmarksOptions, undo: ExitStack) -> tuple[SourceNode, list[str]]:
    """The source, and the topics of images or detections."""
    if not options.input:
        raise UsageError(f"give a picture, a folder of pictures, a video, a recording, {OURS}")
    if options.beside:
        return _beside(options, undo)
    if options.offset:
        raise UsageError(f"--offset {options.offset[0]}: requires --beside FILE")
    if options.geo is not None and options.input not in ROBOTS.names():
        with closing(open_source(Path(options.input))) as readable:  # says first if it is not
            if NavSatFix not in {one.type.data_class for one in readable.topics.values()}:
                for note in readable.loss.notes:
                    print_status(f"ros-visualise: {options.input}: {note}")
    source = open_input(options.input, undo, **{"mission": _OWN, **options.scenario})
    is_robot = isinstance(source, SourceNode) and source.name in ROBOTS.names()
    if options.scenario and not is_robot:
        raise UsageError(
            f"--{next(iter(options.scenario))}: only valid with a simulated robot; omit it"
        )
    if not isinstance(source, SourceNode):
        return _recorded(source, options)
    if options.topic:
        raise UsageError(f"--topic {options.topic}: only valid with a recording; omit it")
    if options.calibration and is_robot:
        raise UsageError("--calibration: a simulated camera knows its own; omit it")
    if len(files_of(options)) > 1:
        raise UsageError("--calibration: one file; several are only valid with a recording")
    if options.calibration:
        source = source.configured({"camera_info_url": options.calibration})
    return source, ["/image_raw"]


def _beside(options: LandmarksOptions, undo: ExitStack) -> tuple[SourceNode, list[str]]:
    """Several recordings and films on one line of time."""
    files = [Path(one) for one in (options.input, *options.beside)]
    joined = undo.enter_context(closing(open_joined(files)))
    moved = dict(zip(joined.names, read_offsets(options.offset, joined), strict=True))
    source, topics = _recorded(joined, options)
    return source.configured(moved), topics


def _recorded(recording: Recording, options: LandmarksOptions) -> tuple[SourceNode, list[str]]:
    """A recording's images, or its detections, and the poses of its camera."""
    kinds = {name: topic.type.data_class for name, topic in recording.topics.items()}
    topics = _cameras(recording, options, kinds)
    wanted = (*_MAPPED, *(() if options.map is None else (Imu,)))
    wanted += () if options.geo is None else (NavSatFix,)
    made = made_topics()
    beside = [
        name
        for name, kind in kinds.items()
        if (kind in wanted or (options.geo and name.endswith(LENS)))
        and name not in made
        and not recording.topics[name].unreadable
    ]
    files = files_of(options)
    if len(files) not in (0, 1, len(topics)):
        raise UsageError(f"--calibration: give one file for each of {', '.join(topics)}")
    files *= len(topics) if len(files) == 1 else 1
    given = dict(zip(topics, files, strict=False))
    return recorded_source(recording, [*topics, *beside], given), topics


def _cameras(
    recording: Recording, options: LandmarksOptions, kinds: Mapping[str, type | None]
) -> list[str]:
    """The topics of images or detections, one for each camera."""
    images = [name for name, kind in kinds.items() if kind is Image]
    found = [name for name, kind in kinds.items() if kind is Detections]
    first = first_image(recording, images) or next(iter(found), None)
    topics = [one for one in options.topic.split(",") if one] or [one for one in [first] if one]
    if not topics or not {*topics} <= {*images, *found}:
        known = ", ".join([*images, *found]) or "none"
        what = f"--topic {options.topic}: no such topic" if options.topic else options.input
        what += "" if options.topic else ": no topic"
        raise UsageError(f"{what} with images or detections; available: {known}")
    if options.map is not None and not options.topic:
        topics = own_cameras(recording, topics[0], images if topics[0] in images else found)
    if len({kinds[one] for one in topics}) > 1:
        raise UsageError("--topic: give either images or recorded tags, not both")
    if len(topics) > 1 and options.map is None:
        raise UsageError(f"--topic {options.topic}: several cameras require --map OUT.yaml")
    if len(topics) > 1:
        print_status(f"ros-visualise: mapping with {len(topics)} cameras: {', '.join(topics)}")
    return topics


def _detectors(options: LandmarksOptions, is_image: bool) -> Sequence[str]:
    """The nodes that find landmarks in images, or convert recorded ones."""
    if is_image:
        return (TAGS, OBJECTS) if _has_network(options.model) else (TAGS,)
    for option, given in {"--families": options.families, "--model": options.model}.items():
        if given:
            raise UsageError(f"omit {option}: this recording has no images, only recorded tags")
    return (RECORDED_TAGS,)


def _has_network(model: str) -> bool:
    """True if objects are detected: by a given network, else by our own if it can run."""
    if model:
        return model != _NONE
    return OWN_MODEL.is_file() and find_spec("onnxruntime") is not None


def _settings(options: LandmarksOptions) -> dict[str, dict[str, Any]]:
    """Node -> its parameters by the options."""
    sizes: dict[str, Any] = {"tags": options.tags} if options.tags else {}
    if options.size is not None:
        sizes["size"] = options.size
    if options.ignore_tags:
        parse_ids(options.ignore_tags)  # or each image would report it
        sizes["ignore"] = options.ignore_tags
    return {
        TAGS: {**sizes, **({"families": options.families} if options.families else {})},
        RECORDED_TAGS: sizes,
        OBJECTS: {"model": options.model} if options.model else {"classes": _OWN_CLASSES},
        LOCALIZER: {} if options.map is None else {"save_to": str(options.map)},
    }
