"""A source of your own with an action: a ball that bounces. 21_own_page.py opens a page with it.

On a ROS graph the action is a service, /ball/kick:

rosrun ros_visualise node examples/05_own_source.py:Ball
"""

from collections.abc import Generator, Iterator
from dataclasses import dataclass

import cv2
import numpy as np

from ros_visualise.data import Header, Image, Pixels
from ros_visualise.nodes import action, param, source
from ros_visualise.sources.playback import Playback


@dataclass(frozen=True)
class BallParams:
    gravity: float = param(3.0, "m/s^2 downwards", min=0.1, max=20, restart=True)


@source("ball", params=BallParams, outputs={"image": Image})
class Ball:
    """A ball that falls, bounces and comes to rest, until it is kicked."""

    duration_ns: int | None = None  # it never ends

    def __init__(self, params: BallParams, playback: Playback) -> None:
        self._params, self._playback = params, playback
        self._height, self._speed = 1.0, 0.0  # metres, and metres per second upwards

    @action("kick it up")
    def kick(self) -> None:
        self._speed = 2.0

    def messages(self) -> Iterator[tuple[str, Image]]:
        """The images, each when its time has come: paused, stepped and sped up as any others."""
        for stamp_ns, pixels in self._playback.run(self):
            yield "image", Image(pixels, "mono8", Header(stamp_ns, "camera"))

    def read(self, start_ns: int) -> Generator[tuple[int, Pixels], None, None]:
        """(Time, pixels) without end: what `Playback.run` plays."""
        while True:
            pixels = np.zeros((320, 320), np.uint8)
            row = round((0.9 - 0.7 * min(self._height, 1)) * 320)
            yield start_ns, cv2.circle(pixels, (160, row), 26, 255, -1)
            start_ns += 40_000_000
            self._speed -= self._params.gravity * 0.04
            self._height += self._speed * 0.04
            if self._height < 0:
                self._height, self._speed = 0.0, -0.8 * self._speed

    def close(self) -> None:
        """Nothing is open."""
