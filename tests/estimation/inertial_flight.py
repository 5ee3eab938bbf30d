"""A flight over uneven ground, with the corners that a camera sees and the IMU's measurements.

It starts at rest. Its formulas are its own: poses are sums of sines, rates and forces are their
derivatives by differences. Corners are projected points with noise; every one that leaves the
image is replaced by a new one.
"""

import math

import numpy as np

from ros_visualise.estimation.imu import ImuBuffer, Mounting
from ros_visualise.geometry import se3

FOCAL, WIDTH, HEIGHT = 380.0, 640, 480
RATE = 200
DENSITIES, WALKS = (3e-4, 2e-3), (2e-5, 2e-4)
MOUNTING = Mounting(np.eye(3), np.zeros(3))
T_BASE_CAMERA = np.eye(4)
T_BASE_CAMERA[:3, :3] = [[0, -1, 0], [-1, 0, 0], [0, 0, -1]]  # looking down, top of image ahead
T_BASE_CAMERA[:3, 3] = [0.1, 0.02, -0.05]


class InertialFlight:
    """See the module.

    Args:
        seed: of everything that is random.
        noise_px: of corners.
        still_s: time at rest at the start.
        readout_s: of the camera's rolling shutter.
        jump_rad: by which the camera turns from image to image, but not within one.
    """

    def __init__(self, seed, noise_px=0.3, still_s=1.0, corners=60, readout_s=0.0, jump_rad=0.0):
        self.random = np.random.default_rng(seed)
        self.noise_px, self.still_s, self.corners = noise_px, still_s, corners
        self.readout_s, self.jump_rad = readout_s, jump_rad
        self.turn = self.turn_before = np.zeros(3)
        self.size = self.random.uniform(0.5, 1.5, (6, 2)) * [[3, 1]] * 3 + [[0, 0]]
        self.size[2] = [0.8, 0.3]
        self.size[3:] = self.random.uniform(0.02, 0.08, (3, 2))
        self.size[5] = [0.6, 0.2]
        self.pace = self.random.uniform(0.3, 0.6, (6, 2)) * [[1, 2.5]]
        self.phase = self.random.uniform(0, 6.28, (6, 2))
        self.bias = np.concatenate([self.random.normal(0, 5e-3, 3), self.random.normal(0, 0.05, 3)])
        self.imu, self.count = ImuBuffer(), 0
        self.points, self.ids, self.next = np.zeros((0, 3)), np.zeros(0, int), 0

    def _sums(self, t):
        """(6,) position and roll, pitch, yaw."""
        gone = max(t - self.still_s, 0.0)
        soft = gone**3 / (gone**3 + 1.0)  # the first two derivatives begin at zero
        at = (self.size * np.sin(self.pace * gone + self.phase)).sum(axis=1)
        return soft * (at - (self.size * np.sin(self.phase)).sum(axis=1))

    def pose(self, t):
        """T_world_base (4, 4); the start is at 5 m."""
        x, y, z, *angles = self._sums(t).tolist()
        a, b, c = map(math.cos, angles)
        d, e, f = map(math.sin, angles)
        return np.array(
            [
                [c * b, c * e * d - f * a, c * e * a + f * d, x],
                [f * b, f * e * d + c * a, f * e * a - c * d, y],
                [-e, b * d, b * a, z + 5.0],
                [0, 0, 0, 1],
            ]
        )

    def feel(self, t, h=1e-3):
        """(6,) exact rates and force, in the robot's axes."""
        a, b, c = self.pose(t - h), self.pose(t), self.pose(t + h)
        force = (a[:3, 3] - 2 * b[:3, 3] + c[:3, 3]) / h**2 + np.array([0, 0, 9.80665])
        rates = se3.rotation_vector(a[:3, :3].T @ c[:3, :3]) / (2 * h)
        return np.concatenate([rates, b[:3, :3].T @ force])

    def measure(self, until_s):
        """Measure up to a time, into `imu`."""
        density = np.repeat(DENSITIES, 3) * np.sqrt(RATE)
        walk = np.repeat(WALKS, 3) / np.sqrt(RATE)
        while self.count <= until_s * RATE:
            self.bias = self.bias + walk * self.random.normal(size=6)
            values = self.feel(self.count / RATE) + self.bias
            values = values + density * self.random.normal(size=6)
            stamp_ns = round(self.count * 1e9 / RATE)
            self.imu.add(stamp_ns, values[:3], values[3:], MOUNTING)
            self.count += 1

    def see(self, t):
        """Numbers (N,) and directions (N, 2) of the corners in view."""
        if self.jump_rad:
            jump = self.random.normal(0, self.jump_rad, 3)
            self.turn_before, self.turn = self.turn, 0.98 * self.turn + jump
        T = self.camera(t, self.turn)
        ok, uv = self._project(T)
        self.points, self.ids, uv = self.points[ok], self.ids[ok], uv[ok]
        count = self.corners - len(self.ids)
        if count > 0:
            self._add(T, count)
            _, uv = self._project(T)
        noise = self.random.normal(0, self.noise_px, uv.shape)
        late = self.readout_s * uv[:, 1:] / HEIGHT * self.velocities(t)
        return self.ids.copy(), (uv + late + noise) / FOCAL

    def velocities(self, t, before=0.01, after=0.01):
        """(N, 2) mean velocities of the corners in view around a time, pixels/s."""
        return self._moved(t - before, t + after, self.turn)

    def rolling(self, t):
        """(N, 3) velocities of their directions since the image before, 1/s, and their rows."""
        rows = self._project(self.camera(t, self.turn))[1][:, 1] / HEIGHT
        return np.column_stack([self._moved(t - 0.1, t, self.turn_before) / FOCAL, rows])

    def camera(self, t, turn):
        """T_world_camera (4, 4), turned on the robot."""
        T = self.pose(t) @ T_BASE_CAMERA
        T[:3, :3] = T[:3, :3] @ se3.exp(np.append(np.zeros(3), turn))[0]
        return T

    def _moved(self, before, after, turn_before):
        poses = self.camera(before, turn_before), self.camera(after, self.turn)
        first, last = (self._project(T)[1] for T in poses)
        return (last - first) / (after - before)

    def _project(self, T):
        seen = se3.apply(se3.inverse(T), self.points)
        uv = FOCAL * seen[:, :2] / np.maximum(seen[:, 2:], 0.1)
        ok = (seen[:, 2] > 0.3) & (np.abs(uv) < [WIDTH / 2, HEIGHT / 2]).all(axis=1)
        return ok, uv

    def _add(self, T, count):
        uv = self.random.uniform(-0.5, 0.5, (count, 2)) * [WIDTH, HEIGHT] / FOCAL
        rays = np.column_stack([uv, np.ones(count)]) @ T[:3, :3].T
        down = np.where(rays[:, 2] < -0.1, -rays[:, 2], 0.1)
        heights = self.random.uniform(-0.5, 1.0, count)
        points = T[:3, 3] + rays * ((T[2, 3] - heights) / down)[:, None]
        self.points = np.concatenate([self.points, points])
        self.ids = np.concatenate([self.ids, np.arange(self.next, self.next + count)])
        self.next += count
