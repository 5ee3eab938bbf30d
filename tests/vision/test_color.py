import numpy as np
import pytest
from by_definition import differ_by

from ros_visualise.core.errors import UnsupportedImage
from ros_visualise.vision import color
from ros_visualise.vision.color import HsvMode

PATTERNS = ["rggb", "bggr", "gbrg", "grbg"]
LUMA_BGR = np.array([0.114, 0.587, 0.299])


def mosaic_of(bgr, pattern):
    """What a sensor with that pattern sees of an image."""
    mosaic = np.empty(bgr.shape[:2], bgr.dtype)
    for place, letter in enumerate(pattern):
        there = np.s_[place // 2 :: 2, place % 2 :: 2]
        mosaic[there] = bgr[..., "bgr".index(letter)][there]
    return mosaic


def test_gray_is_the_luma(colored):
    expected = np.rint(colored @ LUMA_BGR).astype(colored.dtype)
    assert differ_by(color.to_gray(colored, "BGR"), expected) <= 1
    assert differ_by(color.to_gray(colored[..., ::-1], "RGB"), expected) <= 1


def test_gray_of_gray_is_the_same_array(gray):
    assert color.to_gray(gray, "BGR") is gray


def test_gray_leaves_alpha_out(colored):
    alpha = np.zeros(colored.shape[:2], colored.dtype)
    with_alpha = np.dstack((colored, alpha))
    assert differ_by(color.to_gray(with_alpha, "BGR"), color.to_gray(colored, "BGR")) == 0


@pytest.mark.parametrize("pattern", PATTERNS)
@pytest.mark.parametrize("shape", [(3, 3), (6, 8), (5, 7), (2, 2)])
def test_demosaic_of_one_colour_gives_it_everywhere(pattern, shape, dtype):
    bgr = np.empty((*shape, 3), dtype)
    bgr[:] = np.array([10, 100, 200]) * (np.iinfo(dtype).max // 255)
    encoding = f"bayer_{pattern}{8 * bgr.itemsize}"
    assert differ_by(color.demosaic(mosaic_of(bgr, pattern), encoding), bgr) == 0


@pytest.mark.parametrize("pattern", PATTERNS)
def test_demosaic_interpolates_a_ramp_exactly(pattern, dtype):
    y, x = np.mgrid[:10, :12] * (np.iinfo(dtype).max // 255)
    bgr = np.stack((2 * x + 4 * y, 8 * x + 2 * y, 4 * x + 6 * y), axis=-1).astype(dtype)
    encoding = f"bayer_{pattern}{8 * bgr.itemsize}"
    inside = np.s_[1:-1, 1:-1]
    found = color.demosaic(mosaic_of(bgr, pattern), encoding)
    assert differ_by(found[inside], bgr[inside]) == 0


@pytest.mark.parametrize("shape", [(1, 1), (1, 5), (5, 1), (2, 3), (3, 2)])
def test_demosaic_of_a_tiny_uniform_mosaic_is_not_black(shape, dtype):
    mosaic = np.full(shape, 77, dtype)
    found = color.demosaic(mosaic, "bayer_grbg8")
    assert differ_by(found, np.full((*shape, 3), 77, dtype)) == 0


def test_demosaic_of_a_real_mosaic(recordings):
    cv2 = pytest.importorskip("cv2")
    folder = recordings / "bayer"
    raw = np.fromfile(folder / "DSC_1339_768x512_rggb.raw", np.uint16).reshape(512, 768)
    reference = cv2.imread(str(folder / "DSC_1339_768x512_rggb_out_demosaic.png"), -1)
    likeness = {
        pattern: min(
            np.corrcoef(channel.ravel(), expected.ravel())[0, 1]
            for channel, expected in zip(
                cv2.split(color.demosaic(raw, f"bayer_{pattern}16")),
                cv2.split(reference),
                strict=True,
            )
        )
        for pattern in PATTERNS
    }  # the reference has its channels balanced as well
    assert likeness.pop("rggb") > 0.98
    assert max(likeness.values()) < 0.8


def test_alpha_stays_as_it_was(colored):
    alpha = np.arange(colored[..., 0].size, dtype=colored.dtype).reshape(colored.shape[:2])
    with_alpha = np.dstack((colored, alpha))
    inverted = color.keep_alpha(np.invert, with_alpha)
    assert differ_by(inverted, np.dstack((~colored, alpha))) == 0
    assert color.keep_alpha(lambda pixels: pixels, with_alpha) is with_alpha
    assert differ_by(color.keep_alpha(lambda p: p[..., 0], with_alpha), colored[..., 0]) == 0


def test_luma_is_processed_and_chroma_stays(colored):
    same = color.on_luma(lambda luma: luma, colored, "BGR")
    assert differ_by(same, colored) <= (2 if colored.itemsize == 1 else 32)
    half = color.on_luma(lambda luma: luma // 2, colored // 4 + colored.dtype.type(96), "RGB")
    expected = color.to_gray(colored // 4 + colored.dtype.type(96), "RGB") // 2
    clipped = (half == 0).any(axis=-1)
    assert np.abs(color.to_gray(half, "RGB").astype(float) - expected)[~clipped].max(initial=0) <= (
        2 if colored.itemsize == 1 else 32
    )


RED, GREEN, BLUE, WINE = (0, 0, 255), (0, 255, 0), (255, 0, 0), (40, 0, 255)  # BGR


@pytest.mark.parametrize(
    ("hue", "inside"),
    [((0, 10), [1, 0, 0, 0]), ((50, 70), [0, 1, 0, 0]), ((110, 130), [0, 0, 1, 0]),
     ((170, 179), [0, 0, 0, 1]), ((170, 10), [1, 0, 0, 1]), ((0, 179), [1, 1, 1, 1])],
)  # fmt: skip
def test_hue_range(hue, inside, dtype):
    row = np.array([[RED, GREEN, BLUE, WINE]], np.uint8).astype(dtype)
    row *= dtype(np.iinfo(dtype).max // 255)
    low, high = (hue[0], 1, 1), (hue[1], 255, 255)
    mask = color.select_hsv(row, "BGR", HsvMode.MASK, low, high)
    assert mask.tolist() == [[255 * one for one in inside]]
    kept = color.select_hsv(row, "BGR", HsvMode.KEEP, low, high)
    assert differ_by(kept, row * np.array(inside, dtype)[None, :, None]) == 0
    flipped = color.select_hsv(row[..., ::-1].copy(), "RGB", HsvMode.MASK, low, high)
    assert flipped.tolist() == mask.tolist()


def test_saturation_and_value_range(colored):
    eight = (colored >> (8 * (colored.itemsize - 1))).astype(np.uint8)
    exact = eight.astype(colored.dtype) * colored.dtype.type(np.iinfo(colored.dtype).max // 255)
    value = eight.max(axis=-1).astype(float)
    saturation = np.rint(255 * (value - eight.min(axis=-1)) / np.maximum(value, 1))
    mask = color.hsv_mask(exact, "BGR", (0, 100, 50), (179, 200, 220))
    inside = (saturation >= 100) & (saturation <= 200) & (value >= 50) & (value <= 220)
    assert np.array_equal(mask, 255 * inside)


def test_gray_has_no_hue(gray):
    with pytest.raises(UnsupportedImage, match="gray=false"):
        color.select_hsv(gray, "BGR", HsvMode.MASK, (0, 0, 0), (179, 255, 255))
    assert color.select_hsv(gray, "BGR", HsvMode.OFF, (0, 0, 0), (0, 0, 0)) is gray
