from enum import Enum

import numpy as np
import pytest

from ros_visualise.core.errors import UnsupportedImage
from ros_visualise.core.params import specs, update
from ros_visualise.data import ENCODINGS, MEASUREMENTS, CameraInfo, Header, Image
from ros_visualise.nodes import find
from ros_visualise.nodes.filters import FiltersParams, filters

OFF = update(FiltersParams(), {"gray": False, "threshold_mode": "off"})
HEADER = Header(123, "camera")
SIZES = [(1, 1), (1, 7), (7, 1), (5, 3), (101, 67)]
PLAIN = [name for name in ENCODINGS if not name.startswith("bayer")]
BAYER = [name for name in ENCODINGS if name.startswith("bayer")]


def image(encoding, size=(5, 3), camera_info=None):
    """Noise over the whole range."""
    dtype, channels = ENCODINGS[encoding]
    shape = (*size, channels) if channels > 1 else size
    noise = np.random.default_rng(1).integers(0, np.iinfo(dtype).max + 1, shape, dtype)
    return Image(noise, encoding, HEADER, camera_info)


def run(one, **changes):
    return filters(one, update(OFF, changes))


def luma(one):
    order = [2, 1, 0] if one.encoding.startswith("bgr") else [0, 1, 2]
    return one.pixels[..., order] @ np.array([0.299, 0.587, 0.114])


@pytest.mark.parametrize("encoding", PLAIN)
def test_truncating_leaves_no_value_above_the_threshold(encoding):
    one = image(encoding)
    found = filters(one, update(FiltersParams(), {"threshold": 128}))
    unit = np.iinfo(one.pixels.dtype).max // 255
    expected = np.minimum(luma(one) if one.is_color else one.pixels, 128 * unit)
    rounding = 0.6 if unit == 1 else 3
    assert found.encoding == ("mono16" if unit > 1 else "mono8")
    assert np.abs(found.pixels - expected).max() <= rounding
    assert found.header == HEADER


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_with_all_off_it_gives_the_image_itself(encoding):
    one = image(encoding)
    assert run(one, demosaic=False) is one


def test_gray_of_gray_is_the_image_itself():
    one = image("mono16")
    assert run(one, gray=True) is one


ONE_EACH = [
    {spec.name: choice}
    for spec in specs(FiltersParams)
    if issubclass(spec.type, Enum) and not spec.name.endswith("_shape")
    for choice in spec.choices
    if choice != "off"
] + [
    {"scale": 0.4},
    {"scale": 1.7},
    {"width": 9},
    {"height": 2},
    {"gray": True},
    {"brightness": 20},
    {"contrast": 1.3},
    {"sharpen": 1.0},
    {"blur": "gaussian", "blur_size": 31},
    {"blur": "median", "blur_size": 31},
    {"morphology": "open", "morphology_size": 31, "morphology_shape": "ellipse"},
    {"threshold_mode": "adaptive_mean", "adaptive_size": 255},
]


@pytest.mark.parametrize("size", SIZES, ids=lambda size: "{}x{}".format(*size))
@pytest.mark.parametrize("changes", ONE_EACH, ids=str)
def test_every_filter_takes_every_kind_and_size(changes, size):
    for encoding in PLAIN:
        one = image(encoding, size)
        if "hsv" in changes and not one.is_color:
            with pytest.raises(UnsupportedImage, match="hsv"):
                run(one, **changes)
            continue
        before = one.pixels.copy()
        found = run(one, **changes)
        assert np.array_equal(one.pixels, before)
        assert found.pixels.dtype == (np.uint8 if changes.get("hsv") == "mask" else before.dtype)
        to_mono = "gray" in changes or changes.get("hsv") == "mask"
        to_mono |= changes.get("threshold_mode", "").startswith(("otsu", "adaptive"))
        if to_mono:
            assert found.encoding.startswith("mono")
        else:
            assert found.encoding == encoding
        if not {"scale", "width", "height"} & set(changes):
            assert (found.height, found.width) == size


def test_alpha_is_neither_lost_nor_filtered():
    one = image("rgba8")
    found = run(one, blur="gaussian", threshold_mode="binary", threshold=128)
    assert np.array_equal(found.pixels[..., 3], one.pixels[..., 3])
    assert set(np.unique(found.pixels[..., :3])) == {0, 255}
    assert np.array_equal(run(one, flip="vertical").pixels, one.pixels[::-1])


@pytest.mark.parametrize("encoding", ["rgb8", "bgr16"])
def test_both_orders_of_colour_give_the_same(encoding):
    one = image(encoding, (31, 17))
    other = ("bgr" if encoding.startswith("rgb") else "rgb") + encoding[3:]
    swapped = Image(one.pixels[..., ::-1].copy(), other, HEADER)
    changes = {
        "equalize": "clahe",
        "hsv": "keep",
        "saturation_min": 60,
        "threshold_mode": "to_zero",
        "threshold": 128,
    }
    found, same = run(one, **changes).pixels, run(swapped, **changes).pixels
    assert np.array_equal(found, same[..., ::-1])
    assert len(np.unique(found)) > 2


@pytest.mark.parametrize("encoding", BAYER)
def test_a_mosaic_becomes_colour(encoding):
    one = image(encoding)
    found = run(one)
    assert found.encoding == f"bgr{encoding[len('bayer_rggb') :]}"
    assert found.header == HEADER
    assert filters(one, FiltersParams()).encoding == f"mono{encoding[len('bayer_rggb') :]}"


def test_a_mosaic_itself_is_not_filtered():
    one = image("bayer_gbrg8", (20, 20))
    with pytest.raises(UnsupportedImage, match=r"bayer_gbrg8.*demosaic=true"):
        run(one, demosaic=False, blur="median")
    assert run(one, demosaic=False, gray=True) is one


def test_hsv_after_gray_says_what_to_do():
    with pytest.raises(UnsupportedImage, match="gray=false"):
        run(image("bgr8"), gray=True, hsv="keep")


def test_the_order_of_application_is_that_of_the_parameters():
    chain = [
        {"scale": 1.5},
        {"flip": "horizontal"},
        {"blur": "gaussian", "blur_size": 3},
        {"contrast": 1.4, "brightness": -10},
        {"equalize": "global"},
        {"sharpen": 0.7},
        {"hsv": "keep", "hue_min": 20, "hue_max": 150},
        {"threshold_mode": "truncate", "threshold": 200},
        {"morphology": "dilate"},
    ]
    one = image("bayer_rggb8", (24, 18))
    one_by_one = run(one)
    for changes in chain:
        one_by_one = run(one_by_one, **changes)
    at_once = run(one, **{name: value for changes in chain for name, value in changes.items()})
    assert np.array_equal(at_once.pixels, one_by_one.pixels)
    backwards = run(one)
    for changes in reversed(chain):
        backwards = run(backwards, **changes)
    assert not np.array_equal(at_once.pixels, backwards.pixels)


def test_a_smaller_image_has_a_calibration_that_fits():
    K = np.array([[500.0, 0, 319.5], [0, 500, 239.5], [0, 0, 1]])
    info = CameraInfo(480, 640, K, np.array([0.1, 0, 0.01, 0.02, 0]), P=np.eye(3, 4))
    one = image("bgr8", (480, 640), info)
    assert filters(one, FiltersParams()).camera_info is info
    half = run(one, scale=0.5).camera_info
    assert (half.width, half.height, half.K[0, 0], half.K[0, 2]) == (320, 240, 250, 159.5)
    mirrored = run(one, width=320, flip="horizontal").camera_info
    assert mirrored.D.tolist() == [0.1, 0, 0.01, -0.02, 0]
    assert mirrored.K[0, 2] == 319 - 159.5


def test_levels_count_in_257_at_16_bits():
    eight = image("mono8", (20, 30))
    sixteen = Image(eight.pixels.astype(np.uint16) * np.uint16(257), "mono16", HEADER)
    for changes in (
        {"brightness": 31},
        {"threshold_mode": "to_zero", "threshold": 90},
        {"equalize": "global"},
        {"blur": "median", "blur_size": 9},
        {"threshold_mode": "otsu"},
    ):
        wide, narrow = run(sixteen, **changes).pixels / 257, run(eight, **changes).pixels
        assert np.abs(wide - narrow).max() <= 0.5


def test_the_declaration():
    declared = find("filters")
    assert (list(declared.inputs), list(declared.outputs)) == (["image"], ["image"])
    assert declared.stateless
    defaults = {spec.name: spec.default for spec in specs(FiltersParams)}
    assert (defaults["gray"], defaults["threshold"]) == (True, 255)
    assert defaults["threshold_mode"].value == "truncate"


@pytest.mark.parametrize("encoding", MEASUREMENTS)
def test_measurements_are_refused_by_name(encoding):
    dtype, channels = MEASUREMENTS[encoding]
    pixels = np.ones((3, 5) if channels == 1 else (3, 5, channels), dtype)
    for params in (FiltersParams(), OFF):
        with pytest.raises(UnsupportedImage, match=f"{encoding} holds measurements"):
            filters(Image(pixels, encoding), params)


SWITCHES = [
    {},
    {"gray": True},
    {"width": 9},
    *({"blur": mode} for mode in ("gaussian", "median", "bilateral")),
    *({"equalize": mode} for mode in ("global", "clahe")),
    {"sharpen": 2.0},
    {"hsv": "keep"},
    *({"threshold_mode": mode, "threshold": 128} for mode in ("binary", "otsu", "adaptive_mean")),
    {"morphology": "gradient"},
]


@pytest.mark.parametrize("switched", SWITCHES, ids=str)
def test_what_waits_for_its_switch_changes_nothing_and_what_does_not_does(switched):
    smooth = np.kron(image("bgr8", (6, 5)).pixels, np.ones((5, 5, 1), np.uint8))
    one = Image(smooth // 2 + 40, "bgr8", HEADER)
    params = update(OFF, switched)
    before = filters(one, params).pixels
    for spec in specs(params):
        if spec.type not in (int, float) or spec.min is None or spec.max is None:
            continue
        low, high = spec.range or (spec.min, spec.max)
        ends = low, (low + high) / 2, high
        moved = [filters(one, update(params, {spec.name: spec.type(end)})).pixels for end in ends]
        changes = any(not np.array_equal(other, before) for other in moved)
        assert changes == spec.used(params), spec.name
