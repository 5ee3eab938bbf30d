"""A node with two outputs: the mask of a colour, and its share of the image as a number to plot.

ros-visualise video flight.mp4 --node examples/06_share_of_a_colour.py:green@fps_control
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np

from ros_visualise.data import Image, Number
from ros_visualise.nodes import node, param


@dataclass(frozen=True)
class GreenParams:
    hue: int = param(
        60, "hue of the colour, degrees / 2: 0 red, 60 green, 120 blue", min=0, max=179
    )
    width: int = param(20, "largest distance from that hue", min=1, max=90)
    saturation: int = param(60, "least saturation; gray has no hue", min=0, max=255)


@node(
    "green",
    params=GreenParams,
    inputs={"image": Image},
    outputs={"mask": Image, "share": Number},
)
def green(image: Image, params: GreenParams) -> dict[str, Image | Number]:
    """Finds a colour: in the panel *Plot* choose /share."""
    hue, saturation, _ = cv2.split(cv2.cvtColor(image.pixels, cv2.COLOR_BGR2HSV))
    apart = np.abs(hue.astype(int) - params.hue)
    found = (np.minimum(apart, 180 - apart) <= params.width) & (saturation >= params.saturation)
    mask = np.where(found, 255, 0).astype(np.uint8)
    return {
        "mask": replace(image, data=mask, encoding="mono8"),
        "share": Number(float(found.mean()), image.header),
    }
