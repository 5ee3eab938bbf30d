"""Images of a camera that flies over a textured ground, as a homography draws them."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np

from ros_visualise.data import CameraInfo, Floats, Header, Imu, Pixels
from ros_visualise.geometry import se3

HEIGHT = 2.0  # metres
_SIZE = 320, 240
_PER_METRE = 60  # pixels of the texture


class Flight:
    """A flight of 0.12 m an image, that turns and rolls a little; the camera looks down by 40°."""

    def __init__(self) -> None:
        K = np.array([[260.0, 0, 159.5], [0, 260.0, 119.5], [0, 0, 1]])
        self.info = CameraInfo(_SIZE[1], _SIZE[0], K)

    def p(self, n: int) -> Floats:
        """(3,) position of the camera, z up, at an image."""
        return np.array([0.12 * n, 0.3 * np.sin(n / 12), HEIGHT])

    def R(self, n: int) -> Floats:  # noqa: N802
        """(3, 3) rotation from the camera's axes to those of the ground."""
        ahead = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])
        down = cv2.Rodrigues(np.array([0, np.deg2rad(40), 0.0]))[0]
        turned = cv2.Rodrigues(np.array([0.03 * np.sin(n / 5), 0.02 * np.sin(n / 7), n / 300]))[0]
        return np.asarray(turned @ down @ ahead)

    def motion(self, first: int, second: int) -> tuple[Floats, Floats]:
        """T_first_second."""
        back = self.R(first).T
        return back @ self.R(second), back @ (self.p(second) - self.p(first))

    def image(self, n: int) -> Pixels:
        """The image, gray."""
        R = self.R(n).T
        ground = np.column_stack([R[:, 0], R[:, 1], -R @ self.p(n)])  # of (x, y, 1)
        pixels = np.diag([1 / _PER_METRE, 1 / _PER_METRE, 1])
        pixels[:2, 2] = -2, -8
        H = self.info.K @ ground @ pixels
        return np.asarray(cv2.warpPerspective(_texture(), H, _SIZE, flags=cv2.INTER_AREA))


def place(t: float) -> float:
    """Number of the drawn image at a time: at rest for 0.7 s, then faster for a second."""
    gone = max(t - 0.7, 0.0)
    return 5 * min(gone, 1.0) ** 2 + 10 * max(gone - 1.0, 0.0)


def felt(flight: Flight, t: float, h: float = 1e-3) -> Imu:
    """An exact measurement of an IMU in the camera."""
    R = [flight.R(place(t + one)) for one in (-h, 0, h)]
    p = [flight.p(place(t + one)) for one in (-h, 0, h)]
    force = R[1].T @ ((p[0] - 2 * p[1] + p[2]) / h**2 + np.array([0, 0, 9.80665]))
    rates = se3.rotation_vector(R[0].T @ R[2]) / (2 * h)
    return Imu(
        np.array([0, 0, 0, 1.0]), rates, force, *[np.eye(3)] * 3, Header(round(t * 1e9), "imu")
    )


@cache
def _texture() -> Pixels:
    noise = np.random.default_rng(1)
    texture = np.zeros((960, 1200), np.float32)
    for side in (4, 8, 16, 64):
        spots = noise.normal(0, 1, (960 // side, 1200 // side)).astype(np.float32)
        texture += cv2.resize(spots, (1200, 960), interpolation=cv2.INTER_CUBIC)
    return np.asarray(np.clip(120 + 30 * texture, 0, 255).astype(np.uint8))
