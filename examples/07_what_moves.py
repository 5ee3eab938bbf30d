"""A node with an action: it marks what moves, and learns the background again at a button.

ros-visualise video flight.mp4 --node examples/07_what_moves.py:Moving@fps_control
"""

from dataclasses import dataclass, replace

import cv2

from ros_visualise.data import Image
from ros_visualise.nodes import action, node, param


@dataclass(frozen=True)
class MovingParams:
    threshold: float = param(16.0, "squared distance from the background", min=1, max=200)


@node("moving", params=MovingParams, inputs={"image": Image}, outputs={"image": Image})
class Moving:
    """Marks what differs from the background in red."""

    def __init__(self, params: MovingParams) -> None:
        self.learn()

    def step(self, image: Image, params: MovingParams) -> Image:
        self._background.setVarThreshold(params.threshold)
        moves = self._background.apply(image.pixels) == 255
        marked = image.pixels.copy()
        marked[moves] = (0, 0, 255) if marked.ndim == 3 else 255
        return replace(image, data=marked)

    @action("learn the background again")
    def learn(self) -> None:
        self._background = cv2.createBackgroundSubtractorMOG2(detectShadows=False)

    reset = learn  # time has jumped: after a seek the background is another
