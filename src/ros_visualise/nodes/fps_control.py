"""Rate control: lets the images of a stream pass at a requested rate."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ros_visualise.core.params import param, when
from ros_visualise.core.rate import Pacer
from ros_visualise.data import Image
from ros_visualise.nodes import node


@dataclass(frozen=True)
class FpsParams:
    """Parameters of `FpsControl`."""

    fps: int = param(
        30,
        "maximum frame rate, Hz; 0 counts as 1",
        min=0,
        max=240,
        slider=(0, 30),
        used=when("enabled", True),
    )
    enabled: bool = param(True, "limit the rate; if off, every frame passes")


@node(
    "fps_control",
    params=FpsParams,
    inputs={"image": Image},
    outputs={"image": Image},
    topics={"image": "/controlled_stream"},
    drops="rate",
    timed=True,
)
class FpsControl:
    """Limits the rate of images, measured by their timestamps, without repeating or delaying any.

    Images without a timestamp are taken by their arrival times.
    """

    def __init__(self, params: FpsParams) -> None:
        self._pacer = Pacer()
        self._first_arrival_ns: int | None = None
        self._requested_hz: float | None = None

    def step(self, image: Image, params: FpsParams, arrival_ns: int) -> Image | None:
        """The image itself, or None to drop it."""
        self._requested_hz = max(params.fps, 1) if params.enabled else None
        if self._requested_hz is None:
            self._pacer.reset()
            return image
        stamp_ns = image.header.stamp_ns or self._since_first_arrival(arrival_ns)
        return image if self._pacer.passes(stamp_ns, self._requested_hz) else None

    def reset(self) -> None:
        """Let the next frame pass: time jumped."""
        self._pacer.reset()

    def _since_first_arrival(self, arrival_ns: int) -> int:
        if self._first_arrival_ns is None:
            self._first_arrival_ns = arrival_ns
        return arrival_ns - self._first_arrival_ns

    def report(self) -> dict[str, Any]:
        """The requested rate; None while every image passes."""
        return {"requested_hz": self._requested_hz}
