"""The whole tracks in a recording, read once before they are played."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, suppress
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ros_visualise.core.errors import RosVisualiseError
from ros_visualise.data import (
    Floats,
    NavSatFix,
    Odometry,
    PoseStamped,
    PoseWithCovarianceStamped,
)
from ros_visualise.geometry.thinning import evenly
from ros_visualise.messages.recorded import content
from ros_visualise.runtime.base import Runtime
from ros_visualise.sources.recordings import Recording
from ros_visualise.sources.recordings.series import SeriesRecording

_POSED = (Odometry, PoseStamped, PoseWithCovarianceStamped)
_MOST_TOPICS = 6
_READ_BYTES = 256 << 20
_SAMPLES = 500
"""Messages that are looked up in a larger recording, which is not read as a whole."""
_MOST_POINTS = 3000
_BATCH, _PAUSE_S = 50, 0.001


def whole_tracks(runtime: Runtime, is_over: Callable[[], bool]) -> Iterator[tuple[str, Floats]]:
    """(Topic, track) of a graph's recording: positions (N, 3) in the frame of the topic.

    Those of fixes are latitude, longitude and height. What cannot be read is skipped.

    Args:
        is_over: returns True to end.
    """
    source = runtime.graph.source
    if source is None:
        return
    kinds = {port: kind for port, kind in source.type.outputs.items() if kind in _PLACES}
    with suppress(RosVisualiseError, OSError, ValueError):
        recording = _opened(runtime)
        if recording is None:
            return
        with closing(recording):
            for port in [port for port in kinds if port in recording.topics][:_MOST_TOPICS]:
                track = _track(recording, port, is_over)
                if len(track) > 1 and not is_over():
                    yield source.outputs[port], track


def _opened(runtime: Runtime) -> Recording | None:
    """The recording of the source, or what a film has measured."""
    source = runtime.graph.source
    assert source is not None
    if source.type.series:
        return SeriesRecording(Path(), "film", 0, source.type.series)
    if source.type.recording is not None:
        return source.type.recording(runtime.parameters[source.name].current)
    return None


def _track(recording: Recording, topic: str, is_over: Callable[[], bool]) -> Floats:
    found: list[Any] = []
    frame = None
    for number, message in enumerate(_messages(recording, topic)):
        if is_over():
            break
        if number % _BATCH == 0:
            time.sleep(_PAUSE_S)
        with suppress(RosVisualiseError):
            one = content(message)
            frame = one.header.frame_id if frame is None else frame
            if one.header.frame_id == frame and type(one) in _PLACES:
                found.append(_PLACES[type(one)](one))
    places = np.array(found, np.float64).reshape(-1, 3)
    places = places[np.isfinite(places).all(axis=1)]
    return places[evenly(len(places), _MOST_POINTS)]


def _messages(recording: Recording, topic: str) -> Iterator[Any]:
    """All messages of a topic, or some at even times where the recording is large."""
    if recording.size <= _READ_BYTES:
        with closing(recording.read(topics=[topic])) as entries:
            yield from (entry.message for entry in entries)
        return
    stamps: npt.NDArray[np.int64] = np.sort(recording.stamps_ns()[topic])
    for stamp_ns in stamps[evenly(len(stamps), _SAMPLES)].tolist():
        with closing(recording.read(stamp_ns, None, [topic])) as entries:
            yield from (entry.message for entry in islice(entries, 1))


def _place(fix: NavSatFix) -> Floats:
    """Latitude, longitude, and height or 0."""
    if fix.status < 0:
        return np.full(3, np.nan)
    return np.array([fix.latitude, fix.longitude, np.nan_to_num(fix.altitude)])


_PLACES: Mapping[type, Callable[[Any], Floats]] = {
    **dict.fromkeys(_POSED, lambda posed: posed.position_xyz),
    NavSatFix: _place,
}
