"""The last seconds of the robot's own sensors: odometry, IMU, GPS."""

from __future__ import annotations

from dataclasses import dataclass, field

from ros_visualise.landmarks.navigation.gps import GpsBuffer, GpsNoise, correct
from ros_visualise.landmarks.navigation.imu import (
    ImuBuffer,
    ImuIntervals,
    ImuNoise,
    propagate_by_imu,
)
from ros_visualise.landmarks.navigation.motion import (
    OdometryNoise,
    OdometryStep,
    check_odometry,
    is_speed_known,
    propagate_by_odometry,
)
from ros_visualise.landmarks.navigation.odometer import OdometryBuffer
from ros_visualise.landmarks.navigation.propagation import Propagation

_MEMORY = 0.99  # smoothing of the rate of contradictions
_TOO_MUCH = 0.2  # of the odometry messages


@dataclass(frozen=True)
class SensorNoise:
    """Errors of the robot's own sensors."""

    odometry: OdometryNoise = field(default_factory=OdometryNoise)
    imu: ImuNoise = field(default_factory=ImuNoise)
    gps: GpsNoise = field(default_factory=GpsNoise)


class SensorBuffer:
    """The robot's measurements, and its propagation by them.

    With an IMU, the IMU propagates the robot and the odometry is compared with it. Otherwise the
    odometry does, also while the robot is not localized and the vertical is therefore unknown.

    Attributes:
        odometer, imu, gps: the buffers.
        is_imu_rejected: True after it contradicted the odometry for long.
    """

    def __init__(self, noise: SensorNoise) -> None:
        self.noise = noise
        self.odometer, self.imu, self.gps = OdometryBuffer(), ImuBuffer(), GpsBuffer(noise.gps)
        self.is_imu_rejected = False
        self._doubt = 0.0

    def has_imu(self, step: OdometryStep) -> bool:
        """True if there are IMU measurements of the whole step."""
        return self._parts(step) is not None

    def newest(self, propagation: Propagation, step: OdometryStep, is_located: bool) -> None:
        """Propagate by a new step, and count what does not fit."""
        before = self.gps.used, self.gps.rejected
        fits, used, rejected = self.propagate(propagation, step, is_located)
        self.gps.used, self.gps.rejected = before[0] + used, before[1] + rejected
        self._doubt = _MEMORY * self._doubt + (1 - _MEMORY) * (not fits)
        self.is_imu_rejected = self.is_imu_rejected or self._doubt > _TOO_MUCH

    def steps(self, from_ns: int, to_ns: int) -> list[OdometryStep]:
        """The odometry steps from one time to another."""
        return self.odometer.steps(from_ns, to_ns) if to_ns > from_ns else []

    def forget(self, before_ns: int) -> None:
        """Forget older measurements."""
        for one in (self.odometer, self.imu, self.gps):
            one.forget(before_ns)

    def propagate(
        self, propagation: Propagation, step: OdometryStep, is_located: bool
    ) -> tuple[bool, int, int]:
        """Propagate by a step; returns if the IMU agrees, and the fixes used and rejected."""
        parts = self._parts(step) if is_located and is_speed_known(propagation) else None
        fits = parts is None or self._by_imu(propagation, step, parts)
        if parts is None or not (fits or step.is_long):
            propagate_by_odometry(propagation, step, self.noise.odometry)
        fixes = self.gps.between(step.from_ns, step.to_ns) if is_located else []
        used = sum(correct(propagation, fix, step.to_ns, self.noise.gps) for fix in fixes)
        return fits, used, len(fixes) - used

    def _parts(self, step: OdometryStep) -> ImuIntervals | None:
        """The IMU's intervals during a step."""
        return None if self.is_imu_rejected else self.imu.between(step.from_ns, step.to_ns)

    def _by_imu(self, propagation: Propagation, step: OdometryStep, parts: ImuIntervals) -> bool:
        """Propagate by the IMU, unless a gapless odometry contradicts it; True if they agree."""
        before = propagation.copy()
        propagation.clone_pose()
        propagate_by_imu(propagation, parts, self.noise.imu)
        fits = step.is_guess or check_odometry(propagation, step, self.noise.odometry)
        if not fits and not step.is_long:
            propagation.restore(before)
        return fits
