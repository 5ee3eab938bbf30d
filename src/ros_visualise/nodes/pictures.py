"""The node that plays pictures: a file, or all of a folder."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

from ros_visualise.core.errors import OpenError
from ros_visualise.core.params import param
from ros_visualise.data import Header, Image
from ros_visualise.nodes import source
from ros_visualise.sources.calibration import Calibration
from ros_visualise.sources.pictures import Pictures
from ros_visualise.sources.playback import Playback


@dataclass(frozen=True)
class PicturesParams:
    """Parameters of `PicturesNode`."""

    path: str = param(
        "", "a picture, or a folder of pictures", restart=True, saved=False, file=bool
    )
    fps: float = param(
        1.0, "rate of pictures, Hz", min=0.01, max=240, slider=(0.1, 30), restart=True
    )
    frame_id: str = param("camera_optical", "frame_id of the images", restart=True)
    camera_info_url: str = param(
        "",
        "camera calibration, a ROS YAML file: a path or file:///PATH",
        restart=True,
        saved=False,
        file=bool,
    )


@source("pictures", params=PicturesParams, outputs={"image": Image})
class PicturesNode:
    """Play a picture, or all of a folder in the order of their names."""

    def __init__(self, params: PicturesParams, playback: Playback) -> None:
        if not params.path:
            raise OpenError("pictures: give a picture or a folder of them, its parameter path")
        self._params, self._playback = params, playback
        self._calibration = Calibration(params.camera_info_url)
        self._pictures = Pictures(params.path, params.fps)
        playback.check_start(self._pictures.duration_ns)

    def messages(self) -> Iterator[tuple[str, Image]]:
        """The pictures, each when its time has come."""
        for stamp_ns, image in self._playback.run(self._pictures):
            stamped = replace(image, header=Header(stamp_ns, self._params.frame_id))
            yield "image", self._calibration.add_to(stamped)

    def report(self) -> dict[str, Any]:
        """Notes on unreadable files."""
        notes = self._pictures.faults
        return {"lost": {"messages": len(notes), "bytes": 0, "notes": notes}} if notes else {}

    def close(self) -> None:
        """Nothing is open."""
