"""The robot, the last poses of its camera, and some points that these see, with one covariance.

Rows of the covariance: ``CORE`` errors of the robot (pose, velocity, biases of the IMU, clock,
attitude and lens of the camera), six of each view, and three of each point. Errors of poses and
velocity are those of `ros_visualise.estimation.robot`: common twists of the map. A point is a
direction and an inverse depth, as `lens` describes them, in its *host*, one of the views; so a
motion of the whole map is the same twist for the robot and all views, and nothing for points. It is
known to be unobservable, at every estimate.

Source: A. Mourikis, S. Roumeliotis, A multi-state constraint Kalman filter for vision-aided
inertial navigation, ICRA 2007 (the views); A. Barrau, S. Bonnabel, The invariant extended Kalman
filter as a stable observer, 2017, and K. Wu et al., An invariant-EKF VINS algorithm for improving
consistency, IROS 2017 (the errors); J. Civera et al., Inverse depth parametrization for monocular
SLAM, 2008 (the points).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.camera_view import CameraView
from ros_visualise.estimation.imu import ACCEL, GYRO
from ros_visualise.estimation.inertial.lens import points_of, values_of
from ros_visualise.estimation.measuring import CAMERAS, CLOCK, TURN, camera_of, turn_of
from ros_visualise.estimation.resting import Indices
from ros_visualise.estimation.robot import POSE, VELOCITY, RobotState, core
from ros_visualise.geometry import se3

MOTION = slice(6, 9)
"""Rows of the velocity, m/s."""
RATE_BIAS, FORCE_BIAS = slice(9, 12), slice(12, 15)
"""Rows of the biases of the IMU, rad/s and m/s^2."""
CAMERA = slice(15, 20)
"""Rows of the camera's clock, s, of its attitude on the robot, rad about its own axes, and of the
age of that attitude, s.
"""
LENS = slice(20, 24)
"""Rows of the errors of the lens, see `lens`; those of the views follow."""
READOUTS, SHAPE = slice(20, 22), slice(22, 24)
"""Rows of the first two, and of the others."""
_MEASURED = slice(0, 19)  # of the core: those of a `RobotState`
CORE, VIEW, POINT = 24, 6, 3
_INVERSE = -14.0, 7.0  # logarithms of inverse depths, 1/m: 1 mm to 1000 km


def _places() -> Indices:
    """Their places among all errors of a `RobotState`."""
    clock, turn = CAMERAS[0].rows.start + CLOCK, turn_of(0)
    parts = [POSE, VELOCITY, GYRO.rows, ACCEL.rows, slice(clock, clock + 1), turn]
    return np.concatenate([np.arange(one.start, one.stop) for one in parts])


class SlidingState:
    """See the module.

    Attributes:
        robot: its estimate.
        age: of the attitude of the camera on the robot, as it is known, s: as on a gimbal.
        lens: (4,) its errors: readout, s, that of jumps, and those of focal length and distortion.
        R, p: T_map_camera (C, 3, 3) and (C, 3) of the views, the oldest first.
        host: (N,) index of the view of each point.
        points: (N, 3) x and y of their directions there at z = 1, as the calibration gives them,
            and logarithms of inverse depths, 1/m; see `lens`.
        P: (n, n) covariance, n = CORE + 6 C + 3 N.
    """

    def __init__(self, robot: RobotState, variances: Floats) -> None:
        self.robot, self.P = robot, np.diag(variances)
        self.age, self.lens = 0.0, np.zeros(LENS.stop - LENS.start)
        self.R, self.p = np.zeros((0, 3, 3)), np.zeros((0, 3))
        self.host: Indices = np.zeros(0, np.intp)
        self.points = np.zeros((0, POINT))

    @property
    def views(self) -> slice:
        """Rows of all views."""
        return slice(CORE, CORE + VIEW * len(self.R))

    @property
    def seeing(self) -> slice:
        """Rows of the lens and of all views: where corners are seen depends on these."""
        return slice(LENS.start, self.views.stop)

    def rows_of_points(self, which: Indices) -> Indices:
        """(K, 3) rows of points."""
        rows: Indices = self.views.stop + POINT * which[:, None] + np.arange(POINT)
        return rows

    # time

    def propagate(self, robot: RobotState, J: Floats, noise: Floats) -> None:
        """Move the robot; its errors change by J and get noise of a covariance, both (core, core).

        Called by `ros_visualise.estimation.imu.propagate_by_imu`.
        """
        at, rows = np.ix_(_places(), _places()), _MEASURED
        self.robot, ahead = robot, J[at]
        self.P[rows] = ahead @ self.P[rows]
        self.P[rows.stop :, rows] = self.P[rows, rows.stop :].T
        own = self.P[rows, rows] @ ahead.T + noise[at]
        self.P[rows, rows] = (own + own.T) / 2

    def wander(self, keep: Floats, noise: Floats) -> None:
        """Let the errors of the camera shrink by factors (5,), and add variances (5,)."""
        self.P[CAMERA] *= keep[:, None]
        self.P[:, CAMERA] *= keep
        rows = np.arange(CAMERA.start, CAMERA.stop)
        self.P[rows, rows] += noise
        own = self.robot[CAMERAS[0]].copy()
        own[CLOCK], own[TURN] = keep[0] * own[CLOCK], keep[1:4] * own[TURN]
        self.robot = self.robot.with_own(CAMERAS[0], own)

    # views

    def see(self, T_base_camera: Floats, rates: Floats, noise: Floats) -> None:
        """Add the present pose of the camera as a view.

        Args:
            T_base_camera: (4, 4), as far as it is known.
            rates: (3,) angular velocity of the camera on the robot, rad/s about its own axes.
            noise: (6, 6) covariance of the twist of this pose alone, in the camera's axes.
        """
        mounted = CameraView(0, T_base_camera[:3, :3], T_base_camera[:3, 3], (), {}, b"")
        camera = camera_of(mounted, self.robot)
        late_s = float(self.robot[CAMERAS[0]][CLOCK])
        R = camera.R @ se3.exp(np.concatenate([np.zeros(3), (late_s + self.age) * rates]))[0]
        turned = np.concatenate([np.cross(camera.p, R @ rates), R @ rates])
        J = np.zeros((VIEW, len(self.P)))
        J[:, POSE] = np.eye(VIEW)
        J[:, CAMERA] = np.column_stack([camera.by_camera, turned])
        J[:, CAMERA.start] += turned
        ahead = se3.adjoint(R, camera.p)
        self._insert(self.views.stop, J @ self.P, J @ self.P @ J.T + ahead @ noise @ ahead.T)
        self.R = np.concatenate([self.R, R[None]])
        self.p = np.concatenate([self.p, camera.p[None]])

    def drop_view(self, which: int) -> None:
        """Forget a view, which must be the host of no point."""
        start = CORE + VIEW * which
        self._delete(np.arange(start, start + VIEW))
        self.R, self.p = np.delete(self.R, which, 0), np.delete(self.p, which, 0)
        self.host = self.host - (self.host > which)

    # points

    def add_points(self, host: Indices, points: Floats, across: Floats, own: Floats) -> None:
        """Add points (K, 3) whose errors have covariances across (3 K, n) and own (3 K, 3 K)."""
        self._insert(len(self.P), across, own)
        self.host = np.concatenate([self.host, host])
        self.points = np.concatenate([self.points, points])

    def drop_points(self, which: Indices) -> None:
        """Forget points."""
        self._delete(self.rows_of_points(which).ravel())
        self.host = np.delete(self.host, which)
        self.points = np.delete(self.points, which, 0)

    def drag_points(self, sigma: float) -> None:
        """Add independent errors of that standard deviation to the directions of all points."""
        rows = self.rows_of_points(np.arange(len(self.points)))[:, :2].ravel()
        self.P[rows, rows] += sigma**2

    def rehost(self, which: Indices, view: int) -> None:
        """Describe points in another view."""
        host, rows = self.host[which], self.rows_of_points(which)
        values, own, by_lens = values_of(self.points[which], self.lens)
        z, by_value, J_view = transfer(self, which, values, view)
        points = points_of(z, self.lens)
        _, new, new_by_lens = values_of(points, self.lens)
        back = np.linalg.inv(new)
        J_lens = back @ (by_value @ by_lens - new_by_lens)
        J_point, J_view = back @ by_value @ own, back @ J_view
        J = np.zeros((len(which), POINT, len(self.P)))
        J[:, :, LENS] = J_lens
        for n, (old, row) in enumerate(zip(host, rows, strict=True)):
            J[n, :, row] = J_point[n].T
            for place, sign in ((view, 1), (old, -1)):
                columns = slice(CORE + VIEW * place, CORE + VIEW * place + VIEW)
                J[n, :, columns] += sign * J_view[n]
        flat, rows = J.reshape(-1, len(self.P)), rows.ravel()
        across = flat @ self.P
        own = across @ flat.T
        self.P[rows] = across
        self.P[:, rows] = across.T
        self.P[np.ix_(rows, rows)] = own
        self.points[which] = points
        self.host[which] = view

    # correction

    def correct(self, columns: Indices | slice, H: Floats, residual: Floats) -> None:
        """Correct by k numbers, see `solve`."""
        self.apply(*self.solve(columns, H, residual))

    def solve(self, columns: Indices | slice, H: Floats, residual: Floats) -> tuple[Floats, Floats]:
        """A root (n, k) of what k numbers take from the covariance, and the error (n,).

        Args:
            columns: the m rows that these depend on.
            H: (k, m) derivatives of the expected values.
            residual: (k,) measured minus expected, with independent noise of variance 1.
        """
        HP = H @ self.P[columns]
        S = HP[:, columns] @ H.T
        S[np.diag_indices(len(S))] += 1
        root = np.linalg.cholesky((S + S.T) / 2)
        whitened = np.linalg.solve(root, np.column_stack([HP, residual]))
        gain = whitened[:, :-1].T
        return gain, gain @ whitened[:, -1]

    def apply(self, gain: Floats, error: Floats) -> None:
        """Apply what `solve` has found."""
        self.move(error)
        self.P -= gain @ gain.T

    def move(self, error: Floats) -> None:
        """Correct the estimates by an error (n,)."""
        every = np.zeros(core())
        every[_places()] = error[_MEASURED]
        self.age += float(error[CAMERA.stop - 1])
        self.lens = self.lens + error[LENS]
        self.robot = self.robot.moved(every)
        twists = error[self.views].reshape(-1, VIEW)
        self.R, self.p = se3.moved(twists, self.R, self.p)
        self.points = self.points + error[self.views.stop :].reshape(-1, POINT)
        self.points[:, 2] = self.points[:, 2].clip(*_INVERSE)

    def settle(self) -> None:
        """Remove the errors of rounding from the robot's attitude."""
        U, _, Vt = np.linalg.svd(self.robot.R)
        self.robot = replace(self.robot, R=U @ Vt)

    def _insert(self, at: int, across: Floats, own: Floats) -> None:
        """Add errors before a row, with covariances across (k, n) and own (k, k)."""
        n, k = len(self.P), len(own)
        old = np.delete(np.arange(n + k), np.arange(at, at + k))
        new = slice(at, at + k)
        P = np.empty((n + k, n + k))
        P[np.ix_(old, old)] = self.P
        P[new, old], P[old, new], P[new, new] = across, across.T, (own + own.T) / 2
        self.P = P

    def _delete(self, rows: Indices) -> None:
        left = np.delete(np.arange(len(self.P)), rows)
        self.P = self.P[np.ix_(left, left)]


def transfer(
    state: SlidingState, which: Indices, values: Floats, view: int
) -> tuple[Floats, Floats, Floats]:
    """Points of a state with directions and inverse depths (K, 3), in another view.

    Returns:
        Directions and inverse depths there (K, 3), and their derivatives (K, 3, 3) by those in the
        hosts and (K, 3, 6) by the twist of the view; those by the twist of the host are opposite.
    """
    uv, rho = values[:, :2], values[:, 2:]
    R_host, p_host = state.R[state.host[which]], state.p[state.host[which]]
    back, p_view = state.R[view].T, state.p[view]
    direction = (R_host[:, :, :2] @ uv[..., None])[..., 0] + R_host[:, :, 2]
    seen = (direction + rho * (p_host - p_view)) @ back.T
    depth = np.maximum(seen[:, 2:], 1e-3)
    z = np.column_stack([seen[:, :2], rho]) / depth
    by_point = np.empty((len(which), 3, 3))
    by_point[..., :2] = back @ R_host[:, :, :2]
    by_point[..., 2] = (p_host - p_view) @ back.T
    by_view = np.empty((len(which), 3, 6))
    by_view[..., :3] = -rho[..., None] * back
    by_view[..., 3:] = back @ se3.cross(direction + rho * p_host)
    flat = np.zeros((len(which), 3, 3))  # of the result by what is seen
    flat[:, 0, 0] = flat[:, 1, 1] = 1
    flat[..., 2] -= z
    flat /= depth[..., None]
    J_point, J_view = flat @ by_point, flat @ by_view
    J_point[:, 2, 2] += 1 / depth[:, 0]
    return z, J_point, J_view
