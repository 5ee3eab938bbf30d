"""The last seconds of what the robot measured itself: odometry, IMU, GPS."""

from __future__ import annotations

from dataclasses import dataclass, field

from ros_visualise.landmarks.navigation.gps import GpsBuffer, GpsNoise, correct
from ros_visualise.landmarks.navigation.imu import ImuBuffer, ImuIntervals, ImuNoise, by_imu
from ros_visualise.landmarks.navigation.motion import (
    OdometryNoise,
    OdometryStep,
    by_odometry,
    check_odometry,
    is_speed_known,
)
from ros_visualise.landmarks.navigation.odometer import OdometryBuffer
from ros_visualise.landmarks.navigation.propagation import Propagation

_MEMORY = 0.99  # how much of the doubt stays with each odometry
_TOO_MUCH = 0.2  # of the odometries


@dataclass(frozen=True)
class SensorNoise:
    """What the robot's own sensors do wrong."""

    odometry: OdometryNoise = field(default_factory=OdometryNoise)
    imu: ImuNoise = field(default_factory=ImuNoise)
    gps: GpsNoise = field(default_factory=GpsNoise)


class SensorBuffer:
    """What was measured, and how the robot goes on by it.

    Where an IMU is there, it carries the robot on and the odometry is compared; else the odometry
    carries it, as while nobody knows where the robot is, and so where down is.

    Attributes:
        odometer, imu, gps: see there.
        is_imu_refused: it contradicted the odometry for long, and is left out.
    """

    def __init__(self, noise: SensorNoise) -> None:
        self.noise = noise
        self.odometer, self.imu, self.gps = OdometryBuffer(), ImuBuffer(), GpsBuffer(noise.gps)
        self.is_imu_refused = False
        self._doubt = 0.0

    def has_imu(self, step: OdometryStep) -> bool:
        """Whether an IMU tells of that time."""
        return self._parts(step) is not None

    def newest(self, carried: Propagation, step: OdometryStep, is_located: bool) -> None:
        """Go on by a step that has just come; what does not fit is counted."""
        before = self.gps.used, self.gps.refused
        fits, used, refused = self.go(carried, step, is_located)
        self.gps.used, self.gps.refused = before[0] + used, before[1] + refused
        self._doubt = _MEMORY * self._doubt + (1 - _MEMORY) * (not fits)
        self.is_imu_refused = self.is_imu_refused or self._doubt > _TOO_MUCH

    def steps(self, from_ns: int, to_ns: int) -> list[OdometryStep]:
        """The motions from one time to another, as the odometry tells them."""
        return self.odometer.steps(from_ns, to_ns) if to_ns > from_ns else []

    def forget(self, before_ns: int) -> None:
        """Let go of what is older."""
        for one in (self.odometer, self.imu, self.gps):
            one.forget(before_ns)

    def go(
        self, carried: Propagation, step: OdometryStep, is_located: bool
    ) -> tuple[bool, int, int]:
        """Go on by a step: whether the IMU fits to it, and how many fixes did and did not."""
        parts = self._parts(step) if is_located and is_speed_known(carried) else None
        fits = parts is None or self._by_imu(carried, step, parts)
        if parts is None or not (fits or step.is_long):
            by_odometry(carried, step, self.noise.odometry)
        fixes = self.gps.between(step.from_ns, step.to_ns) if is_located else []
        used = sum(correct(carried, fix, step.to_ns, self.noise.gps) for fix in fixes)
        return fits, used, len(fixes) - used

    def _parts(self, step: OdometryStep) -> ImuIntervals | None:
        """What the IMU measured in that time."""
        return None if self.is_imu_refused else self.imu.between(step.from_ns, step.to_ns)

    def _by_imu(self, carried: Propagation, step: OdometryStep, parts: ImuIntervals) -> bool:
        """Go on by an IMU, unless an odometry without a gap contradicts; whether that fits."""
        before = carried.copy()
        carried.remember()
        by_imu(carried, parts, self.noise.imu)
        fits = step.is_guess or check_odometry(carried, step, self.noise.odometry)
        if not fits and not step.is_long:
            carried.become(before)
        return fits
