"""Each number in a lesson is what its sentence says, by another computation, on ten pictures."""

import json
import math
import re

import cv2
import numpy as np
import pytest
from sentences import drawn_pictures, holds, shown, small, texts_of

from ros_visualise.data import CameraInfo
from ros_visualise.landmarks.networks.network import Network
from ros_visualise.landmarks.pose import square_poses, squares_poses
from ros_visualise.landmarks.tags import draw_cells, parse_families
from ros_visualise.lessons.methods.camera import calibrate, camera_matrix
from ros_visualise.lessons.methods.tags import draw_tag, find_tag
from ros_visualise.lessons.topics.noise import NoiseModel, add_noise
from ros_visualise.nodes.landmark_detector import OWN_MODEL
from ros_visualise.vision.smoothing import bilateral, sigma_of

CORNERS = ("lower left", "lower right", "upper right", "upper left")
REAL = (
    "edges/images/100007.jpg",
    "aerial/terrain2.png",
    "helipad/photos/img_001.jpg",
    "calib/opencv/left01.jpg",
    "tags/fiducials/tag_01_d7_14cm.png",
)


@pytest.fixture(scope="module", params=range(10), ids=[*"01234", *REAL])
def picture(request, landscape):
    """One of ten pictures, BGR."""
    if request.param < 5:
        return [*drawn_pictures(landscape)][request.param]
    recordings = request.getfixturevalue("recordings")
    return small(cv2.imread(str(recordings / REAL[request.param - 5])))


def gray_of(picture):
    return cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)


def sobel_of(gray, aperture=3):
    border = cv2.BORDER_REPLICATE
    return [
        cv2.Sobel(gray, cv2.CV_64F, x, y, ksize=aperture, borderType=border)
        for x, y in ((1, 0), (0, 1))
    ]


def psnr(one, other):
    error = np.mean((one.astype(float) - other) ** 2)
    return 10 * math.log10(255**2 / error) if error else math.inf


class TestCanny:
    @pytest.mark.parametrize("is_l2", [False, True])
    def test_canny(self, picture, is_l2):
        texts = texts_of("canny", picture, gradient={"l2": is_l2})
        gray = gray_of(picture)
        smooth = cv2.GaussianBlur(gray, (0, 0), 1.0)
        change = np.abs(gray.astype(float) - smooth).mean()
        holds(texts["smoothing"], "a pixel of this picture by N gray levels on average", change)
        dx, dy = sobel_of(smooth)
        size = np.hypot(dx, dy) if is_l2 else abs(dx) + abs(dy)
        y, x = np.unravel_index((dx**2 + dy**2 if is_l2 else size).argmax(), size.shape)
        sentence = "The largest |G| here is N, at (N, N): Gx = N, Gy = N, θ = N°"
        angle = math.degrees(math.atan2(dy[y, x], dx[y, x])) % 360
        holds(texts["gradient"], sentence, size.max(), x, y, dx[y, x], dy[y, x], angle)
        kept = self.maxima(dx, dy, is_l2)
        with_gradient = int((size > 0).sum())
        share = 100 * kept.sum() / max(1, with_gradient)
        sentence = "Of N pixels with a gradient, N stay (N %)"
        holds(texts["suppression"], sentence, with_gradient, kept.sum(), share)
        compared = size if not is_l2 else dx**2 + dy**2
        low, high = (60, 140) if not is_l2 else (60**2, 140**2)
        strong = int((kept & (compared > high)).sum())
        weak = int((kept & (compared > low)).sum()) - strong
        sentence = "Here N pixels are strong (white) and N are weak (orange). The other N are not"
        holds(texts["thresholds"], sentence, strong, weak, kept.sum() - strong - weak)
        edges = cv2.Canny(smooth, 60, 140, L2gradient=is_l2)
        rescued = np.count_nonzero(edges) - strong
        holds(texts["hysteresis"], "N are kept (green), N are not (red)", rescued, weak - rescued)
        sentence = "So N pixels are edges"
        holds(texts["hysteresis"], sentence, np.count_nonzero(edges))
        holds(texts["hysteresis"], "differs in N of N pixels", 0, edges.size)

    def maxima(self, dx, dy, is_l2):
        """Pixels that stay, by the rule that step 3 states."""
        size = (dx**2 + dy**2) if is_l2 else abs(dx) + abs(dy)
        wide = np.pad(size, 1)
        kept = np.zeros(size.shape, bool)
        angle = np.degrees(np.arctan2(abs(dy), abs(dx)))
        height, width = size.shape
        for row in range(height):
            for column in range(width):
                here = size[row, column]
                if not here:
                    continue
                if angle[row, column] < 22.5:
                    step, equal_stays = (0, 1), True
                elif angle[row, column] > 67.5:
                    step, equal_stays = (1, 0), True
                else:
                    same = dx[row, column] * dy[row, column] > 0
                    step, equal_stays = (1, 1 if same else -1), False
                before = wide[row + 1 - step[0], column + 1 - step[1]]
                after = wide[row + 1 + step[0], column + 1 + step[1]]
                larger = here >= after if equal_stays else here > after
                kept[row, column] = here > before and larger
        return kept

    def test_one_pixel_and_its_neighbours(self, picture):
        x, y = picture.shape[1] // 3, picture.shape[0] // 2
        text = texts_of("canny", picture, suppression={"x": x, "y": y})["suppression"]
        dx, dy = sobel_of(cv2.GaussianBlur(gray_of(picture), (0, 0), 1.0))
        here = abs(dx[y, x]) + abs(dy[y, x])
        angle = math.degrees(math.atan2(dy[y, x], dx[y, x])) % 360
        holds(text, "At (N, N), blue: |G| = N, θ = N°", x, y, here, angle)
        fate = "stays" if self.maxima(dx, dy, False)[y, x] else "is suppressed"
        assert f"the pixel {fate}" in text


class TestGradient:
    @pytest.mark.parametrize("aperture", [3, 5, 7])
    def test_gradient(self, picture, aperture):
        texts = texts_of("gradient", picture, derivatives={"aperture": aperture})
        gray = gray_of(picture)
        dx, dy = sobel_of(gray, aperture)
        sentence = f"the {aperture} x {aperture} kernels give Gx from N to N, Gy from N to N"
        holds(texts["derivatives"], sentence, dx.min(), dx.max(), dy.min(), dy.max())
        smoothing, deriving = (one.ravel() for one in reversed(cv2.getDerivKernels(1, 0, aperture)))
        printed = texts["derivatives"].partition("Gx: ")[2].partition("Gray means")[0]
        numbers = [int(one.replace("−", "-")) for one in printed.replace("Gy:", "").split()]
        kernels = [np.outer(smoothing, deriving), np.outer(deriving, smoothing)]
        assert numbers == np.ravel(kernels).astype(int).tolist()
        length = np.hypot(dx, dy)
        sentence = "The largest length is √((N)² + (N)²) = N, at (N, N). The mean is N"
        y, x = np.unravel_index(length.argmax(), length.shape)
        expected = (dx[y, x], dy[y, x], length.max(), x, y, length.mean())
        holds(texts["magnitude"], sentence, *expected)
        holds(texts["edges"], "|G| > 100. That is N % of the pixels", 100 * (length > 100).mean())
        angle = np.degrees(np.arctan2(dy, dx)) % 360
        weights = [
            length[abs((angle - centre + 180) % 360 - 180) <= 22.5].sum()
            for centre in range(0, 360, 45)
        ]
        if sorted(weights)[-1] > 1.05 * sorted(weights)[-2]:  # else rounding decides
            sentence = "N° is the most common in this picture: N % of the gradient"
            [most, share] = shown(texts["direction"], sentence)
            assert most == 45 * int(np.argmax(weights))
            assert share == pytest.approx(100 * max(weights) / max(length.sum(), 1e-9), abs=6)

    def test_a_row(self, picture):
        row, x = 7, picture.shape[1] - 3
        text = texts_of("gradient", picture, profile={"x": x, "y": row})["profile"]
        level = gray_of(picture)[row].astype(int)
        slope = (level[x + 1] - level[x - 1]) / 2
        holds(text, "Along row N", row)
        expected = (x, level[x + 1], level[x - 1], slope)
        holds(text, "At x = N (orange): (N − N) / 2 = N levels per pixel", *expected)
        wide = np.pad(level, 1, mode="edge")
        slopes = (wide[2:] - wide[:-2]) / 2
        steepest = int(abs(slopes).argmax())
        holds(text, "farthest from zero at x = N, with N", steepest, slopes[steepest])


class TestColor:
    def test_cube_and_gray(self, picture):
        texts = texts_of("color", picture)
        flat = picture.reshape(-1, 3)
        kinds = len({tuple(one) for one in flat.tolist()})
        variances = np.linalg.svd(flat - flat.mean(axis=0), compute_uv=False) ** 2
        sentence = "has N of the N possible colours. N % of their variance"
        holds(texts["cube"], sentence, kinds, 256**3, 100 * variances[0] / variances.sum())
        blue, green, red = np.moveaxis(flat.astype(float), -1, 0)
        luma = np.floor(0.299 * red + 0.587 * green + 0.114 * blue + 0.5)
        apart = abs(luma - flat.mean(axis=1))
        sentence = "differs from Y by N levels on average in this picture, and by N at most."
        assert shown(texts["gray"], sentence) == pytest.approx(
            [apart.mean(), apart.max()], abs=1.06
        )
        holds(texts["gray"], "weighted sum in N of N pixels", 0, len(flat))
        holds(texts["gray"], "Y = N R + N G + N B", 0.299, 0.587, 0.114)

    def test_hue_by_the_printed_formulas(self, picture):
        for x, y in ((3, 4), (picture.shape[1] - 1, 9), (25, 20)):
            text = texts_of("color", picture, hsv={"x": x, "y": y})["hsv"]
            blue, green, red = (int(one) for one in picture[y, x])
            value = max(blue, green, red)
            chroma = value - min(blue, green, red)
            if chroma == 0:
                hue = 0.0
            elif value == red:
                hue = 30 * (green - blue) / chroma
            elif value == green:
                hue = 60 + 30 * (blue - red) / chroma
            else:
                hue = 120 + 30 * (red - green) / chroma
            hue = hue + 180 if hue < 0 else hue
            saturation = 255 * chroma / value if value else 0
            h, degrees, *rest = shown(text, "becomes H N (N°), S N, V N")
            assert abs((h - hue + 90) % 180 - 90) <= 0.51
            assert degrees == 2 * h
            assert rest == pytest.approx([saturation, value], abs=0.51)
            holds(text, "At (N, N), R N, G N, B N", x, y, red, green, blue)
            holds(text, "formulas in N of N numbers", 0, picture.size)

    @pytest.mark.parametrize(("low", "high"), [(35, 85), (170, 10)])
    def test_a_range_may_pass_through_red(self, picture, low, high):
        settings = {"hue_low": low, "hue_high": high}
        text = texts_of("color", picture, hue_range=settings)["hue_range"]
        hue, saturation, value = cv2.split(cv2.cvtColor(picture, cv2.COLOR_BGR2HSV))
        if low > high:
            is_hue = (hue >= low) | (hue <= high)
            assert "340° to 20°, through red" in text
        else:
            is_hue = (hue >= low) & (hue <= high)
            assert "70° to 170°. Gray" in text
        share = 100 * (is_hue & (saturation >= 60) & (value >= 40)).mean()
        sentence = "saturation must be at least N, and the value at least N. N % of the pixels"
        holds(text, sentence, 60, 40, share)


def test_image(picture):
    texts = texts_of("image", picture)
    gray = gray_of(picture)
    height, width = gray.shape
    x, y = width // 2, height // 2
    blue, green, red = picture[y, x]
    sentence = "a grid of N columns and N rows: N pixels"
    holds(texts["pixels"], sentence, width, height, width * height)
    sentence = "At (N, N) these are blue N, green N, red N. In gray they become one number, N;"
    holds(texts["pixels"], sentence, x, y, blue, green, red, gray[y, x])
    sentence = "N × N pixels × 3 channels × 1 byte = N bytes"
    holds(texts["pixels"], sentence, width, height, 3 * width * height)
    for channel, name in enumerate(("blue", "green", "red")):
        values = picture[..., channel]
        sentence = f"{name} mean N from N to N"
        holds(texts["channels"], sentence, values.mean(), values.min(), values.max())
    fewer = np.rint((gray >> 5) * (255 / 7)).astype(np.uint8)
    sentence = "2^3 = N levels N × N × 3 / 8 = N bytes"
    holds(texts["gray_levels"], sentence, 8, width, height, gray.size * 3 / 8)
    sentence = "of N dB; each additional bit adds about 6 dB. N of the 8 levels are used"
    holds(texts["gray_levels"], sentence, psnr(fewer, gray), len(np.unique(fewer)))
    share = np.unique(gray, return_counts=True)[1] / gray.size
    holds(texts["histogram"], "The mean, N, is the brightness", gray.mean())
    holds(texts["histogram"], "the standard deviation, N, is the contrast", gray.std())
    holds(texts["histogram"], "log₂ p(v) = N bits", -(share * np.log2(share)).sum())
    sentence = "Of the N × N pixels, N × N remain: N % of the bytes"
    small_size = width // 8, height // 8
    left = 100 * small_size[0] * small_size[1] / gray.size
    holds(texts["resolution"], sentence, width, height, *small_size, left)
    for name, size in (("mono8", 1), ("mono16", 2), ("bgr8", 3), ("bgra8", 4), ("bgr16", 6)):
        text = texts["encodings"].partition(f" {name} ")[2].partition(" bytes")[0]
        assert int(text.split()[-1]) == size * gray.size


def test_threshold(picture):
    texts = texts_of("threshold", picture)
    gray = gray_of(picture)
    levels, counts = np.unique(gray, return_counts=True)
    sentence = "levels go from N to N, with a mean of N; the most frequent one is N, with N pixels"
    frequent = levels[counts.argmax()]
    expected = (gray.min(), gray.max(), gray.mean(), frequent, counts.max())
    holds(texts["histogram"], sentence, *expected)
    holds(texts["types"], "N % of the pixels are above T", 100 * (gray > 128).mean())
    level, _ = cv2.threshold(gray, 0, 255, cv2.THRESH_BINARY | cv2.THRESH_OTSU)
    below, above = gray[gray <= level], gray[gray > level]
    sentence = "N % of the pixels are below, with a mean of N; the mean of those above is N"
    holds(
        texts["otsu"],
        sentence,
        100 * below.size / gray.size,
        below.mean(),
        above.mean() if above.size else 0,
    )
    holds(texts["otsu"], "Here t = N (cv2.threshold finds N)", level, level)
    share = below.size / gray.size
    variance = share * (1 - share) * (below.mean() - (above.mean() if above.size else 0)) ** 2
    holds(texts["otsu"], "σ² is N, out of a total variance of N", variance, gray.var())
    mean = cv2.boxFilter(gray, cv2.CV_64F, (31, 31), borderType=cv2.BORDER_REPLICATE)
    [white] = shown(texts["adaptive"], "N % of the pixels become white")
    assert white == pytest.approx(100 * (gray > np.rint(mean) - 5).mean(), abs=1.5)


@pytest.mark.parametrize("model", ["gaussian", "salt_and_pepper", "poisson"])
def test_noise(picture, model):
    gray = gray_of(picture)
    texts = texts_of("noise", picture, noisy={"model": model, "seed": 4})
    noisy = add_noise(gray, NoiseModel(model), 20, 4)
    error = np.mean((noisy.astype(float) - gray) ** 2)
    sentence = "the MSE is N, its square root N levels, and the PSNR N dB"
    holds(texts["noisy"], sentence, error, math.sqrt(error), psnr(noisy, gray))
    assert 10 * math.log10(255**2 / 25.5**2) == pytest.approx(20)
    assert 10 * math.log10(255**2 / 2.55**2) == pytest.approx(40)
    for name, smoothed in (
        ("gauss", cv2.GaussianBlur(noisy, (0, 0), 1.2)),
        ("median", cv2.medianBlur(noisy, 3)),
        ("bilateral", bilateral(noisy, 7, 50.0, sigma_of(7))),
    ):
        before, after = psnr(noisy, gray), psnr(smoothed, gray)
        sentence = "PSNR: N dB before, N dB after: N dB"
        holds(texts[name], sentence, before, after, after - before)
    holds(texts["median"], "The N levels in the N × N window", 9, 3, 3)


@pytest.mark.parametrize("sigma", [0.3, 1.2, 5.0])
def test_the_noise_that_a_gaussian_leaves(sigma):
    text = texts_of("noise", np.full((64, 64, 3), 128, np.uint8), gauss={"sigma": sigma})["gauss"]
    noise = np.random.default_rng(1).normal(0, 1, (600, 600))
    left = cv2.GaussianBlur(noise, (0, 0), sigma).std()
    assert shown(text, "Σ w = N") == pytest.approx([left], abs=0.02)


def test_bayer(picture):
    texts = texts_of("bayer", picture)
    height, width = (max(16, side) // 2 * 2 for side in picture.shape[:2])
    truth = picture[:height, :width]
    mosaic = truth[..., 1].copy()
    mosaic[::2, ::2], mosaic[1::2, 1::2] = truth[::2, ::2, 2], truth[1::2, 1::2, 0]
    holds(texts["mosaic"], "measures N of the N numbers", mosaic.size, truth.size)
    found = {}
    codes = {
        "bilinear": cv2.COLOR_BayerRGGB2BGR,
        "vng": cv2.COLOR_BayerRGGB2BGR_VNG,
        "edge_aware": cv2.COLOR_BayerRGGB2BGR_EA,
    }
    for name, code in codes.items():
        found[name] = cv2.cvtColor(mosaic, code)
        error = found[name].astype(int) - truth
        quality = psnr(found[name], truth)
        false = 100 * (error.max(axis=2) - error.min(axis=2) > 20).mean()
        holds(texts[name], "Compared with the truth: PSNR N dB", quality)
        sentence = "the largest error is N levels; N % of the pixels have a colour that is wrong"
        holds(texts[name], sentence, abs(error).max(), false)
        if name != "bilinear":
            sentence = "dB (N dB compared with the bilinear method)"
            holds(texts[name], sentence, quality - psnr(found["bilinear"], truth))
    np.testing.assert_array_equal(  # as the lesson says
        found["edge_aware"][2:-2, 2:-2, ::2], found["bilinear"][2:-2, 2:-2, ::2]
    )
    wide = mosaic.astype(int)
    across = abs(np.roll(wide, 1, 1) - np.roll(wide, -1, 1))
    down = abs(np.roll(wide, 1, 0) - np.roll(wide, -1, 0))
    guessed = np.zeros(mosaic.shape, bool)
    guessed[::2, ::2] = guessed[1::2, 1::2] = True
    inner = (slice(4, -4), slice(4, -4))
    edge = (abs(across - down) > 30)[inner]
    off = {
        (name, is_edge): rms(found[name], truth, (edge == is_edge) & guessed[inner], inner)
        for name in ("edge_aware", "bilinear")
        for is_edge in (True, False)
    }
    sentence = (
        "At N % of the pixels without a green sample, these two differences are more than 30 levels"
        " apart. There the error in green is N levels (RMS), against N with the bilinear method."
        " At the other pixels it is N, against N"
    )
    expected = [off[name, e] for e in (True, False) for name in ("edge_aware", "bilinear")]
    holds(texts["edge_aware"], sentence, 100 * edge[guessed[inner]].mean(), *expected)


def rms(found, truth, where, inner):
    error = (found[..., 1].astype(float) - truth[..., 1])[inner][where]
    return float(np.sqrt(np.mean(error**2))) if error.size else 0.0


class TestCamera:
    def test_pinhole_and_lens(self, picture):
        texts = texts_of("camera", picture)
        height, width = picture.shape[:2]
        focal, cx, cy = 0.9 * width, (width - 1) / 2, (height - 1) / 2
        holds(texts["pinhole"], "fx = fy = N pixels, cx = N and cy = N", focal, cx, cy)
        sentence = "At a distance of N m, one metre is N pixels wide"
        holds(texts["pinhole"], sentence, 5, focal / 5)
        field = math.degrees(2 * math.atan(0.5 / 0.9))
        holds(texts["pinhole"], "field of view is N°", field)
        K = camera_matrix(focal, width, height)
        D = np.array([-0.3, 0.08, 0, 0, 0])
        ray = np.array([[-cx / focal, -cy / focal, 1.0]])
        zero = np.zeros(3)
        (u, v), _ = cv2.projectPoints(ray, zero, zero, K, D)[0].reshape(-1), None
        sentence = "is shifted to (N, N): N pixels away"
        holds(texts["lens"], sentence, u, v, math.hypot(u, v))

    def test_the_cube_and_the_recovered_picture(self, picture):
        texts = texts_of("camera", picture)
        height, width = picture.shape[:2]
        K = camera_matrix(0.9 * width, width, height)
        x, y, z, u, v = shown(texts["pinhole"], "Its corner at (N, N, N) m, red, is seen at (N, N)")
        assert abs(y) == 0.5
        assert math.dist((x, z), (0, 5)) == pytest.approx(0.5 * 2**0.5, abs=0.011)
        assert z < 5
        assert u == pytest.approx(K[0, 0] * x / z + K[0, 2], abs=0.02 * K[0, 0] / z)
        assert v == pytest.approx(K[1, 1] * y / z + K[1, 2], abs=0.02 * K[0, 0] / z)
        grid = np.moveaxis(np.mgrid[:height, :width], 0, -1)[..., ::-1].reshape(-1, 2)
        rays = (grid - K[:2, 2]) / K[0, 0]
        r2 = (rays**2).sum(axis=1)
        bent = rays * (1 - 0.3 * r2 + 0.08 * r2**2)[:, None] * K[0, 0] + K[:2, 2]
        inside = ((bent >= 0) & (bent <= [width - 1, height - 1])).all(axis=1)
        [share] = shown(texts["undistorted"], "N % of the picture is recovered")
        assert share == pytest.approx(100 * inside.mean(), abs=1.5)

    def test_the_calibration_and_its_deviations(self, landscape):
        texts = texts_of("camera", landscape)
        height, width = landscape.shape[:2]
        K = camera_matrix(0.9 * width, width, height)
        D = np.array([-0.3, 0.08, 0, 0, 0])
        found = calibrate(K, D, (width, height), 12, 0.2, 9)
        truth = np.array([K[0, 0], K[1, 1], K[0, 2], K[1, 2], *D])
        off = abs(found.values - truth) / found.deviations
        text = texts["calibration"]
        holds(
            text, "standard deviation: fx N N ± N", truth[0], found.values[0], found.deviations[0]
        )
        names = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")
        sentence = f"by its deviation, is {names[off.argmax()]}: N standard deviations"
        holds(text, sentence, off.max())
        assert off.max() < 2  # the default seed is an ordinary case
        sentence = "the corners are N pixels from where the result predicts them; the noise alone"
        holds(text, sentence, found.rms_px)
        holds(text, "alone is N · √2 = N", 0.2, 0.2 * math.sqrt(2))
        assert found.rms_px == pytest.approx(0.2 * math.sqrt(2), rel=0.1)

    def test_the_farthest_of_nine_numbers(self):
        """Over many boards the deviations are right, and the farthest is 1 to 3 of them away."""
        K, D = camera_matrix(288, 320, 240), np.array([-0.3, 0.08, 0, 0, 0])
        truth = np.array([K[0, 0], K[1, 1], K[0, 2], K[1, 2], *D])
        runs = [calibrate(K, D, (320, 240), 12, 0.2, seed) for seed in range(12)]
        off = np.array([(one.values - truth) / one.deviations for one in runs])
        assert np.sqrt(np.mean(off**2)) == pytest.approx(1, abs=0.2)
        assert 1 <= np.median(abs(off).max(axis=1)) <= 3


class TestLandmarks:
    @pytest.mark.parametrize("sigma", [0.05, 0.3, 0.5])
    def test_the_ellipses_hold_as_many_as_by_theory(self, picture, sigma):
        texts = texts_of("landmarks", picture, ellipse={"sigma": sigma})
        text = texts["ellipse"]
        if "No tag" in text:  # its picture is too small for one
            assert min(picture.shape[:2]) < 60
            return
        sentence = (
            "here they hold N % and N %. With N random dots, a difference of up to N percentage"
            " points is usual"
        )
        inner, outer, dots, chance = shown(text, sentence)
        share = 1 - math.exp(-2)
        assert chance == pytest.approx(200 * math.sqrt(share * (1 - share) / dots), abs=0.5)
        assert outer == pytest.approx(86, abs=2 * chance)
        assert inner == pytest.approx(39, abs=9)

    def test_corners_and_homography(self, landscape):
        texts = texts_of("landmarks", landscape)
        rows = [texts["corners"].partition(one)[2].replace("( ", "(") for one in CORNERS]
        corners = np.array([shown(row, "(N, N)") for row in rows])
        a, b, c, d = np.column_stack([corners, np.ones(4)])
        x, y, w = np.cross(np.cross(a, c), np.cross(b, d))  # its diagonals meet in its centre
        text = texts["homography"]
        assert shown(text, "tag is at (N, N)") == pytest.approx([x / w, y / w], abs=0.02)
        sentence = "the mean of its corners differs from it: (N, N)"
        assert shown(text, sentence) == pytest.approx(corners.mean(axis=0), abs=0.006)
        holds(texts["poses"], "the size of the tag (N m)", 0.16)
        assert shown(texts["poses"], "It is N m away") == pytest.approx([1.5], rel=0.02)

    def test_the_readings_and_the_spread_of_the_pose(self, landscape):
        texts = texts_of("landmarks", landscape, tag={"distance": 1.0}, ellipse={"sigma": 0.2})
        readings = re.findall(r"([\d.]+)% \(([-\d.]+), ([-\d.]+), ([-\d.]+)\) m", texts["poses"])
        assert sum(float(one) for one, *_ in readings) == pytest.approx(100, abs=0.2)
        [away] = shown(texts["poses"], "It is N m away")
        assert math.hypot(*map(float, readings[0][1:])) == pytest.approx(away, abs=0.002)
        assert shown(texts["corners"], "Their error is N pixels on average, N at most")[1] < 0.2
        sideways, along = shown(texts["ellipse"], "N mm sideways, and N mm along the camera's axis")
        K = camera_matrix(0.9 * 320, 320, 240)
        height, width = landscape.shape[:2]
        seen = find_tag(
            draw_tag(landscape, CameraInfo(height, width, K), 0.16, 1.0, np.radians([15, 10, 0]))
        )
        best = square_poses(seen.corners, 0.16, seen.info, 0.2)[0]
        noisy = seen.corners + np.random.default_rng(7).normal(0, 0.2, (400, 4, 2))
        tried = [
            max(each, key=lambda one: abs(one.quat_xyzw @ best.quat_xyzw)).position_xyz
            for each in squares_poses(noisy, [0.16] * 400, seen.info, [0.2] * 400)
        ]
        spread = 1000 * np.std(tried, axis=0)
        assert [sideways, along] == pytest.approx([spread[0], spread[2]], rel=0.15)

    def test_tags_of_the_family_differ_in_eleven_cells(self):
        family = parse_families("tag36h11")[0]
        inner = [draw_cells(family, n)[0][2:-2, 2:-2] > 0 for n in range(0, 587, 4)]
        cells = np.array([np.rot90(one, k).ravel() for one in inner for k in range(4)])
        first = np.array([one.ravel() for one in inner])
        apart = (first[:, None] != cells[None]).sum(axis=2)
        assert np.sort(apart, axis=1)[:, 1].min() >= 11


def test_vision(picture):
    texts = texts_of("vision", picture)
    network = Network(str(OWN_MODEL))
    kernels = np.array(json.loads(network.metadata["first_kernels"]))
    biases = np.array(json.loads(network.metadata["first_biases"]))
    rgb = picture[..., ::-1] / 255 - 0.5
    maps = [
        bias
        + sum(
            cv2.filter2D(rgb[..., c], cv2.CV_64F, kernel[c], borderType=cv2.BORDER_CONSTANT)
            for c in range(3)
        )[::2, ::2]
        for kernel, bias in zip(kernels, biases, strict=True)
    ]
    active = np.array([np.mean(one > 0) for one in maps])
    sentence = (
        "Kernel N responds at N % of the places, more than any other; kernel N responds at N %"
    )
    most, share, least, rare = shown(texts["activations"], sentence)
    assert active[int(most)] == pytest.approx(active.max(), abs=0.002)
    assert active[int(least)] == pytest.approx(active.min(), abs=0.002)
    assert [share, rare] == pytest.approx([100 * active.max(), 100 * active.min()], abs=0.51)
    sentence = "fewer than any other; N of N kernels respond nowhere"
    assert shown(texts["activations"], sentence)[1] == len(kernels)
    holds(texts["kernels"], "These are all N kernels", len(kernels))
    assert sum(shown(texts["kernels"], "N kernels are mostly edge, N spot and N colour")) == len(
        kernels
    )
    gx = np.array([[-1, 0, 1], [-2, 0, 2], [-1, 0, 1]])
    same = np.stack([gx] * 3).ravel()
    flat = kernels.reshape(len(kernels), -1)
    cosines = flat @ same / (np.linalg.norm(flat, axis=1) * np.linalg.norm(same))
    dx, dy = sobel_of(gray_of(picture))
    number, cosine, alike = shown(texts["sobel"], "correlation Gx N N N")
    assert cosine == pytest.approx(cosines.max(), abs=0.006)
    if dx.std() > 0:
        correlated = np.corrcoef(dx[::2, ::2].ravel(), maps[int(number)].ravel())[0, 1]
        assert alike == pytest.approx(correlated, abs=0.006)
    holds(
        texts["things"], "|G| > N at N % of the pixels", 100, 100 * (np.hypot(dx, dy) > 100).mean()
    )
