"""The node that rectifies images."""

from __future__ import annotations

from dataclasses import dataclass, replace

from ros_visualise.core.errors import UnsupportedImage
from ros_visualise.core.params import param
from ros_visualise.data import Image
from ros_visualise.nodes import node
from ros_visualise.vision import color, rectification
from ros_visualise.vision.rectification import Interpolation
from ros_visualise.vision.threads import fit_threads


@dataclass(frozen=True)
class RectifyParams:
    """Parameters of `rectify`."""

    alpha: float = param(
        -1.0,
        "field of view: 0 is valid pixels only, 1 all of the camera's; below 0 as calibrated",
        min=-1,
        max=1,
    )
    interpolation: Interpolation = param(
        Interpolation.LINEAR, "interpolation between pixels; depth images always use nearest"
    )


@node(
    "rectify",
    params=RectifyParams,
    inputs={"image": Image},
    outputs={"image_rect": Image},
    topics={"image_rect": "/image_rect"},
    drops="uncalibrated",
    calibrated=True,
)
def rectify(image: Image, params: RectifyParams) -> Image | None:
    """Removes lens distortion from images and from their calibration."""
    if color.is_bayer(image.encoding):
        raise UnsupportedImage(
            f"{image.encoding}: set filters.demosaic=true, and rectify its result"
        )
    info = image.camera_info
    if info is None:
        return None
    if (info.width, info.height) != (image.width, image.height):
        raise UnsupportedImage(
            f"calibration for {info.width}x{info.height} does not fit images of"
            f" {image.width}x{image.height}"
        )
    fit_threads(image.pixels)
    model = rectification.model_of(info, params.alpha)
    pixels = rectification.rectify(image.pixels, model, params.interpolation)
    return replace(image, data=pixels, camera_info=rectification.rectified(info, model))
