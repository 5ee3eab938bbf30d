"""A node that darkens the corners of images."""

from dataclasses import dataclass, replace

import numpy as np

from ros_visualise.data import Image
from ros_visualise.nodes import node, param


@dataclass(frozen=True)
class VignetteParams:
    strength: float = param(0.5, "darkness of the corners; 0 is off", min=0, max=1)


@node("vignette", params=VignetteParams, inputs={"image": Image}, outputs={"image": Image})
def vignette(image: Image, params: VignetteParams) -> Image:
    """Darkens the corners of images."""
    height, width = image.pixels.shape[:2]
    y, x = np.mgrid[-1 : 1 : height * 1j, -1 : 1 : width * 1j]
    kept = 1 - params.strength * (x**2 + y**2) / 2
    pixels = image.pixels * (kept if image.pixels.ndim == 2 else kept[..., None])
    return replace(image, data=pixels.astype(image.pixels.dtype))
