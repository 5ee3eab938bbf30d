"""The first node of a lesson: its picture, small enough to see pixels."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import cv2

from ros_visualise.core.params import param
from ros_visualise.data import Image, Message, Pixels
from ros_visualise.lessons.lesson import GIVES, TAKES, Lesson, show
from ros_visualise.nodes import node
from ros_visualise.vision import color
from ros_visualise.vision.reshape import resized

NAME = "picture"


@dataclass(frozen=True)
class PictureParams:
    """The size of the picture."""

    longest: int = param(
        640,
        "length of the longer side, pixels; smaller pictures stay unchanged",
        min=16,
        max=4096,
        slider=(64, 1280),
    )


def picture_of(lesson: Lesson) -> Any:
    """The node that gives a lesson its picture and introduction."""

    @node(NAME, params=PictureParams, inputs=TAKES, outputs=GIVES)
    def picture(image: Image, params: PictureParams) -> dict[str, Message]:
        """The picture."""
        pixels = fit(color.bgr_of(image), params.longest)
        height, width = pixels.shape[:2]
        shown = show(image, pixels, lesson.intro, pixels, width=width, height=height)
        result, info = shown["image"], image.camera_info
        if info is None or not isinstance(result, Image):
            return shown
        info = resized(info, (image.width, image.height), (width, height))
        return {**shown, "image": replace(result, camera_info=info)}

    return picture


def fit(pixels: Pixels, longest: int) -> Pixels:
    """A picture reduced to that length by area averaging."""
    height, width = pixels.shape[:2]
    scale = longest / max(height, width)
    if scale >= 1:
        return pixels
    size = max(1, round(width * scale)), max(1, round(height * scale))
    return cv2.resize(pixels, size, interpolation=cv2.INTER_AREA)
