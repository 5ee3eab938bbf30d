"""Image filters, each switched on or off, applied in the order of their parameters."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

from ros_visualise.core.errors import UnsupportedImage
from ros_visualise.core.params import param, unless, when
from ros_visualise.data import CameraInfo, Image, Pixels
from ros_visualise.nodes import node
from ros_visualise.vision import color
from ros_visualise.vision.color import HsvMode
from ros_visualise.vision.depth import reusable
from ros_visualise.vision.morphology import KernelShape, Morphology, morph
from ros_visualise.vision.reshape import Flip, flip, flipped, resize, resized, target_size
from ros_visualise.vision.smoothing import Blur, blur, sharpen
from ros_visualise.vision.threshold import Threshold, threshold
from ros_visualise.vision.tone import Equalize, adjust, equalize

_ADAPTIVE = (Threshold.ADAPTIVE_MEAN, Threshold.ADAPTIVE_GAUSSIAN)
_SELECTS = unless("hsv", HsvMode.OFF)
_MORPHS = unless("morphology", Morphology.OFF)


@dataclass(frozen=True)
class FiltersParams:
    """Parameters of `filters`, in the order in which they are applied."""

    demosaic: bool = param(
        True, "demosaicing of Bayer images to colour; other images are unchanged", group="size"
    )
    scale: float = param(
        1.0,
        "resize factor; 1 is off",
        min=0.01,
        max=4,
        slider=(0.1, 2),
        group="size",
        used=lambda p: not (p.width or p.height),
    )
    width: int = param(
        0,
        "width after resizing, pixels; 0: computed from height or scale",
        min=0,
        max=16384,
        slider=(0, 3840),
        group="size",
    )
    height: int = param(
        0,
        "height after resizing, pixels; 0: computed from width or scale",
        min=0,
        max=16384,
        slider=(0, 2160),
        group="size",
    )
    flip: Flip = param(
        Flip.OFF,
        "mirroring: left to right (horizontal), top to bottom (vertical), or both",
        group="size",
    )
    gray: bool = param(True, "conversion of colour to gray: 0.299 R + 0.587 G + 0.114 B")
    blur: Blur = param(
        Blur.OFF,
        "kind of smoothing; a median larger than 5 pixels reduces 16-bit images to 256 levels",
        group="blur",
    )
    blur_size: int = param(
        5,
        "width of the blur's window, pixels; even numbers are rounded up to odd",
        min=1,
        max=31,
        group="blur",
        used=unless("blur", Blur.OFF),
    )
    blur_sigma: float = param(
        0.0,
        "gaussian and bilateral: standard deviation, pixels; 0: computed from the size",
        min=0,
        max=20,
        group="blur",
        used=when("blur", Blur.GAUSSIAN, Blur.BILATERAL),
    )
    bilateral_color: float = param(
        50.0,
        "bilateral: difference above which values are hardly mixed (x 257 for 16-bit images)",
        min=1,
        max=255,
        group="blur",
        used=when("blur", Blur.BILATERAL),
    )
    contrast: float = param(
        1.0,
        "factor that multiplies all values; 1 is off",
        min=0,
        max=10,
        slider=(0, 3),
        group="tone",
    )
    brightness: int = param(
        0,
        "offset added to all values (x 257 for 16-bit images); 0 is off",
        min=-255,
        max=255,
        group="tone",
    )
    equalize: Equalize = param(
        Equalize.OFF,
        "histogram equalization: global, or clahe (in tiles); in colour images, of the brightness",
        group="tone",
    )
    clahe_clip: float = param(
        2.0,
        "clahe: contrast limit; 0 is unlimited",
        min=0,
        max=100,
        slider=(0, 10),
        group="tone",
        used=when("equalize", Equalize.CLAHE),
    )
    clahe_tiles: int = param(
        8,
        "clahe: number of tiles along each side",
        min=1,
        max=64,
        slider=(1, 16),
        group="tone",
        used=when("equalize", Equalize.CLAHE),
    )
    sharpen: float = param(
        0.0, "strength of the unsharp mask; 0 is off", min=0, max=10, group="sharpen"
    )
    sharpen_sigma: float = param(
        1.5,
        "sharpen: standard deviation of the mask's blur, pixels",
        min=0.1,
        max=20,
        group="sharpen",
        used=unless("sharpen", 0.0),
    )
    hsv: HsvMode = param(
        HsvMode.OFF,
        "selection of a range of colours: others become black, or a mask; needs gray=false",
        group="hsv",
    )
    hue_min: int = param(
        0,
        "lowest hue, degrees / 2; if above hue_max, the range wraps around through red",
        min=0,
        max=179,
        group="hsv",
        used=_SELECTS,
    )
    hue_max: int = param(
        179, "highest hue, degrees / 2", min=0, max=179, group="hsv", used=_SELECTS
    )
    saturation_min: int = param(0, "lowest saturation", min=0, max=255, group="hsv", used=_SELECTS)
    saturation_max: int = param(
        255, "highest saturation", min=0, max=255, group="hsv", used=_SELECTS
    )
    value_min: int = param(
        0, "lowest brightness (V), 0 to 255", min=0, max=255, group="hsv", used=_SELECTS
    )
    value_max: int = param(
        255, "highest value (brightness)", min=0, max=255, group="hsv", used=_SELECTS
    )
    threshold_mode: Threshold = param(
        Threshold.TRUNCATE,
        "kind of threshold; otsu and adaptive convert colour to gray",
        group="threshold mode",
    )
    threshold: int = param(
        255,
        "threshold of each channel (x 257 for 16-bit images); truncate changes nothing at 255; otsu"
        " and adaptive choose their own",
        min=0,
        max=255,
        used=unless("threshold_mode", Threshold.OFF, Threshold.OTSU, *_ADAPTIVE),
    )
    adaptive_size: int = param(
        11,
        "adaptive: width of the window, pixels; even numbers are rounded up to odd",
        min=3,
        max=255,
        slider=(3, 51),
        group="threshold mode",
        used=when("threshold_mode", *_ADAPTIVE),
    )
    adaptive_offset: float = param(
        2.0,
        "adaptive: offset of the threshold below the window's mean (x 257 for 16-bit images)",
        min=-255,
        max=255,
        slider=(-50, 50),
        group="threshold mode",
        used=when("threshold_mode", *_ADAPTIVE),
    )
    morphology: Morphology = param(
        Morphology.OFF, "morphological operation on bright areas", group="morphology"
    )
    morphology_shape: KernelShape = param(
        KernelShape.RECT,
        "morphology: shape of the structuring element",
        group="morphology",
        used=_MORPHS,
    )
    morphology_size: int = param(
        3,
        "morphology: width of the element, pixels; even numbers are rounded up to odd",
        min=1,
        max=31,
        group="morphology",
        used=_MORPHS,
    )


@node(
    "filters",
    params=FiltersParams,
    inputs={"image": Image},
    outputs={"image": Image},
    topics={"image": "/processed_image"},
)
def filters(image: Image, params: FiltersParams) -> Image:
    """Image filters, each switched on or off, applied in the order of their parameters."""
    color.refuse_measurements(image.encoding)
    image = _demosaic(image, params)
    order = color.order_of(image.encoding)
    pixels = _reshape(image.pixels, params)
    if params.gray:
        pixels = color.to_gray(pixels, order)
    pixels = color.keep_alpha(partial(_values, order=order, p=params), pixels)
    if pixels is image.pixels:
        return image
    if color.is_bayer(image.encoding):
        raise UnsupportedImage(
            f"cannot filter a raw Bayer image ({image.encoding}); set demosaic=true"
        )
    encoding = color.encoding_of(pixels, order)
    return replace(
        image, data=pixels, encoding=encoding, camera_info=_calibration(image, pixels, params)
    )


def _demosaic(image: Image, p: FiltersParams) -> Image:
    if not p.demosaic or not color.is_bayer(image.encoding):
        return image
    pixels = color.demosaic(image.pixels, image.encoding)
    return replace(image, data=pixels, encoding=color.encoding_of(pixels, "BGR"))


def _reshape(pixels: Pixels, p: FiltersParams) -> Pixels:
    height, width = pixels.shape[:2]
    size = target_size((width, height), p.scale, p.width, p.height)
    return flip(resize(pixels, size), p.flip)


def _values(pixels: Pixels, order: str, p: FiltersParams) -> Pixels:
    pixels = blur(pixels, p.blur, p.blur_size, p.blur_sigma, p.bilateral_color)
    pixels = adjust(pixels, p.contrast, p.brightness)
    pixels = equalize(pixels, order, p.equalize, p.clahe_clip, p.clahe_tiles)
    pixels = sharpen(pixels, p.sharpen, p.sharpen_sigma)
    low = (p.hue_min, p.saturation_min, p.value_min)
    high = (p.hue_max, p.saturation_max, p.value_max)
    pixels = color.select_hsv(pixels, order, p.hsv, low, high)
    pixels = threshold(
        pixels,
        order,
        p.threshold_mode,
        p.threshold,
        p.adaptive_size,
        p.adaptive_offset,
        into=reusable(pixels),
    )
    return morph(pixels, p.morphology, p.morphology_shape, p.morphology_size)


def _calibration(image: Image, pixels: Pixels, p: FiltersParams) -> CameraInfo | None:
    info, before = image.camera_info, (image.width, image.height)
    after = (pixels.shape[1], pixels.shape[0])
    if info is None:
        return None
    if after != before:
        info = resized(info, before, after)
    if p.flip is not Flip.OFF:
        ways = {"horizontal": p.flip.horizontal, "vertical": p.flip.vertical}
        info = flipped(info, after, **ways)
    return info
