"""A filter of your own. Its slider, its option and its topic come from this declaration:

ros-visualise demo --node examples/01_own_filter.py:posterize --set posterize.levels=3
"""

from dataclasses import dataclass, replace

from ros_visualise.data import Image
from ros_visualise.nodes import node, param


@dataclass(frozen=True)
class PosterizeParams:
    levels: int = param(4, "number of brightness levels", min=2, max=32)


@node("posterize", params=PosterizeParams, inputs={"image": Image}, outputs={"image": Image})
def posterize(image: Image, params: PosterizeParams) -> Image:
    """Reduces the image to a few brightness levels."""
    step = 256 // params.levels
    return replace(image, data=image.pixels // step * step)
