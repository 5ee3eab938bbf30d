"""The node that plays a video file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

from ros_visualise.data import Header, Image
from ros_visualise.errors import OpenError
from ros_visualise.nodes import source
from ros_visualise.params import param
from ros_visualise.sources.calibration import Calibration
from ros_visualise.sources.playback import Playback
from ros_visualise.sources.video import Video
from ros_visualise.sources.video_pixels import parse_size


@dataclass(frozen=True)
class StreamerParams:
    """Which video, and how."""

    path: str = param("", "path of the video file", restart=True, saved=False)
    size: str = param("", "scale the images to WIDTHxHEIGHT; empty keeps their size", restart=True)
    frame_id: str = param("camera_optical", "frame_id of the images", restart=True)
    camera_info_url: str = param(
        "",
        "calibration of the camera, a YAML file of ROS: a path or file:///PATH",
        restart=True,
        saved=False,
    )


@source("streamer", params=StreamerParams, outputs={"image": Image})
class Streamer:
    """Play a video file."""

    def __init__(self, params: StreamerParams, playback: Playback) -> None:
        if not params.path:
            raise OpenError("streamer: give the video file, its parameter path")
        self._params, self._playback = params, playback
        self._calibration = Calibration(params.camera_info_url)
        self._video = Video(params.path, parse_size(params.size))
        self._calibration.fit((self._video.info.width, self._video.info.height))
        playback.check_start(self._video.duration_ns)

    def messages(self) -> Iterator[tuple[str, Image]]:
        """The images, each when its time has come."""
        for stamp_ns, image in self._playback.run(self._video):
            stamped = replace(image, header=Header(stamp_ns, self._params.frame_id))
            yield "image", self._calibration.add_to(stamped)

    def report(self) -> dict[str, Any]:
        """What was missing or damaged."""
        notes = self._video.faults
        return {"lost": {"messages": 0, "bytes": 0, "notes": notes}} if notes else {}

    def close(self) -> None:
        """End reading."""
        self._video.close()
