"""Pictures of a tag as a real camera takes them, by casting rays through its lens.

It is the judge of what the project says of tags in real pictures, so it shares no code with it: the
lens, its inverse, the blur, the mosaic and the sharpening are written here from their formulas.
OpenCV gives the cells of the tag and the JPEG codec.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np

WIDTH, HEIGHT = 640, 480
SIZE_M = 0.2
CELLS = 8  # along the side of the square
_SUB = 8  # rays along the side of a pixel
_PART = 256  # pixels, whose rays fit in the cache of a processor
_AROUND_PX = 6
_SPECTRUM = np.array([[0.8, 1.0, 0.6]])  # what red, green and blue see of white paper


@dataclass(frozen=True)
class Camera:
    """A camera: lens, blur (standard deviation, pixels), noise (levels), and what it does then."""

    model: str = "plumb_bob"
    D: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, 0.0)
    focal: float = 500.0
    blur: tuple[float, float] = (0.4, 0.9)
    noise: tuple[float, float] = (0.7, 3.0)
    exposure: float = 1.0
    gamma: float = 1.0
    sharpen: float = 0.0
    mosaic: bool = False
    jpeg: int = 0
    readout_s: float = 0.0
    speed_px: float = 0.0
    """Of the tag's image, pixels a second, to any side."""

    @property
    def matrix(self) -> np.ndarray:
        return np.array([[self.focal, 0, 322.3], [0, self.focal * 1.003, 236.8], [0, 0, 1]])

    def see(self, points: np.ndarray) -> np.ndarray:
        """Pixels of points (N, 3): x right, y down, z forward."""
        if self.model == "equidistant":
            radius = np.hypot(points[:, 0], points[:, 1])
            angle = np.arctan2(radius, points[:, 2])
            k = self.D
            bent = angle * (
                1 + k[0] * angle**2 + k[1] * angle**4 + k[2] * angle**6 + k[3] * angle**8
            )
            plane = points[:, :2] * (bent / np.maximum(radius, 1e-12))[:, None]
        else:
            plane = _bent(points[:, :2] / points[:, 2:], self.D)
        return plane * np.diag(self.matrix)[:2] + self.matrix[:2, 2]

    def rays(self, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Directions (..., 3) that are seen at pixels."""
        x = (u - self.matrix[0, 2]) / self.matrix[0, 0]
        y = (v - self.matrix[1, 2]) / self.matrix[1, 1]
        wanted = np.stack([x, y], axis=-1)
        if self.model == "equidistant":
            radius = np.hypot(x, y)
            k, angle = self.D, radius
            for _ in range(30):
                series = 1 + k[0] * angle**2 + k[1] * angle**4 + k[2] * angle**6 + k[3] * angle**8
                angle = radius / series
            plane = wanted * (np.sin(angle) / np.maximum(radius, 1e-12))[..., None]
            return np.concatenate([plane, np.cos(angle)[..., None]], axis=-1)
        middle = wanted.reshape(-1, 2).mean(axis=0)
        flat = middle
        for _ in range(60):
            flat = flat + middle - _bent(flat[None], self.D)[0]
        flat = wanted + (flat - middle)
        for _ in range(300):
            off = wanted - _bent(flat, self.D)
            flat = flat + off
            if np.abs(off).max() < 1e-8:
                break
        else:
            raise ValueError("the lens folds")
        return np.concatenate([flat, np.ones_like(flat[..., :1])], axis=-1)


def _bent(flat: np.ndarray, D: tuple[float, ...]) -> np.ndarray:
    """Brown's model, with a polynomial below too if it has eight coefficients."""
    k1, k2, p1, p2, k3, k4, k5, k6 = (*D, *[0.0] * 8)[:8]
    x, y = flat[..., 0], flat[..., 1]
    r = x * x + y * y
    radial = (1 + r * (k1 + r * (k2 + r * k3))) / (1 + r * (k4 + r * (k5 + r * k6)))
    return np.stack(
        [
            x * radial + 2 * p1 * x * y + p2 * (r + 2 * x * x),
            y * radial + p1 * (r + 2 * y * y) + 2 * p2 * x * y,
        ],
        axis=-1,
    )


@dataclass(frozen=True)
class Pose:
    """Of the tag (x right, y up, z towards the viewer) in the camera; moving by ``velocity``."""

    R: np.ndarray
    t: np.ndarray
    velocity: np.ndarray

    def after(self, seconds: float) -> Pose:
        return Pose(self.R, self.t + seconds * self.velocity, self.velocity)


def random_pose(camera: Camera, rng: np.random.Generator, side_px: float, tilt_deg: float) -> Pose:
    """A pose whose corners are in the image."""
    half = SIZE_M / 2
    square = np.array([[-half, -half, 0], [half, -half, 0], [half, half, 0], [-half, half, 0]])
    while True:
        u, v = rng.uniform(0, WIDTH), rng.uniform(0, HEIGHT)
        ray = camera.rays(np.array([u]), np.array([v]))[0]
        ray /= np.linalg.norm(ray)
        t = ray * camera.focal * SIZE_M / side_px
        about, roll = rng.uniform(0, 2 * np.pi, 2)
        tilt = np.deg2rad(tilt_deg) * np.array([np.cos(about), np.sin(about), 0])
        facing = np.cross([0, 0, 1.0], ray)
        facing *= np.arccos(ray[2]) / max(np.linalg.norm(facing), 1e-12)
        R = _turned(facing) @ _turned(tilt) @ np.diag([1.0, -1, -1]) @ _turned([0, 0, roll])
        heading = rng.uniform(0, 2 * np.pi)
        speed = camera.speed_px * np.linalg.norm(t) / camera.focal
        pose = Pose(R, t, speed * np.array([np.cos(heading), np.sin(heading), 0]))
        ends = [camera.see(square @ R.T + pose.after(s).t) for s in (-0.3, 0, 0.1)]
        uv = np.concatenate(ends)
        low, high = uv.min(axis=0) - 15, uv.max(axis=0) + 15
        if (low > 0).all() and high[0] < WIDTH and high[1] < HEIGHT:
            return pose


def _turned(axis: np.ndarray | list[float]) -> np.ndarray:
    return cv2.Rodrigues(np.asarray(axis, float))[0]


def corners_of(camera: Camera, pose: Pose) -> np.ndarray:
    """(4, 2) where the corners are at the time of the image, whatever the shutter does."""
    half = SIZE_M / 2
    square = np.array([[-half, -half, 0], [half, -half, 0], [half, half, 0], [-half, half, 0]])
    return camera.see(square @ pose.R.T + pose.t)


def take(camera: Camera, pose: Pose, id: int, rng: np.random.Generator) -> np.ndarray:
    """The picture (HEIGHT, WIDTH), its time being that of its middle row."""
    reach = corners_of(camera, pose)
    margin = _AROUND_PX + 0.16 * np.ptp(reach, axis=0).max() + camera.speed_px * camera.readout_s
    first = np.maximum(np.floor(reach.min(axis=0) - margin), 0).astype(int)
    last = np.minimum(np.ceil(reach.max(axis=0) + margin), [WIDTH, HEIGHT]).astype(int)
    light = np.full((HEIGHT, WIDTH), 0.0)
    part = np.s_[first[1] : last[1], first[0] : last[0]]
    dark, bright, behind = rng.uniform([0.04, 0.55, 0.2], [0.15, 0.9, 0.6])
    light[:] = behind
    light[part] = _cast(camera, pose, id, first, last, (dark, bright, behind), rng)
    across, down = np.meshgrid(np.linspace(-1, 1, WIDTH), np.linspace(-1, 1, HEIGHT))
    slopes = rng.uniform(-0.2, 0.2, 2)
    light *= 1 + slopes[0] * across + slopes[1] * down
    levels = 255 * (camera.exposure * light) ** (1 / camera.gamma)
    noise = rng.uniform(*camera.noise)
    if camera.mosaic:
        levels = _demosaiced(levels, noise, rng)
    else:
        levels = np.clip(levels + rng.normal(0, noise, levels.shape), 0, 255)
    if camera.sharpen:
        levels = levels + camera.sharpen * (levels - _soft(levels, 1.0))
    gray = np.clip(np.round(levels), 0, 255).astype(np.uint8)
    if camera.jpeg:
        done, coded = cv2.imencode(".jpg", gray, [cv2.IMWRITE_JPEG_QUALITY, camera.jpeg])
        assert done
        gray = cv2.imdecode(coded, cv2.IMREAD_GRAYSCALE)
    return gray


def _cast(
    camera: Camera,
    pose: Pose,
    id: int,
    first: np.ndarray,
    last: np.ndarray,
    tones: tuple[float, float, float],
    rng: np.random.Generator,
) -> np.ndarray:
    """The light of the pixels from ``first`` to ``last``: rays to the plane, blurred, averaged."""
    width, height = last - first
    u, v = np.meshgrid(np.arange(first[0], last[0]), np.arange(first[1], last[1]))
    rays = _rays_in(camera, pose, u, v)
    offsets = rng.random((2, height, width, _SUB, _SUB))
    levels = _levels(id, *tones)
    ends = [_cells(camera, pose, rays, v, a, b) for a in (-0.5, 0.5) for b in (-0.5, 0.5)]
    light = np.empty((height, _SUB, width, _SUB))
    light[:] = levels[ends[0]][:, None, :, None]
    rows, columns = np.nonzero(np.ptp(ends, axis=0).any(axis=0))  # the others are in one cell
    steps = np.arange(_SUB)
    for part in range(0, len(rows), _PART):
        i, j = rows[part : part + _PART], columns[part : part + _PART]
        a = (offsets[0, i, j] + steps) / _SUB - 0.5
        b = (offsets[1, i, j] + steps[:, None]) / _SUB - 0.5
        of_these, at = rays[..., i, j, None, None], v[i, j, None, None]
        light[i, :, j] = levels[_cells(camera, pose, of_these, at, a, b)]
    light = _soft(light.reshape(height * _SUB, -1), _SUB * rng.uniform(*camera.blur))
    return light.reshape(height, _SUB, width, _SUB).mean(axis=(1, 3))


def _cells(
    camera: Camera,
    pose: Pose,
    rays: np.ndarray,
    row: np.ndarray,
    a: np.ndarray | float,
    b: np.ndarray | float,
) -> tuple[np.ndarray, np.ndarray]:
    """Places in `_levels` that are met by rays at ``a`` and ``b``, -0.5 to 0.5, in pixels."""
    ray_x, ray_y, ray_z = _horner([_horner(one, 2 * b) for one in rays], 2 * a)
    late = camera.readout_s * (row + b - HEIGHT / 2) / HEIGHT
    t, velocity = pose.t @ pose.R, pose.velocity @ pose.R
    along = (t[2] + late * velocity[2]) / ray_z
    x, y = ray_x * along - t[0] - late * velocity[0], ray_y * along - t[1] - late * velocity[1]
    cell = SIZE_M / CELLS
    across, down = x / cell + CELLS / 2 + 2, CELLS / 2 - y / cell + 2
    across, down = (np.clip(one, 0, CELLS + 3).astype(int) for one in (across, down))
    return down, across


def _levels(id: int, dark: float, bright: float, behind: float) -> np.ndarray:
    """Light of each cell of the tag, the paper around it, and what is behind: a cell each."""
    code = np.where(_code(id), bright, dark)
    return np.pad(np.pad(code, 1, constant_values=bright), 1, constant_values=behind)


def _horner(coefficients: Sequence[np.ndarray], x: np.ndarray) -> np.ndarray:
    """Values of a polynomial of the second degree."""
    c, b, a = coefficients
    value = a * x
    value += b
    value *= x
    value += c
    return value


_POWERS = np.array([[0, 1, 0], [-0.5, 0, 0.5], [0.5, -1, 0.5]])
"""Coefficients of 1, x, x^2 of the parabola through values at -1, 0 and 1."""


def _rays_in(camera: Camera, pose: Pose, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Rays of all pixels in the tag's axes, as polynomials of the place in the pixel.

    The place is from -1 to 1. (3, 3, 3, height, width): power of x, power of y, axis of the ray.
    """
    height, width = u.shape
    halves = (
        first + np.arange(-1, 2 * n) / 2 for first, n in ((u[0, 0], width), (v[0, 0], height))
    )
    rays = camera.rays(*np.meshgrid(*halves)) @ pose.R  # of the nodes -0.5, 0 and 0.5 in each pixel
    near = np.array([[rays[j::2, i::2][:height, :width] for j in range(3)] for i in range(3)])
    return np.einsum("ki,lj,ijhwa->klahw", _POWERS, _POWERS, near, optimize=True)


def _code(id: int) -> np.ndarray:
    """(8, 8) cells, 1 is white. OpenCV draws the tags of this family upside down."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    return cv2.aruco.generateImageMarker(dictionary, id, CELLS)[::-1, ::-1] > 127


def _soft(values: np.ndarray, sigma: float) -> np.ndarray:
    """Blurred by a Gaussian, as its Fourier transform has it; the picture goes round."""
    height, width = values.shape
    values = np.pad(values, [(0, _fast(n) - n) for n in values.shape], mode="edge")
    rows, columns = np.fft.fftfreq(len(values)), np.fft.rfftfreq(values.shape[1])
    down, across = (np.exp(-2 * (np.pi * sigma * one) ** 2) for one in (rows, columns))
    passed = np.fft.rfft2(values) * down[:, None] * across
    return np.fft.irfft2(passed, values.shape)[:height, :width]


@cache
def _fast(size: int) -> int:
    """The next size whose Fourier transform is quick: a product of 2, 3 and 5."""
    rest = size
    for prime in (2, 3, 5):
        while rest % prime == 0:
            rest //= prime
    return size if rest == 1 else _fast(size + 1)


def _demosaiced(levels: np.ndarray, noise: float, rng: np.random.Generator) -> np.ndarray:
    """Gray from red, green and blue, each seen by some pixels and averaged between, balanced."""
    tint = _SPECTRUM[0]
    red, blue = np.zeros(levels.shape, bool), np.zeros(levels.shape, bool)
    red[::2, ::2], blue[1::2, 1::2] = True, True
    gray = np.zeros_like(levels)
    for seen, part, weight in zip(
        (red, ~red & ~blue, blue), tint, (0.299, 0.587, 0.114), strict=True
    ):
        raw = np.round(np.clip(levels * part + rng.normal(0, noise, levels.shape), 0, 255)) / part
        total, count = (_summed(np.where(seen, one, 0.0)) for one in (raw, np.ones_like(raw)))
        gray += weight * np.where(seen, raw, total / np.maximum(count, 1e-9))
    return np.clip(gray, 0, 255)


def _summed(values: np.ndarray) -> np.ndarray:
    """Weighted sums of 3 by 3 neighbours: 1 2 1, 2 4 2, 1 2 1."""
    for axis in (0, 1):
        values = 2 * values + np.roll(values, 1, axis) + np.roll(values, -1, axis)
    return values


CAMERAS = {
    "ideal": Camera(),
    "plumb_bob, k1 -0.10": Camera(D=(-0.10, 0.01, 0.0, 0.0, 0.0)),
    "plumb_bob, k1 -0.29": Camera(D=(-0.29, 0.08, 0.0005, -0.0003, 0.0), focal=450),
    "rational_polynomial": Camera(
        "rational_polynomial", (0.4, 0.02, 0.0004, 0.0002, 0.0, 0.65, 0.06, 0.0), 450
    ),
    "equidistant": Camera("equidistant", (-0.01, 0.02, -0.01, 0.002), 260),
    "tone curve, gamma 2.2": Camera(gamma=2.2),
    "overexposed": Camera(exposure=1.7),
    "JPEG, quality 90": Camera(jpeg=90),
    "JPEG, quality 60": Camera(jpeg=60),
    "demosaiced": Camera(mosaic=True),
    "sharpened by 0.5": Camera(sharpen=0.5),
    "sharpened by 1.5": Camera(sharpen=1.5),
    "rolling shutter, 20 ms, 300 px/s": Camera(readout_s=0.02, speed_px=300),
    "all of these": Camera(
        "plumb_bob",
        (-0.29, 0.08, 0.0005, -0.0003, 0.0),
        450,
        mosaic=True,
        sharpen=0.8,
        gamma=2.2,
        jpeg=80,
        readout_s=0.02,
        speed_px=150,
    ),
}

_SIDES, _TILTS = (26, 40, 64, 110), (0, 15, 30, 45, 60)
INTERVAL_S, _VIEWS = 0.1, 4  # between pictures; and of each tag that moves
_CHANGE = 0.15  # of its velocity from one picture to the next, as a fraction (standard deviation)


@dataclass(frozen=True)
class Sight:
    """A picture and the truth."""

    gray: np.ndarray
    id: int
    pose: Pose
    corners_uv: np.ndarray
    side_px: float


def sights(camera: Camera, count: int, seed: int = 1):
    """Pictures of tags of all sizes, tilts and places, as one camera takes them one by one.

    A tag that moves is in four consecutive pictures.
    """
    rng = np.random.default_rng([seed, 34])
    for number in range(count):
        side, tilt = _SIDES[number % 4], _TILTS[number % 5]
        pose, id = random_pose(camera, rng, side, tilt), int(rng.integers(587))
        for one in _moments(camera, pose, rng):
            gray = take(camera, one, id, rng)
            yield Sight(gray, id, one, corners_of(camera, one), side)


def _moments(camera: Camera, pose: Pose, rng: np.random.Generator) -> list[Pose]:
    """Poses of a tag that ends at a pose."""
    poses = [pose]
    for _ in range(_VIEWS - 1 if camera.speed_px else 0):
        now = poses[0]
        change = rng.normal(0, _CHANGE * np.linalg.norm(now.velocity), 3) * [1, 1, 0]
        t = now.t - INTERVAL_S * (now.velocity - change / 2)
        poses.insert(0, Pose(now.R, t, now.velocity - change))
    return poses
