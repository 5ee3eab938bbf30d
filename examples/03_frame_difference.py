"""A node with a memory and a choice: what has changed since the previous frame?

ros-visualise demo --node examples/03_frame_difference.py:FrameDifference@fps_control
"""

from dataclasses import dataclass, replace
from enum import Enum

import cv2

from ros_visualise.data import Image
from ros_visualise.nodes import node, param


class Show(Enum):
    CHANGE = "change"
    MASK = "mask"


@dataclass(frozen=True)
class DifferenceParams:
    show: Show = param(Show.CHANGE, "how much has changed, or only where")
    threshold: int = param(30, "mask: a change above this counts", min=0, max=255)


@node("difference", params=DifferenceParams, inputs={"image": Image}, outputs={"image": Image})
class FrameDifference:
    """The difference of each image from the one before."""

    def __init__(self, params: DifferenceParams) -> None:
        self._before: Image | None = None

    def step(self, image: Image, params: DifferenceParams) -> Image | None:
        before, self._before = self._before, image
        if before is None or before.pixels.shape != image.pixels.shape:
            return None
        change = cv2.absdiff(image.pixels, before.pixels)
        if params.show is Show.MASK:
            change = cv2.threshold(change, params.threshold, 255, cv2.THRESH_BINARY)[1]
        return replace(image, data=change)

    def reset(self) -> None:
        """Time has jumped back: the image before is none of this one's."""
        self._before = None
