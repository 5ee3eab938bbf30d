"""The node that shows a live camera."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import suppress
from dataclasses import dataclass, make_dataclass, replace
from typing import Any, cast

from ros_visualise.core.errors import ParameterError
from ros_visualise.core.params import param, specs
from ros_visualise.data import Header, Image
from ros_visualise.nodes import source
from ros_visualise.sources.calibration import Calibration
from ros_visualise.sources.camera import LiveCamera, may_read_files, parse_address
from ros_visualise.sources.playback import Playback
from ros_visualise.sources.v4l2_controls import GROUP, control_params
from ros_visualise.sources.video_pixels import parse_size


@dataclass(frozen=True)
class CameraParams:
    """Parameters of `CameraSource`."""

    uri: str = param(
        "0",
        "device (/dev/video0 or 0), URL, test (a test pattern), or lavfi:GRAPH",
        restart=True,
        saved=False,
        file=may_read_files,
    )
    size: str = param("", "image size, WIDTHxHEIGHT; empty: the camera's own", restart=True)
    fps: float = param(0.0, "requested frame rate, Hz; 0: the camera's own", min=0, restart=True)
    timeout: float = param(
        2.0,
        "time without an image after which the camera is reopened, seconds",
        min=0.1,
        max=60,
        restart=True,
    )
    frame_id: str = param("camera_optical", "frame_id of the images", restart=True)
    camera_info_url: str = param(
        "",
        "camera calibration, a ROS YAML file: a path or file:///PATH",
        restart=True,
        saved=False,
        file=bool,
    )


def with_controls(params: CameraParams) -> CameraParams:
    """The same parameters, and the controls of the device with their current values."""
    own = {spec.name: getattr(params, spec.name) for spec in specs(CameraParams)}
    address = parse_address(params.uri)
    found = control_params(address.name) if address.is_device else []
    controls = [field for field in found if field[0] not in own]
    made = make_dataclass("CameraParams", controls, bases=(CameraParams,), frozen=True)
    return cast(CameraParams, made(**own))


@source(
    "camera",
    params=CameraParams,
    outputs={"image": Image},
    live=True,
    extend=("uri", with_controls),
)
class CameraSource:
    """Show a live camera."""

    def __init__(self, params: CameraParams, playback: Playback) -> None:
        self._params, self._playback = params, playback
        self._calibration = Calibration(params.camera_info_url)
        size = parse_size(params.size)
        controls = [spec for spec in specs(params) if spec.group == GROUP]
        self._controls = {spec.name for spec in controls}
        asked = {s.name: v for s in controls if (v := getattr(params, s.name)) != s.default}
        self._camera = LiveCamera(params.uri, size, params.fps, params.timeout, asked)

    def messages(self) -> Iterator[tuple[str, Image]]:
        """The live images."""
        for stamp_ns, image in self._playback.follow(self._camera.images()):
            stamped = replace(image, header=Header(stamp_ns, self._params.frame_id))
            yield "image", self._calibration.add_to(stamped)

    def configure(self, params: CameraParams, changed: Collection[str]) -> None:
        """Set the changed controls; if one is rejected, restore the others."""
        names = self._controls.intersection(changed)
        before = self._params
        try:
            self._camera.set_controls({name: getattr(params, name) for name in names})
        except ParameterError:
            with suppress(ParameterError):
                self._camera.set_controls({name: getattr(before, name) for name in names})
            raise
        self._params = replace(before, **{name: getattr(params, name) for name in names})

    def report(self) -> dict[str, Any]:
        """Images dropped because they came too fast."""
        return {"dropped": {"source": self._camera.dropped} if self._camera.dropped else {}}

    def close(self) -> None:
        """Close the camera."""
        self._camera.close()
