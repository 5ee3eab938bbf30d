"""The node that plays a video file."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from ros_visualise.core.errors import OpenError
from ros_visualise.core.params import param
from ros_visualise.data import Header, Image
from ros_visualise.messages.restamped import restamped
from ros_visualise.nodes import Source, SourceType, find_source, source
from ros_visualise.sources.calibration import Calibration
from ros_visualise.sources.playback import Playback
from ros_visualise.sources.series import Series
from ros_visualise.sources.telemetry import Film, open_film, telemetry_of
from ros_visualise.sources.video import Video
from ros_visualise.sources.video_pixels import parse_size


@dataclass(frozen=True)
class StreamerParams:
    """Parameters of `Streamer`."""

    path: str = param("", "video file", restart=True, saved=False, file=bool)
    size: str = param("", "image size, WIDTHxHEIGHT; empty: the video's own", restart=True)
    frame_id: str = param("camera_optical", "frame_id of the images", restart=True)
    camera_info_url: str = param(
        "",
        "camera calibration, a ROS YAML file: a path or file:///PATH",
        restart=True,
        saved=False,
        file=bool,
    )


@source("streamer", params=StreamerParams, outputs={"image": Image})
class Streamer:
    """Play a video file."""

    def __init__(
        self,
        params: StreamerParams,
        playback: Playback,
        series: Sequence[Series] = (),
        faults: Sequence[str] = (),
    ) -> None:
        if not params.path:
            raise OpenError("streamer: give a video file by path")
        self._params, self._playback, self._faults = params, playback, faults
        self._calibration = Calibration(params.camera_info_url)
        self._video = Video(params.path, parse_size(params.size))
        self._film = Film(self._video, series)
        self._calibration.fit((self._video.info.width, self._video.info.height))
        playback.check_start(self._video.duration_ns)
        self._video.is_outdated = lambda: playback.is_outdated
        keys = self._video.key_images
        playback.key_image = None if keys is None else keys.at

    def messages(self) -> Iterator[tuple[str, Any]]:
        """The images and the telemetry, each when its time has come."""
        for stamp_ns, item in self._playback.run(self._film, self._film.is_frame):
            if not self._film.is_frame(item):
                yield item.output, restamped(item.message, stamp_ns - item.stamp_ns)
                continue
            stamped = replace(item.message, header=Header(stamp_ns, self._params.frame_id))
            yield item.output, self._calibration.add_to(stamped)

    def report(self) -> dict[str, Any]:
        """Notes on missing or damaged data."""
        notes = [*self._faults, *self._video.faults]
        return {"lost": {"messages": 0, "bytes": 0, "notes": notes}} if notes else {}

    def close(self) -> None:
        """End reading."""
        self._video.close()


def film(path: str | Path) -> SourceType:
    """A source that plays a video, with an output for each kind of its telemetry."""
    faults: list[str] = []
    series = telemetry_of(path, faults)
    declared = find_source("streamer")
    make: Callable[..., Source] = declared.make
    measured = {one.topic: one.kind for one in series}
    outputs = {**declared.outputs, **measured}
    return replace(
        declared,
        make=partial(make, series=series, faults=faults),
        outputs=outputs,
        latched=frozenset(one.topic for one in series if one.latched),
        ros={one.topic: one.ros for one in series if one.ros is not None},
        series=series,
        recording=lambda params: open_film(Path(params.path)),
    )
