"""The interface between simulator and robots."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, Protocol

import numpy as np

from ros_visualise.data import Floats, Odometry, PoseStamped, PoseWithCovarianceStamped, Twist
from ros_visualise.simulation.attitude import Quat, Vector
from ros_visualise.simulation.engine import load_mujoco
from ros_visualise.simulation.missions import Mission
from ros_visualise.simulation.model import BASE
from ros_visualise.simulation.monitoring import MissionMonitor, TipOverDetector


class BodyState(NamedTuple):
    """Pose and motion of the body: velocity in the world's axes, angular velocity in its own."""

    position: Vector
    attitude: Quat
    velocity: Vector
    rates: Vector

    @classmethod
    def of(cls, data: Any) -> BodyState:
        """The state of the robot's base in an ``mjData``."""
        x, y, z, qw, qx, qy, qz = data.qpos[:7].tolist()
        vx, vy, vz, p, q, r = data.qvel[:6].tolist()
        return cls((x, y, z), (qw, qx, qy, qz), (vx, vy, vz), (p, q, r))


class Body:
    """The true state of the robot's base in the physics, at the last step.

    MuJoCo keeps positions of bodies, velocities and sensors from before that step, so all of them
    belong to one time.
    """

    def __init__(self, model: Any, data: Any) -> None:
        self._mujoco, self._model, self.data = load_mujoco(), model, data
        self._id = model.body(BASE).id
        self._velocity = np.zeros(6)
        self._sites = {name: model.site(name).id for name in ("gps_link", "lidar_link")}

    @property
    def position(self) -> Vector:
        """Metres in ``map``."""
        x, y, z = self.data.xpos[self._id].tolist()
        return x, y, z

    @property
    def attitude(self) -> Quat:
        """R_map_body."""
        w, x, y, z = self.data.xquat[self._id].tolist()
        return w, x, y, z

    @property
    def axes(self) -> Floats:
        """R_map_body, 3x3."""
        return np.array(self.data.xmat[self._id]).reshape(3, 3)

    def velocity(self) -> tuple[Floats, Floats]:
        """Linear in m/s and angular in rad/s, (3,) each, in the body's axes."""
        kind = self._mujoco.mjtObj.mjOBJ_XBODY
        self._mujoco.mj_objectVelocity(self._model, self.data, kind, self._id, self._velocity, 1)
        both = self._velocity.copy()
        return both[3:], both[:3]

    def motion(self) -> Floats:
        """(6,) angular velocity and specific force at the IMU, in its axes."""
        sensed = self.data.sensordata
        return np.concatenate([sensed[3:6], sensed[:3]])

    def site(self, name: str) -> tuple[Floats, Floats]:
        """Pose of a sensor in ``map``: (3,) and 3x3."""
        number = self._sites[name]
        position = np.array(self.data.site_xpos[number])
        return position, np.array(self.data.site_xmat[number]).reshape(3, 3)


class Robot(Protocol):
    """A robot in its world. All methods are called by the thread that steps the physics.

    Attributes:
        body: its base in the physics.
        actions: name -> function.
        tip_over: after it detects a fall, the robot does nothing.
        mission: monitor of its mission.
        doing: its present activity, in a few words.
    """

    actions: Mapping[str, Callable[[], None]]
    tip_over: TipOverDetector
    body: Body
    mission: MissionMonitor

    @property
    def doing(self) -> str:
        """See above."""

    def control(self, time_s: float) -> None:
        """Set the actuators for the next step."""

    def command(self, twist: Twist, time_s: float) -> None:
        """Follow a velocity in the body's axes; this ends a mission."""

    def go_to(self, goal: PoseStamped) -> None:
        """Go to a pose in ``map``; this ends a mission."""

    def start(self, mission: Mission) -> None:
        """Start a mission."""

    def measure_odometry(self, stamp_ns: int) -> Odometry:
        """Odometry, called once in each of its periods."""

    @property
    def wheel_speed(self) -> float:
        """Forward speed by the rotation of the wheels, m/s; 0 without wheels."""
        return 0.0

    @property
    def lands_visually(self) -> bool:
        """True while it searches for a landing target or lands on it; False for ground robots."""
        return False

    def see(self, target: Odometry) -> None:
        """Process the observed pose of the landing target, in the frame of the robot's odometry."""

    def localize(self, pose: PoseWithCovarianceStamped, time_ns: int) -> None:
        """Process a navigator's estimate of its pose in ``map``, at a time."""
