"""``landmarks``: what is found in pictures, videos and recordings, and where it is."""

from __future__ import annotations

import json
from argparse import Namespace
from typing import Any

import numpy as np

from ros_visualise.commands.interruptible import in_time, interruptible
from ros_visualise.commands.landmark_graphs import landmark_graph
from ros_visualise.commands.sightings import Sightings, image_json, landmarks_json, listen
from ros_visualise.commands.wording import counted
from ros_visualise.errors import RosVisualiseError
from ros_visualise.graph import Graph
from ros_visualise.landmark_pipelines import DETECTORS, LOCALIZER
from ros_visualise.printing import answer, say, shown
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.signals import STOPPED, Wish, noticed
from ros_visualise.sinks.files import TargetFile
from ros_visualise.sinks.names import check_targets
from ros_visualise.sources.pictures import Pictures
from ros_visualise.sources.playback import Playback

_SPIN_S = 0.05


def run(args: Namespace) -> int:
    """Look for landmarks until the source ends; 1 if something was lost."""
    if args.map is not None:
        check_targets([args.map], args.input)
        TargetFile.check(args.map, args.overwrite)
    graph = interruptible(lambda: landmark_graph(args))
    playback = Playback(
        rate=0.0, start_s=args.start or 0.0, duration_s=args.duration, frames=args.frames
    )
    runtime = interruptible(lambda: LocalRuntime(graph, playback))
    found = listen(graph, DETECTORS, LOCALIZER)
    for topic, listener in found.topics.items():
        runtime.topic(topic).connect(listener)
    with noticed() as wish:
        with in_time(wish, lambda: runtime.steps):
            stopped = _run(runtime, wish)
        if args.map is not None:
            _save_map(runtime, found, args, stopped)
        _tell(graph, found, args)
        report = runtime.report()
        for node in report.nodes.values():
            for note in node.unread:
                say(f"ros-visualise: {args.input}: {note}")
    return STOPPED if stopped else int(runtime.failed or report.is_incomplete)


def _run(runtime: LocalRuntime, wish: Wish) -> bool:
    """Until the end; whether somebody asked for it before."""
    try:
        runtime.start()
        while not runtime.wait(_SPIN_S):
            if wish.asked:
                return True
        return False
    finally:
        runtime.stop()


def _save_map(runtime: LocalRuntime, found: Sightings, args: Namespace, stopped: bool) -> None:
    """Write the map; of a run that was stopped, as far as there is one."""
    is_empty = found.map is None or not found.map.detections
    if is_empty and stopped:
        say(f"ros-visualise: {args.map}: not written, as no landmark has a place in the map yet")
        return
    if is_empty:
        raise RosVisualiseError(
            f"{args.map}: not written, as no landmark has a place in the map; give the tags' size"
            " by --size or --tags, and the camera's calibration"
        )
    runtime.act(LOCALIZER, "save_map")


def _tell(graph: Graph, found: Sightings, args: Namespace) -> None:
    if not args.json:
        answer(_table(found))
        return
    paths = _paths(graph)
    images = [image_json(image, paths.get(image.stamp_ns)) for image in found.images]
    answer([json.dumps({"images": images, "landmarks": landmarks_json(found)}, allow_nan=False)])


def _paths(graph: Graph) -> dict[int, str]:
    """Stamp -> file, of pictures."""
    assert graph.source is not None
    if graph.source.name != "pictures":
        return {}
    params: Any = graph.source.params
    pictures = Pictures(params.path, params.fps)
    return {pictures.stamp_ns(index): str(path) for index, path in enumerate(pictures.files)}


def _table(found: Sightings) -> list[str]:
    """One line for each landmark: how often it was seen, and where it is."""
    images, landmarks = found.images, landmarks_json(found)
    total = counted(len(images), "image")
    if not landmarks:
        return [f"no landmarks in {total}"]
    if len(images) == 1:
        one = image_json(images[0], None)
        landmarks = [{**detection, "seen": 1} for detection in one["detections"]]
    rows = [("landmark", "seen", "position, metres", "+-", "frame")]
    for one in landmarks:
        place, spread = _place(one["pose"])
        rows.append((shown(one["name"]), str(one["seen"]), place, spread, shown(one["frame_id"])))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    ]
    return [*lines, f"{counted(len(landmarks), 'landmark')} in {total}"]


def _place(pose: dict[str, Any] | None) -> tuple[str, str]:
    """A position, and the largest of its standard deviations where they are known."""
    if pose is None:
        return "-", "-"
    variance = np.linalg.eigvalsh(np.reshape(pose["covariance"], (6, 6))[:3, :3])[-1]
    place = " ".join(f"{value:8.3f}" for value in pose["position"])
    return place, f"{np.sqrt(variance):.3f}" if variance > 0 else "-"
