"""A node of two topics, matched by equal stamps: what did the filters change?

ros-visualise video flight.mp4 --node \\
    examples/08_before_and_after.py:change@filters,before=/controlled_stream
"""

from dataclasses import replace

import cv2

from ros_visualise.data import Image
from ros_visualise.nodes import Exact, node


@node(
    "change",
    inputs={"after": Image, "before": Image},
    outputs={"image": Image},
    sync=Exact(),  # the images of one frame, whichever comes first
)
def change(after: Image, before: Image, params: object) -> Image | None:
    """The absolute difference of both images, in gray."""
    one, other = (
        cv2.cvtColor(image.pixels, cv2.COLOR_BGR2GRAY) if image.pixels.ndim == 3 else image.pixels
        for image in (after, before)
    )
    if one.shape != other.shape:
        return None  # the filters resize
    return replace(after, data=cv2.absdiff(one, other), encoding="mono8")
