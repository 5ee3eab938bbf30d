"""Filter of visual-inertial odometry: the IMU propagates the robot, corners correct it.

Each image adds the pose of its camera to the state as a view. Corners that are not seen any longer,
or from all views, tell of these views, and are used once. Some that last become points of the
state, and correct it in each image: so it does not drift while the robot hovers.

Source: A. Mourikis, S. Roumeliotis, A multi-state constraint Kalman filter for vision-aided
inertial navigation, ICRA 2007; M. Li, A. Mourikis, Optimization-based estimator design for
vision-aided inertial navigation, RSS 2012.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.imu import GYRO, ImuBuffer, ImuNoise, propagate_by_imu
from ros_visualise.estimation.inertial.jumps import jump_of, largest_jump, turned
from ros_visualise.estimation.inertial.lens import (
    FOCAL,
    LensErrors,
    corrected,
    first_lens,
    values_of,
)
from ros_visualise.estimation.inertial.readout import GLOBAL, READOUT_WALK, Readout, slips_of
from ros_visualise.estimation.inertial.sliding import (
    CAMERA,
    CORE,
    LENS,
    MOTION,
    RATE_BIAS,
    READOUTS,
    SHAPE,
    VIEW,
    SlidingState,
    transfer,
)
from ros_visualise.estimation.inertial.tracks import (
    CornerNoise,
    CornerTracks,
    TriangulatedTracks,
    begin_points,
    chi_squared,
    correct_by_points,
    limit,
    project,
    together,
    triangulate,
)
from ros_visualise.estimation.resting import Indices
from ros_visualise.estimation.robot import POSE, RobotState
from ros_visualise.estimation.settings import CameraErrors
from ros_visualise.estimation.visual.bundle import Mask
from ros_visualise.geometry import se3
from ros_visualise.vision.tracking import Ids

_LEAST_VIEWS = 3  # of a corner
_MOST = 50  # corners in one correction
_MISFIT = 3.0  # standard deviations, of the residuals of a corner after a first correction
_LEAST, _AGREED = 6, 0.5  # corners, and their part of all, that agree
_FIRST_NOISE = 2.5  # times the usual noise, until it is known better
_GATE = 2.0  # standard deviations of a normal distribution, for the chi-squared test
_USUAL_FIT, _LEARNING, _MOST_NOISE = 0.009, 0.1, 4.0  # squares by row; part; times the usual noise
_LARGEST = 3.5  # standard deviations, of a correction of the robot
_STEPS = 3  # of a correction that changes much
_FITS = 1.0  # standard deviations of directions, below which it does not
_DEPTH = 0.3  # standard deviation of an inverse depth, as a fraction
_WEAK = 0.02  # 1/m, below which an inverse depth is as good as known: 2 mrad a decimetre
_STILL = 0.01  # m/s, of a robot at rest
_UNSTEADY = 5e-3  # s, by which the age of the attitude of a moving camera varies
_LOOSE_TILT, _LOOSE_SPEED = 0.05, 0.5  # rad and m/s
_CLOCK_WALK = 1e-4  # s/sqrt(s)
_USUAL_NOISE = CornerNoise(2e-3, 1.6e-3)
_USUAL_IMU = ImuNoise(5e-4, 5e-3, 0.01, 0.1, 5e-5, 5e-4)  # twice a good one, as the navigator's


@dataclass(frozen=True)
class InertialSettings:
    """Settings of `InertialFilter`.

    Attributes:
        noise: of directions of corners, rad.
        views, points: numbers of these in the state.
        imu, camera: errors of these.
        age_s: of the attitude of a moving camera on the robot, s.
        readout: of the camera.
    """

    noise: CornerNoise = _USUAL_NOISE
    views: int = 11
    points: int = 30
    imu: ImuNoise = _USUAL_IMU
    camera: CameraErrors = field(default_factory=CameraErrors)
    age_s: float = 0.03
    readout: Readout = GLOBAL


class InertialFilter:
    """See the module.

    Args:
        settings: see `InertialSettings`.
        imu: measurements.
        robot: the estimate at ``stamp_ns``.
        covariance: (15, 15) of pose, velocity and biases there.

    Attributes:
        state: see `SlidingState`.
        stamp_ns: its time.
        used: numbers of corners and points that corrected it at the last image.
        contradicted: True if most corners of the last image that had some did not fit it.
    """

    def __init__(
        self,
        settings: InertialSettings,
        imu: ImuBuffer,
        stamp_ns: int,
        robot: RobotState,
        covariance: Floats,
    ) -> None:
        self.settings, self.imu, self.stamp_ns = settings, imu, stamp_ns
        self.state = SlidingState(robot, np.zeros(CORE))
        self.state.P[:15, :15] = covariance
        errors = settings.camera
        turn = np.full(3, errors.turn_rad**2)
        self.state.P[CAMERA, CAMERA] = np.diag([errors.clock_s**2, *turn, settings.age_s**2])
        self.state.lens, self.state.P[LENS, LENS] = first_lens(settings.readout, errors)
        self.tracks = CornerTracks()
        self.point_ids: Ids = np.zeros(0, np.int64)
        self.used, self.contradicted = 0, False
        self._level, self._seen_ns = _FIRST_NOISE, 0

    @property
    def readout(self) -> Readout:
        """The estimate of the camera's readout."""
        row = READOUTS.start
        return Readout(float(self.state.lens[0]), float(np.sqrt(self.state.P[row, row])))

    @property
    def lens(self) -> LensErrors:
        """The estimated errors of focal length and distortion."""
        sigmas = np.sqrt(np.diag(self.state.P)[SHAPE])
        return LensErrors(self.state.lens[FOCAL:], sigmas)

    @property
    def noise(self) -> CornerNoise:
        """The noise of corners, by how well they fitted lately."""
        return self.settings.noise.scaled(self._level)

    def doubt(self) -> None:
        """Assume the largest noise of corners, until it is known better."""
        self._level = _MOST_NOISE

    def _learn(self, ratios: Floats) -> None:
        """Raise or lower the noise of corners: blur and noise make them worse."""
        if len(ratios) >= _LEAST:
            wanted = self._level * np.sqrt(np.median(ratios) / _USUAL_FIT)
            wanted = np.clip(wanted, 1.0, _MOST_NOISE)
            self._level += float(wanted - self._level) * _LEARNING

    @property
    def sigma(self) -> float:
        """Standard deviation of directions within a window."""
        white, walk = self.noise
        return float(np.sqrt(white**2 + walk**2 * self.settings.views / 3))

    # time

    def propagate(self, stamp_ns: int) -> bool:
        """Propagate to a time; False if the IMU has a gap."""
        if stamp_ns == self.stamp_ns:
            return True
        parts = self.imu.between(self.stamp_ns, stamp_ns)
        if parts is None:
            return False
        rates, force = self.imu.densities(stamp_ns)
        own = self.settings.imu
        noise = replace(own, gyro=max(own.gyro, rates), accel=max(own.accel, force))
        propagate_by_imu(self.state, parts, noise)
        self.state.settle()
        self._age((stamp_ns - self.stamp_ns) / 1e9)
        self.stamp_ns = stamp_ns
        return True

    def _age(self, seconds: float) -> None:
        """Let the errors of the camera change."""
        errors = self.settings.camera
        keep, noise = np.ones(5), np.zeros(5)
        noise[0] = (errors.clock_s > 0) * _CLOCK_WALK**2 * seconds
        if errors.turn_s:
            keep[1:4] = np.exp(-seconds / errors.turn_s)
            noise[1:4] = errors.turn_rad**2 * (1 - keep[1:4] ** 2)
        self.state.wander(keep, noise)
        if self.settings.readout.sigma_s:
            self.state.P[READOUTS, READOUTS] += np.eye(2) * READOUT_WALK**2 * seconds

    # rest

    def rest(self, stamp_ns: int) -> bool:
        """Propagate a robot at rest to a time; False if the IMU has a gap."""
        parts = self.imu.between(self.stamp_ns, stamp_ns)
        seconds = (stamp_ns - self.stamp_ns) / 1e9
        if parts is None or not self.propagate(stamp_ns):
            return False
        state, density = self.state, self.settings.imu.gyro
        times = np.array([one.seconds for one in parts])
        rates = times @ np.array([one.rates for one in parts]) / seconds
        off = rates - state.robot[GYRO]
        sigmas = np.repeat([_STILL, density / np.sqrt(seconds) + 1e-4], 3)
        columns = np.r_[MOTION, RATE_BIAS]
        residual = np.concatenate([-state.robot.v, off]) / sigmas
        state.correct(columns, np.diag(1 / sigmas), residual)
        return True

    # images

    def see(
        self,
        stamp_ns: int,
        ids: Ids,
        rays: Floats,
        T_base_camera: Floats,
        turning: Floats | None = None,
        rolling: Floats | None = None,
    ) -> bool:
        """Process an image; False if the IMU has a gap.

        Args:
            ids, rays: numbers (N,) of corners, in order, and directions (N, 2) at z = 1.
            T_base_camera: (4, 4) at that time, as far as it is known.
            turning: (3,) angular velocity of the camera on the robot, rad/s in its own axes.
            rolling: (N, 3) as in `SeenCorners`; None: all rows are read at once.
        """
        seconds = (stamp_ns - self._seen_ns) / 1e9
        rolling = np.zeros((len(rays), 3)) if rolling is None else rolling
        if not self.propagate(stamp_ns):
            return False
        rates = np.zeros(3) if turning is None else turning
        noise = np.zeros((6, 6))
        noise[3:, 3:] = np.diag((_UNSTEADY * rates) ** 2)
        self.state.see(T_base_camera, rates, noise)
        rolling = self._rolling(ids, rays, rolling, seconds)
        self.tracks.add(ids, rays, rolling, seconds)
        self._seen_ns = stamp_ns
        self.used = self._correct_by_points(ids, rays, slips_of(rolling))
        self._correct_by_tracks(ids)
        if len(self.state.R) >= self.settings.views:
            self._drop_view(0)
        return True

    def _rolling(self, ids: Ids, rays: Floats, rolling: Floats, seconds: float) -> Floats:
        """(N, 5) as for `slips_of`: velocities since the last view, and their parts by jumps."""
        moved = self.tracks.since_last(ids, rays, seconds)
        known = np.isfinite(moved)
        moved = np.where(known, moved, rolling[:, :2])
        rolling = np.column_stack([moved, rolling[:, 2:], np.zeros_like(moved)])
        if not known.any():
            return rolling
        jump = self._jump(ids, rays, rolling, seconds) / seconds
        rolling[:, 3:] = (turned(rays) @ jump) * moved.any(axis=1, keepdims=True)
        return rolling

    def _jump(self, ids: Ids, rays: Floats, rolling: Floats, seconds: float) -> Floats:
        """(3,) rotation of the camera since the last view that nothing explains, rad."""
        state, which = self.state, np.flatnonzero(np.isin(self.point_ids, ids))
        at = np.searchsorted(ids, self.point_ids[which])
        values = values_of(state.points[which], state.lens)[0]
        expected = transfer(state, which, values, len(state.R) - 1)[0][:, :2]
        seen = corrected(rays[at], slips_of(rolling[at]), state.lens)
        largest = largest_jump(self.settings.camera, seconds)
        return jump_of(expected, seen - expected, self.noise.white, largest)

    def _correct_by_points(self, ids: Ids, rays: Floats, slips: Floats) -> int:
        """Correct by the points in view, and forget the others; their number."""
        seen = np.isin(self.point_ids, ids)
        self._drop_points(~seen)
        if not len(self.point_ids):
            return 0
        at = np.searchsorted(ids, self.point_ids)
        every = np.arange(len(self.point_ids))
        self.state.drag_points(self.noise.walk)
        true = corrected(rays[at], slips[at], self.state.lens)
        good = correct_by_points(self.state, every, true, slips[at], self.noise.white)
        self._drop_points(~good)
        return int(good.sum())

    def _drop_points(self, gone: Mask) -> None:
        if gone.any():
            which = np.flatnonzero(gone)
            chosen = np.isin(self.tracks.ids, self.point_ids[which])
            self.tracks.forget(chosen)
            self.state.drop_points(which)
            self.point_ids = np.delete(self.point_ids, which)

    def _correct_by_tracks(self, ids: Ids) -> None:
        """Correct by corners that are lost, or seen from all views."""
        tracks, views = self.tracks, len(self.state.R)
        counts = tracks.counts
        is_lost = ~np.isin(tracks.ids, ids)
        is_point = np.isin(tracks.ids, self.point_ids)
        is_long = (counts >= min(self.settings.views, views)) & (views >= self.settings.views)
        chosen = np.flatnonzero((is_lost | is_long) & ~is_point & (counts >= _LEAST_VIEWS))
        if len(chosen) > _MOST:
            chosen = np.sort(chosen[np.argsort(-counts[chosen], kind="stable")[:_MOST]])
        if len(chosen):
            self._use(chosen, is_long & ~is_lost)
            tracks.forget(np.isin(np.arange(len(tracks.ids)), chosen))
        tracks.keep(~is_lost)

    def _use(self, chosen: Indices, lasting: Mask) -> None:
        """Correct by these corners, iterated; some of those that last become points."""
        own, state = self.settings, self.state
        raw, slips = self.tracks.seen[chosen], self.tracks.slips(chosen)
        error, step = np.zeros(len(state.P)), np.zeros(len(state.P))
        for n in range(_STEPS):
            error = error + step
            R, p = se3.moved(error[state.views].reshape(-1, VIEW), state.R, state.p)
            found = triangulate(R, p, corrected(raw, slips, state.lens + error[LENS]))
            projected = project(R, p, found, slips, self.noise).since(error[state.seeing])
            usable, chi2 = self._is_usable(found), chi_squared(state, projected)
            if not n:
                self._learn(chi2[usable] / projected.rows[usable])
            good = usable & (chi2 < limit(projected.rows, _GATE))
            if n:
                good &= found.misfit < _MISFIT * self.sigma
            self.contradicted = bool(good.sum() < _AGREED * usable.sum() and usable.sum() >= _LEAST)
            if good.sum() < _LEAST or self.contradicted:
                return
            gain, total = state.solve(state.seeing, *together(projected, good))
            step = total - error
            if np.median(found.misfit[good]) < _FITS * self.sigma:
                break
        sigmas = np.sqrt(np.diag(state.P)[:CORE])
        self.contradicted = bool((np.abs(total[:CORE]) > _LARGEST * sigmas + 1e-9).any())
        if self.contradicted:
            return
        state.apply(gain, total)
        self.used += int(good.sum())
        known = found.sigma * self.sigma < _DEPTH * found.points[:, 2]
        places = np.flatnonzero(known & good & lasting[chosen])[: own.points - len(self.point_ids)]
        if len(places):
            begin_points(state, found, projected, places, step[state.seeing])
            self.point_ids = np.concatenate([self.point_ids, self.tracks.ids[chosen[places]]])

    def _is_usable(self, found: TriangulatedTracks) -> Mask:
        """(F,) True for corners in front of the views, whose depth is known well enough."""
        sigma = found.sigma * self.sigma
        return np.isfinite(found.misfit) & ((sigma < _DEPTH * found.points[:, 2]) | (sigma < _WEAK))

    def _drop_view(self, which: int) -> None:
        hosted = np.flatnonzero(self.state.host == which)
        if len(hosted):
            self.state.rehost(hosted, len(self.state.R) - 1)
        self.state.drop_view(which)
        self.tracks.drop_view(which)

    def loosen(self) -> None:
        """Give velocity and tilt more room, and begin with new corners: these contradict it."""
        state = self.state
        for _ in range(len(state.R)):
            state.drop_points(np.arange(len(state.points)))
            state.drop_view(0)
        self.tracks, self.point_ids = CornerTracks(), self.point_ids[:0]
        at = se3.about_origin(state.robot.p)[:, 3:5]
        state.P[POSE, POSE] += _LOOSE_TILT**2 * at @ at.T
        state.P[MOTION, MOTION] += _LOOSE_SPEED**2 * np.eye(3)
        self.contradicted = False
