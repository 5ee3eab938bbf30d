"""The node that shows a live camera."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

from ros_visualise.data import Header, Image
from ros_visualise.nodes import source
from ros_visualise.params import param
from ros_visualise.sources.calibration import Calibration
from ros_visualise.sources.camera import Camera
from ros_visualise.sources.playback import Playback
from ros_visualise.sources.video_pixels import parse_size


@dataclass(frozen=True)
class CameraParams:
    """Which camera, and how."""

    uri: str = param(
        "0",
        "device (/dev/video0 or 0), URL, test (a test pattern), or lavfi:GRAPH",
        restart=True,
        saved=False,
    )
    size: str = param(
        "", "size of the images, WIDTHxHEIGHT; empty leaves it to the camera", restart=True
    )
    fps: float = param(
        0.0, "frame rate to ask the camera for; 0 leaves it to the camera", min=0, restart=True
    )
    timeout: float = param(
        2.0,
        "seconds without an image after which the camera is reopened",
        min=0.1,
        max=60,
        restart=True,
    )
    frame_id: str = param("camera_optical", "frame_id of the images", restart=True)
    controls: str = param(
        "",
        "what to set of the device, as `v4l2-ctl -l` names it: brightness=128,auto_exposure=1",
        restart=True,
    )
    camera_info_url: str = param(
        "",
        "calibration of the camera, a YAML file of ROS: a path or file:///PATH",
        restart=True,
        saved=False,
    )


@source("camera", params=CameraParams, outputs={"image": Image}, live=True)
class CameraSource:
    """Show a live camera."""

    def __init__(self, params: CameraParams, playback: Playback) -> None:
        self._params, self._playback = params, playback
        self._calibration = Calibration(params.camera_info_url)
        size = parse_size(params.size)
        self._camera = Camera(params.uri, size, params.fps, params.timeout, params.controls)

    def messages(self) -> Iterator[tuple[str, Image]]:
        """The images as they come."""
        for stamp_ns, image in self._playback.follow(self._camera.images()):
            stamped = replace(image, header=Header(stamp_ns, self._params.frame_id))
            yield "image", self._calibration.add_to(stamped)

    def report(self) -> dict[str, Any]:
        """The images that came faster than they were taken."""
        return {"dropped": {"source": self._camera.dropped} if self._camera.dropped else {}}

    def close(self) -> None:
        """Let go of the camera."""
        self._camera.close()
