"""Checking the mounting of the camera by the motion of the robot: tf may be wrong.

Odometry and views of tags measure the same motion, and so reveal how the camera is mounted on the
robot: a rotated camera sees the robot move in another direction. The rotation relative to an IMU
follows from the axes of rotations, which both measure. Without motion, nothing is learnt and the
standard deviation stays as large as before.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats
from ros_visualise.estimation.gates import GATES
from ros_visualise.estimation.mapping.minimising import GATE, chi2_of, kept, minimise, robust
from ros_visualise.estimation.mapping.motions import relative
from ros_visualise.estimation.mapping.noise import scales_of_odometry
from ros_visualise.estimation.mapping.smoothing import SmoothedMap, result_of
from ros_visualise.estimation.mapping.terms import Terms
from ros_visualise.estimation.mapping.unknowns import MOUNTING, SharedPrior, Unknowns
from ros_visualise.geometry.se3 import cross, rotation_vectors
from ros_visualise.landmarks.pose.refinement import turn

_FREE_M, _FREE_RAD = 0.2, np.deg2rad(5.0)  # prior of a mounting
_FREE_RATE = 0.1  # rad/s, of a gyroscope's bias
_ROUNDS = 4
_NOTICED_DEG = 0.5  # smallest reported rotation
_VAGUE_DEG = 1.5  # standard deviation beyond which a rotation counts as unknown
_LONGEST_S = 1.0  # longest time between views for comparison with an IMU
_LEAST_TURNS = 10


@dataclass(frozen=True, eq=False)
class MountingCheck:
    """The error of a transform in tf: rotation and translation.

    Attributes:
        what: the two parts, in words.
        turn_deg: (3,) degrees about the camera's x, y and z.
        turn_covariance: (3, 3) degrees squared.
        shift_m, shift_sigma_m: (3,) metres along these; None if not estimated.
    """

    what: str
    turn_deg: Floats
    turn_covariance: Floats
    shift_m: Floats | None = None
    shift_sigma_m: Floats | None = None

    @property
    def turn_sigma_deg(self) -> Floats:
        """(3,) standard deviations."""
        return np.sqrt(np.diag(self.turn_covariance))

    @property
    def is_wrong(self) -> bool:
        """True if the motion contradicts the transform, about the observable axes."""
        turned, variances = self._known
        return float((turned**2 / variances).sum()) > GATES[3] and self._angle_deg > _NOTICED_DEG

    @property
    def _known(self) -> tuple[Floats, Floats]:
        """The rotation about the observable axes, and its variances."""
        variances, axes = np.linalg.eigh(self.turn_covariance)
        known = variances < _VAGUE_DEG**2
        return (axes.T @ self.turn_deg)[known], variances[known]

    @property
    def _angle_deg(self) -> float:
        return float(np.linalg.norm(self._known[0]))

    @property
    def text(self) -> str:
        """A sentence for the report."""
        each = ", ".join(
            f"{axis} {value:+.2f} +- {sigma:.2f}"
            for axis, value, sigma in zip("xyz", self.turn_deg, self.turn_sigma_deg, strict=True)
        )
        if self.is_wrong:
            return (
                f"{self.what} is rotated by {self._angle_deg:.1f} degrees relative to its"
                f" transform in tf: correct it (degrees about the camera's axes: {each})"
            )
        far = ", as far as this motion shows" if self.turn_sigma_deg.max() > _VAGUE_DEG else ""
        return f"{self.what} agrees with tf{far} (degrees about the camera's axes: {each})"


def freely_mounted(prior: SharedPrior) -> SharedPrior:
    """The prior with an unknown mounting of the camera."""
    return replace(prior, mounting_m=_FREE_M, mounting_rad=_FREE_RAD)


def camera_mounting(found: SmoothedMap) -> tuple[MountingCheck, SmoothedMap]:
    """The camera on its robot, and the map with the estimated mounting.

    Raises:
        numpy.linalg.LinAlgError: the problem is underdetermined.
    """
    terms = Terms(found.problem, found.noise, freely_mounted(SharedPrior()))
    state = Unknowns(found.views, found.tags, found.shared)
    state = minimise(terms, state, robust(9 * GATE), 15)
    for _ in range(_ROUNDS):
        inliers = chi2_of(terms, state) < GATE
        if found.is_estimated:
            terms.noise = scales_of_odometry(terms, state, inliers)
        state = minimise(terms, state, kept(inliers), 10)
    freed = result_of(terms, state, inliers, found.undecided, found.is_estimated)
    off, covariance = freed.shared[MOUNTING], freed.shared_covariance[MOUNTING, MOUNTING]
    sigmas = np.sqrt(np.diag(covariance))
    mounting = MountingCheck(
        "the camera on the robot",
        np.rad2deg(off[3:]),
        np.rad2deg(np.rad2deg(covariance[3:, 3:])),
        off[:3],
        sigmas[:3],
    )
    return mounting, freed


@dataclass(frozen=True, eq=False)
class Gyro:
    """Angular velocities of an IMU.

    Attributes:
        stamps_ns: (T,) in order.
        rates_xyz: (T, 3) rad/s in its frame.
        R_imu_camera: (N, 3, 3) at each view, according to tf.
    """

    stamps_ns: npt.NDArray[np.int64]
    rates_xyz: Floats
    R_imu_camera: Floats


def imu_mounting(found: SmoothedMap, gyro: Gyro) -> MountingCheck | None:
    """The camera relative to an IMU, from the rotations between views; None if too few.

    A constant bias of the IMU is estimated as well.
    """
    seen = rotation_vectors(relative(found.views).R)
    turned, elapsed_s = _integrated(gyro, found.problem.stamps_ns)
    R = gyro.R_imu_camera
    usable = np.isfinite(turned).all(axis=(1, 2)) & (elapsed_s < _LONGEST_S) & (elapsed_s > 0)
    if usable.sum() < _LEAST_TURNS:
        return None
    by_imu = rotation_vectors(np.swapaxes(R[:-1], 1, 2)[usable] @ turned[usable] @ R[1:][usable])
    seen, elapsed_s = seen[usable], elapsed_s[usable]
    by_bias = -np.swapaxes(R[:-1], 1, 2)[usable] * elapsed_s[:, None, None]
    off, bias = np.eye(3), np.zeros(3)
    prior = np.diag([_FREE_RAD**-2] * 3 + [_FREE_RATE**-2] * 3)
    for _ in range(10):
        believed = (by_imu + by_bias @ bias) @ off
        left = seen - believed
        J = np.concatenate([cross(believed), np.swapaxes(off, 0, 1) @ by_bias], axis=2)
        size = np.linalg.norm(left, axis=1)
        weights = 1 / np.maximum(1, size / max(2 * np.median(size), 1e-9))
        variance = float((weights * size**2).sum() / max(3 * weights.sum() - 6, 1)) + 1e-14
        information = np.einsum("n,nki,nkj->ij", weights, J, J) / variance + prior
        slope = np.einsum("n,nki,nk->i", weights, J, left) / variance
        believed_off = np.concatenate([rotation_vectors(off[None])[0], bias])
        step = np.linalg.solve(information, slope - prior @ believed_off)
        off, bias = off @ turn(step[:3]), bias + step[3:]
    covariance = np.linalg.inv(information)[:3, :3]
    vector = rotation_vectors(off[None])[0]
    return MountingCheck(
        "the camera relative to the IMU", np.rad2deg(vector), np.rad2deg(np.rad2deg(covariance))
    )


def _integrated(gyro: Gyro, stamps_ns: npt.NDArray[np.int64]) -> tuple[Floats, Floats]:
    """(N - 1, 3, 3) rotations of the IMU between views, NaN across gaps; and seconds."""
    turns = np.full((len(stamps_ns) - 1, 3, 3), np.nan)
    elapsed_s = np.diff(stamps_ns) / 1e9
    for view, (start, end) in enumerate(pairwise(stamps_ns)):
        first, last = np.searchsorted(gyro.stamps_ns, (start, end))
        if first == 0 or last >= len(gyro.stamps_ns) or elapsed_s[view] > _LONGEST_S:
            continue
        times = np.concatenate([[start], gyro.stamps_ns[first:last], [end]])
        rates = np.stack(
            [np.interp(times, gyro.stamps_ns, column) for column in gyro.rates_xyz.T], axis=1
        )
        steps = np.diff(times)[:, None] / 1e9 * (rates[:-1] + rates[1:]) / 2
        R = np.eye(3)
        for step in turn(steps):
            R = R @ step
        turns[view] = R
    return turns, elapsed_s
