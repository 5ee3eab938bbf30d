"""The executable that plays a recording onto the graph."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial

from ros_visualise.core.errors import OpenError, UsageError
from ros_visualise.data import Image
from ros_visualise.graph import Graph, place_source
from ros_visualise.nodes import SourceType
from ros_visualise.nodes.player import player
from ros_visualise.running.executables.execution import (
    announce_time,
    opened,
    publish_time,
    run_graph,
)
from ros_visualise.running.executables.options import OPTIONS, named_in
from ros_visualise.runtime.bridge.process import Process
from ros_visualise.runtime.middleware import Host, Transport
from ros_visualise.sources.opening import open_recording
from ros_visualise.sources.recordings import Recording
from ros_visualise.sources.recordings.images import first_image
from ros_visualise.sources.recordings.playing import PlayedTime, played_time

log = logging.getLogger(__name__)

_NOT_PLAYED = ("/clock", "/rosout", "/rosout_agg", "/parameter_events")
"""Topics about the recorded ROS graph, which would be mistaken for this one's."""

_LOOK_S = 0.1
_PATIENCE_S = 20.0


def run_player(host: Host, transport: Transport) -> int:
    """Play a recording, with its time on ``/clock``; the exit status."""
    path = host.find_file(str(host.option("path", "")))
    if not path:
        raise OpenError(f"give the recording: {host.flag.format('path', 'FILE')}")
    announce_time(host, transport)
    recording = opened(host, partial(open_recording, path))
    topics = named_in(host, "topics", "all")
    declared = player(recording, topics, without=_NOT_PLAYED)
    outputs = {topic: topic for topic in declared.outputs}
    wanted = str(host.option("image", "none"))
    if image := _chosen_image(recording, declared, wanted):
        outputs[image] = "/image_raw"
    graph = Graph(place_source(declared, outputs), ())
    options = (*OPTIONS, "path", "topics", "image", "wait_for")
    awaited = named_in(host, "wait_for", "none")
    if "/image_raw" not in outputs.values():  # there are no images to wait for
        awaited = [topic for topic in awaited if topic.removeprefix("/") != "image_raw"]
    conduct = partial(_conduct, played_time(recording, tuple(declared.outputs)), awaited)
    return run_graph(host, transport, graph, {"player": ""}, options, conduct)


def _chosen_image(recording: Recording, declared: SourceType, wanted: str) -> str | None:
    """The topic of recorded images that is played on image_raw."""
    images = [topic for topic, kind in declared.outputs.items() if kind is Image]
    if wanted in images:
        return wanted
    if wanted in ("none", "first"):
        return first_image(recording, images) if wanted == "first" else None
    known = f"choose from {', '.join(images)}" if images else "none in the recording"
    raise UsageError(f"image={wanted}: no such image topic; {known}")


@contextmanager
def _conduct(
    played: PlayedTime, awaited: Sequence[str], host: Host, transport: Transport, process: Process
) -> Iterator[None]:
    """Publish the recording's time, and wait for the subscribers of some topics."""
    with publish_time(
        host, transport, process, lambda playback: played.stamp_ns(playback.time_ns())
    ):
        _wait_for_subscribers(host, process, awaited)
        yield


def _wait_for_subscribers(host: Host, process: Process, topics: Sequence[str]) -> None:
    end_s = time.monotonic() + _PATIENCE_S
    while not (host.is_over() or all(process.subscribers(topic) for topic in topics)):
        if time.monotonic() > end_s:
            log.warning("no subscribers on %s; starting anyway", " and ".join(topics))
            return
        time.sleep(_LOOK_S)
