"""The camera: how it forms an image, and what a calibration finds."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import cv2
import numpy as np

from ros_visualise.core.params import param
from ros_visualise.data import Floats, Image, Message, Pixels
from ros_visualise.lessons.lesson import GIVES, TAKES, Lesson, Step, show, work_of
from ros_visualise.lessons.methods.camera import BOARD, calibrate, camera_matrix, distort, project
from ros_visualise.nodes import node
from ros_visualise.plotting.colors import BLUE, GREEN, ORANGE, RED, YELLOW
from ros_visualise.plotting.figure import Figure

_NAMES = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")
_COLORS = (BLUE, RED, GREEN, ORANGE, YELLOW)
_GRID = 12  # number of grid lines


@dataclass(frozen=True)
class PinholeParams:
    """The camera, and a cube in front of it."""

    focal: float = param(0.9, "focal length as a fraction of the image's width", min=0.2, max=5,
                         slider=(0.3, 2))  # fmt: skip
    distance: float = param(5.0, "distance from the camera to the cube's centre, metres", min=1.5,
                            max=100, slider=(1.5, 20))  # fmt: skip
    aside: float = param(
        0.0, "offset of the cube to the right, metres", min=-20, max=20, slider=(-3, 3)
    )
    turn: float = param(25.0, "rotation of the cube, degrees", min=-180, max=180)


@node("pinhole", params=PinholeParams, inputs=TAKES, outputs=GIVES)
def pinhole(image: Image, params: PinholeParams) -> dict[str, Message]:
    """A pinhole: distant objects look small."""
    bgr = work_of(image, np.ndarray)
    height, width = bgr.shape[:2]
    K = camera_matrix(params.focal * width, width, height)
    angle = np.radians(params.turn)
    R = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    corners = np.array(list(product((-0.5, 0.5), repeat=3))) @ R.T
    points = corners + np.array([params.aside, 0, params.distance])
    pixels = project(points, K)
    nearest = int(points[:, 2].argmin())
    figure = Figure(width, height)
    figure.picture((0, 0, width, height), bgr)
    for one, other in product(range(8), repeat=2):
        if one < other and bin(one ^ other).count("1") == 1:
            figure.line(pixels[[one, other]], YELLOW, 2.5)
    figure.dot(pixels[nearest, 0], pixels[nearest, 1], 5, RED)
    text = f"""
        In a pinhole camera all light passes through one point. A point at (X, Y, Z), in metres to
        the right, down and ahead, is seen at the pixel

            u = fx X / Z + cx
            v = fy Y / Z + cy

        with fx = fy = {K[0, 0]:.1f} pixels, cx = {K[0, 2]:.1f} and cy = {K[1, 2]:.1f}. The cube has
        sides of 1 m. Its corner at ({points[nearest, 0]:.2f}, {points[nearest, 1]:.2f},
        {points[nearest, 2]:.2f}) m, red, is seen at ({pixels[nearest, 0]:.1f},
        {pixels[nearest, 1]:.1f}). At a distance of {params.distance:g} m, one metre is
        {K[0, 0] / params.distance:.1f} pixels wide; at twice the distance, it is half as wide. The
        camera's field of view is {np.degrees(2 * np.arctan(width / 2 / K[0, 0])):.0f}°.
        """
    return show(image, figure, text)


@dataclass(frozen=True)
class LensParams:
    """The distortion of the lens."""

    focal: float = param(0.9, "focal length as a fraction of the image's width", min=0.2, max=5,
                         slider=(0.3, 2))  # fmt: skip
    k1: float = param(-0.3, "radial: below 0 a barrel, above 0 a cushion", min=-1, max=1,
                      slider=(-0.5, 0.5))  # fmt: skip
    k2: float = param(0.08, "radial, the term in r⁴", min=-1, max=1, slider=(-0.3, 0.3))
    p1: float = param(0.0, "tangential", min=-0.1, max=0.1, slider=(-0.02, 0.02))
    p2: float = param(0.0, "tangential", min=-0.1, max=0.1, slider=(-0.02, 0.02))


@dataclass(frozen=True, eq=False)
class _LensPictures:
    """A picture without and with a lens, and the camera."""

    straight: Pixels
    bent: Pixels
    K: Floats
    D: Floats


@node("lens", params=LensParams, inputs=TAKES, outputs=GIVES)
def lens(image: Image, params: LensParams) -> dict[str, Message]:
    """A lens bends straight lines."""
    bgr = work_of(image, np.ndarray)
    height, width = bgr.shape[:2]
    K = camera_matrix(params.focal * width, width, height)
    D = np.array([params.k1, params.k2, params.p1, params.p2, 0.0])
    bent = _through(bgr, K, D)
    corner = np.array([[0.0, 0.0]])
    moved = _to_pixels(distort(_to_rays(corner, K), D), K)[0]
    figure = Figure(width, height)
    figure.picture((0, 0, width, height), bent)
    for line in _grid(width, height):
        figure.line(_to_pixels(distort(_to_rays(line, K), D), K), YELLOW, 1)
    length = float(np.linalg.norm(moved))
    work = _LensPictures(bgr, bent, K, D)
    text = f"""
        A lens shifts each point in the picture: the farther from the centre, the larger the shift.
        With x = X/Z, y = Y/Z and r² = x² + y²:

            R  = 1 + k₁ r² + k₂ r⁴ + k₃ r⁶
            x' = x R + 2 p₁ x y + p₂ (r² + 2 x²)
            y' = y R + p₁ (r² + 2 y²) + 2 p₂ x y

        The lines of the yellow grid are straight in the world. The corner of the picture, at (0, 0)
        without the lens, is shifted to ({moved[0]:.1f}, {moved[1]:.1f}): {length:.1f} pixels away.
        """
    return show(image, figure, text, work)


@node("undistorted", inputs=TAKES, outputs=GIVES)
def undistorted(image: Image, params: object) -> dict[str, Message]:
    """Undistorted: if the lens is known, its effect can be undone."""
    seen = work_of(image, _LensPictures)
    back = cv2.undistort(seen.bent, seen.K, seen.D)
    valid = cv2.undistort(np.full(back.shape[:2], 255, np.uint8), seen.K, seen.D) == 255
    difference = cv2.absdiff(back, seen.straight).mean(axis=2)
    rest = "" if valid.all() else "; the black part was outside the view of the lens"
    text = f"""
        For each pixel of the undistorted picture we compute where the lens has moved it, and take
        the colour from there. cv2.undistort does this, and so does the node rectify.
        {100 * valid.mean():.1f} % of the picture is recovered{rest}. The recovered part differs
        from the truth by {difference[valid].mean() if valid.any() else 0.0:.2f} levels on average,
        because it was interpolated twice.
        """
    return show(image, back, text)


@dataclass(frozen=True)
class CalibrationParams:
    """The pictures for the calibration."""

    views: int = param(12, "number of pictures of the board", min=3, max=60, slider=(3, 30))
    noise: float = param(0.2, "standard deviation of each coordinate of a corner, pixels",
                         min=0, max=5, slider=(0, 1))  # fmt: skip
    seed: int = param(9, "random seed for the poses of the board", min=0, max=1000, slider=(0, 20))


@node("calibration", params=CalibrationParams, inputs=TAKES, outputs=GIVES)
def calibration(image: Image, params: CalibrationParams) -> dict[str, Message]:
    """A calibration and its results."""
    seen = work_of(image, _LensPictures)
    height, width = seen.straight.shape[:2]
    size = (width, height)
    found = calibrate(seen.K, seen.D, size, params.views, params.noise, params.seed)
    truth = [seen.K[0, 0], seen.K[1, 1], seen.K[0, 2], seen.K[1, 2], *seen.D]
    rows = zip(_NAMES, truth, found.values, found.deviations, strict=True)
    off = np.abs(found.values - truth) / np.maximum(found.deviations, 1e-12)
    worst = int(off.argmax())
    table = "\n".join(f"    {name}  {true:9.4f}  {value:9.4f} ± {spread:.4f}"
                      for name, true, value, spread in rows)  # fmt: skip
    text = f"""
To calibrate a camera, hold a board of known size in front of it, in many poses. The calibration
(Zhang, 2000) searches for the camera parameters, and the poses of the board, that best explain
where its {BOARD[0] * BOARD[1]} corners were seen. Here the simulated camera takes
{params.views} pictures, with noise of {params.noise:g} pixels in each of a corner's two
coordinates. The table shows the truth, what was found, and its standard deviation:

{table}

Farthest from the truth, by its deviation, is {_NAMES[worst]}: {off[worst]:.1f} standard deviations.
Of nine numbers, the farthest is usually 1 to 3 of them away.

On average (RMS) the corners are {found.rms_px:.3f} pixels from where the result predicts them; the
noise alone is {params.noise:g} · √2 = {params.noise * 2**0.5:.3f}. More pictures, more tilted
boards, and boards near the picture's corners improve the result. To calibrate your own camera, run
ros-visualise calibrate.
"""
    figure = Figure(width, height)
    figure.picture((0, 0, width, height), seen.bent // 3)
    for number, view in enumerate(found.views):
        color = _COLORS[number % len(_COLORS)]
        for row in range(BOARD[1]):
            figure.line(view[row * BOARD[0] : (row + 1) * BOARD[0]], color, 1)
        for u, v in view:
            figure.dot(u, v, 2, color)
    return show(image, figure, text)


LESSON = Lesson(
    "camera",
    "how a camera sees: the pinhole, what a lens does, how to undo it, what calibration finds",
    """
    To measure with pictures, you have to know where in a picture a point of the world appears. Here
    we simulate a camera that looks at your picture of {width} x {height} pixels, as if it were a
    poster.
    """,
    [Step(pinhole), Step(lens, "picture"), Step(undistorted, "lens"), Step(calibration, "lens")],
)


def _to_rays(pixels: Floats, K: Floats) -> Floats:
    return (pixels - K[:2, 2]) / K[[0, 1], [0, 1]]


def _to_pixels(rays: Floats, K: Floats) -> Floats:
    pixels: Floats = rays * K[[0, 1], [0, 1]] + K[:2, 2]
    return pixels


def _through(bgr: Pixels, K: Floats, D: Floats) -> Pixels:
    """A straight picture through the lens: pixels have the colour of their undistorted ray."""
    height, width = bgr.shape[:2]
    columns, rows = np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float))
    pixels = np.stack([columns.ravel(), rows.ravel()], axis=1)
    sources = cv2.undistortPoints(pixels[:, None], K, D, P=K).reshape(height, width, 2)
    x, y = cv2.split(sources.astype(np.float32))
    return cv2.remap(bgr, x, y, cv2.INTER_LINEAR)


def _grid(width: int, height: int) -> list[Floats]:
    """Straight lines across the picture, (N, 2) each."""
    step = max(width, height) / _GRID
    x, y = np.linspace(0.0, width - 1, 100), np.linspace(0.0, height - 1, 100)
    rows, columns = (np.arange(0, size, step) for size in (height, width))
    across = [np.stack([x, np.full_like(x, row)], axis=1) for row in rows]
    return across + [np.stack([np.full_like(y, column), y], axis=1) for column in columns]
