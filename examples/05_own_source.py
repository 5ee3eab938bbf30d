"""A source of one's own with an action, and its edges, on a page: at the printed address

python examples/05_own_source.py [PORT]

The action is a button there. On a ROS graph it is a service, /ball/kick:

rosrun ros_visualise node examples/05_own_source.py:Ball
"""

import sys
from collections.abc import Generator, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace

import cv2
import numpy as np

from ros_visualise.data import Header, Image
from ros_visualise.graph.pipelines import alone
from ros_visualise.nodes import action, find_node, param, source
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sources.playback import Playback
from ros_visualise.ui import ViewOptions, open_view

PERIOD_NS = 40_000_000
SIZE = 320


@dataclass(frozen=True)
class BallParams:
    gravity: float = param(3.0, "m/s^2 downwards", min=0.1, max=20, restart=True)


@source("ball", params=BallParams, outputs={"image": Image})
class Ball:
    """A ball that falls, bounces and comes to rest, until somebody kicks it."""

    duration_ns: int | None = None  # it never ends

    def __init__(self, params: BallParams, playback: Playback) -> None:
        self._params, self._playback = params, playback
        self._height, self._speed = 1.0, 0.0  # metres, and metres per second upwards

    @action("kick it up")
    def kick(self) -> None:
        self._speed = 2.0

    def messages(self) -> Iterator[tuple[str, Image]]:
        """The images, each when its time has come: paused, stepped and sped up as any others."""
        for stamp_ns, image in self._playback.run(self):
            yield "image", replace(image, header=Header(stamp_ns, "camera"))

    def read(self, start_ns: int) -> Generator[tuple[int, Image], None, None]:
        """(Time, image) without end: what `Playback.run` plays."""
        time_ns = start_ns
        while True:
            yield time_ns, self._draw()
            self._move(PERIOD_NS / 1e9)
            time_ns += PERIOD_NS

    def close(self) -> None:
        """Nothing is open."""

    def _move(self, seconds: float) -> None:
        self._speed -= self._params.gravity * seconds
        self._height += self._speed * seconds
        if self._height < 0:
            self._height, self._speed = 0.0, -0.8 * self._speed

    def _draw(self) -> Image:
        pixels = np.zeros((SIZE, SIZE), np.uint8)
        row = round((0.9 - 0.7 * min(self._height, 1)) * SIZE)
        cv2.circle(pixels, (SIZE // 2, row), SIZE // 12, 255, -1)
        return Image(pixels, "mono8")


def main(port: int) -> None:
    """Show the ball on the page until Ctrl-C."""
    graph = alone(Ball).insert(find_node("edge_detector"), after="ball")
    runtime = LocalRuntime(graph, Playback())
    view = open_view("web", ViewOptions(port=port))
    try:
        view.open(runtime)
        runtime.start()
        while not view.closed:
            view.spin(0.1)
    finally:
        view.close()
        runtime.stop()


if __name__ == "__main__":
    with suppress(KeyboardInterrupt):
        main(int(sys.argv[1]) if len(sys.argv) > 1 else 8080)
