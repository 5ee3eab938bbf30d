"""The node that shows a flight over a computer-drawn landscape."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from ros_visualise.core.params import param
from ros_visualise.data import Header, Image
from ros_visualise.nodes import source
from ros_visualise.sources.flyover import Flyover
from ros_visualise.sources.playback import Playback
from ros_visualise.sources.video_pixels import parse_size


@dataclass(frozen=True)
class LandscapeParams:
    """Parameters of `Landscape`."""

    size: str = param("640x480", "image size, WIDTHxHEIGHT", restart=True)
    frame_id: str = param("camera_optical", "frame_id of the images", restart=True)


@source("landscape", params=LandscapeParams, outputs={"image": Image}, seamless=True)
class Landscape:
    """Fly over a computer-drawn landscape; needs no files."""

    def __init__(self, params: LandscapeParams, playback: Playback) -> None:
        self._params, self._playback = params, playback
        self._flyover = Flyover(parse_size(params.size) or (640, 480))
        playback.check_start(self._flyover.duration_ns)

    def messages(self) -> Iterator[tuple[str, Image]]:
        """The images, each when its time has come."""
        for stamp_ns, image in self._playback.run(self._flyover):
            yield "image", replace(image, header=Header(stamp_ns, self._params.frame_id))

    def close(self) -> None:
        """Nothing is open."""
