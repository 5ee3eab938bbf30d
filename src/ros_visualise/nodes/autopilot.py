"""The node that connects a vehicle with PX4 or ArduPilot, by MAVLink."""

from __future__ import annotations

import logging
import math
import time
from collections import deque
from dataclasses import dataclass
from typing import Any

import numpy as np

from ros_visualise.core.declarations import action
from ros_visualise.core.params import param
from ros_visualise.data import (
    DiagnosticArray,
    DiagnosticStatus,
    Floats,
    Header,
    Level,
    Octets,
    PoseWithCovarianceStamped,
    Text,
    Transforms,
    TransformStamped,
)
from ros_visualise.geometry import rotations
from ros_visualise.geometry.aircraft import R_body_camera
from ros_visualise.links import commands
from ros_visualise.links.telemetry import BODY, OUTPUTS, Answer
from ros_visualise.links.vehicle import Vehicle
from ros_visualise.nodes import node

log = logging.getLogger(__name__)

_OURS = {"mode": Text, "mavlink": Octets, "diagnostics": DiagnosticArray, "tf_static": Transforms}
_FRAMES = {"tf": "/tf", "tf_static": "/tf_static"}
_SHOWN_S = 1.0
_SIGMAS = 3.0


@dataclass(frozen=True)
class AutopilotParams:
    """Parameters of `Autopilot`."""

    address: str = param(
        "udp://:14540",
        "address of the vehicle: udp://[HOST]:PORT to listen (without HOST on this machine alone),"
        " udpout://HOST:PORT, tcp://HOST:PORT, serial:///DEVICE:BAUD; read at the start",
        restart=True,
    )
    system: int = param(
        0, "MAVLink system of the vehicle; 0: the first one heard", min=0, max=255, restart=True
    )
    rate: float = param(20.0, "maximum rate of landing targets, Hz", min=1, max=100)
    pose_rate: float = param(50.0, "maximum rate of poses, Hz", min=1, max=200)
    timeout: float = param(
        0.5,
        "age after which a landing target or a pose is no longer sent, seconds",
        min=0.01,
        max=10,
    )
    simulated: bool = param(
        False, "stamps are simulated, so the age of targets and poses is not checked"
    )
    speed: float = param(
        15.0, "speed above which a change of pose counts as a relocalization, m/s", min=0.1, max=200
    )
    camera: str = param(
        "",
        "optical frame of a camera on the body, whose pose is published on tf_static; empty: none",
        restart=True,
    )
    camera_pitch: float = param(
        90.0,
        "angle of this camera below the horizon, degrees; 90: straight down, with the top of its"
        " image forward",
        min=-90,
        max=90,
        restart=True,
    )
    camera_x: float = param(
        0.0, "camera position, metres forward of the body's origin", min=-10, max=10, restart=True
    )
    camera_z: float = param(
        0.0, "camera position, metres above the body's origin", min=-10, max=10, restart=True
    )

    take_off_height: float = param(
        2.5, "take-off height, metres above the ground", min=0.5, max=100, group="control"
    )
    goal_x: float = param(
        0.0,
        "goal: metres east of the origin of odom",
        min=-1e4,
        max=1e4,
        slider=(-50, 50),
        group="control",
    )
    goal_y: float = param(
        0.0,
        "goal: metres north of the origin of odom",
        min=-1e4,
        max=1e4,
        slider=(-50, 50),
        group="control",
    )
    goal_z: float = param(
        2.5,
        "goal: metres above the origin of odom",
        min=-1e3,
        max=1e3,
        slider=(0, 50),
        group="control",
    )

    @property
    def goal(self) -> Floats:
        """The place to go to."""
        return np.array([self.goal_x, self.goal_y, self.goal_z])

    def time_of(self, message: PoseWithCovarianceStamped) -> int | None:
        """Its time by the wall clock, if it is known."""
        return None if self.simulated else message.header.stamp_ns

    @property
    def mounting(self) -> Transforms | None:
        """The place of the camera on the body, if there is one."""
        if not self.camera:
            return None
        R = R_body_camera(self.camera_pitch)
        at = np.array([self.camera_x, 0.0, self.camera_z])
        header = Header(time.time_ns(), BODY)
        return Transforms((TransformStamped(self.camera, at, rotations.from_matrix(R), header),))


@node(
    "autopilot",
    params=AutopilotParams,
    inputs={"landing_target": PoseWithCovarianceStamped, "pose": PoseWithCovarianceStamped},
    outputs={**OUTPUTS, **_OURS},
    topics={name: f"/autopilot/{name}" for name in (*OUTPUTS, *_OURS)} | _FRAMES,
    latched=("tf_static",),
    live=True,
    splittable=False,
)
class AutopilotLink:
    """Publishes what a vehicle measures, and sends it landing targets and the pose in the map.

    Targets of ``landing_target`` may be in any of its frames, and are sent in the one that the
    autopilot takes; those that are too old are not sent. Nothing arms the vehicle or changes its
    mode but the actions, and these only under ``--allow-control``.
    """

    def __init__(self, params: AutopilotParams) -> None:
        self._answers: deque[Answer] = deque()
        self._vehicle = Vehicle(params.address, params.system)
        self._mounting = params.mounting
        self._params = params
        self._forget()

    def _forget(self) -> None:
        self._target_s: float | None = None  # when the last one was sent
        self._pose_s = -math.inf
        self._last: PoseWithCovarianceStamped | None = None
        self._shown_s, self._state = -math.inf, ""
        self._stale = 0

    def reset(self) -> None:
        """Start over: time jumped."""
        self._last = None

    def step(
        self,
        params: AutopilotParams,
        landing_target: PoseWithCovarianceStamped | None = None,
        pose: PoseWithCovarianceStamped | None = None,
    ) -> None:
        """Send a target or a pose."""
        message = landing_target or pose
        if message is None or self._is_stale(message.header.stamp_ns, params):
            return
        if landing_target is not None:
            self._send_target(landing_target, params)
        elif pose is not None:
            self._send_pose(pose, params)

    def tick(self, params: AutopilotParams) -> dict[str, Any] | None:
        """The next messages of the vehicle, at most one for each output."""
        self._params = params
        self._notice_loss(params)
        self._answers.extend(self._vehicle.take())
        found: dict[str, Any] = {}
        while self._answers and self._answers[0][0] not in found:
            port, message = self._answers.popleft()
            found[port] = message
        if self._mounting is not None:
            found["tf_static"], self._mounting = self._mounting, None
        if raw := self._vehicle.take_raw():
            found["mavlink"] = Octets(np.frombuffer(raw, np.uint8), Header(time.time_ns()))
        return (found | self._news()) or None

    @action("arm, and take off to take_off_height")
    def take_off(self) -> None:
        """Arm and take off."""
        vehicle, height_m = self._vehicle, self._params.take_off_height
        vehicle.order("take-off", lambda a: commands.take_off(a, vehicle.telemetry, height_m))

    @action("land: on the landing target if one is seen, else here")
    def land(self) -> None:
        """Land."""
        on_target = self._target_s is not None
        self._vehicle.order("landing", lambda a: commands.land(a, on_target))

    @action("fly to goal_x, goal_y, goal_z")
    def go_to(self) -> None:
        """Go to a place."""
        vehicle, goal = self._vehicle, self._params.goal
        vehicle.order("go to", lambda a: commands.go_to(a, vehicle.telemetry, goal))

    @action("fly back to where it took off, and land there")
    def return_home(self) -> None:
        """Return."""
        self._vehicle.order("return", commands.return_home)

    @action("stop and hold the position")
    def hold(self) -> None:
        """Hold."""
        self._vehicle.order("hold", commands.hold)

    def finish(self) -> None:
        """Close the link."""
        self._vehicle.close()

    def report(self) -> dict[str, Any]:
        """Numbers of messages in and out, of damaged bytes, and of targets that were too old."""
        return {**self._vehicle.counts, "stale": self._stale}

    def _is_stale(self, stamp_ns: int, params: AutopilotParams) -> bool:
        age_ns = time.time_ns() - stamp_ns
        is_stale = not params.simulated and abs(age_ns) > params.timeout * 1e9
        if is_stale and not self._stale:
            log.warning(
                "autopilot: not sent: %.1f s old (further occurrences suppressed)", age_ns / 1e9
            )
        self._stale += is_stale
        return is_stale

    def _send_target(self, target: PoseWithCovarianceStamped, params: AutopilotParams) -> None:
        now_s = time.monotonic()
        if self._target_s is not None and now_s - self._target_s < 0.9 / params.rate:
            return
        if self._vehicle.send_target(target, params.time_of(target)):
            if self._target_s is None:
                self._vehicle.say("landing target found", is_warning=False)
            self._target_s = now_s

    def _send_pose(self, pose: PoseWithCovarianceStamped, params: AutopilotParams) -> None:
        now_s = time.monotonic()
        if now_s - self._pose_s < 0.9 / params.pose_rate:
            return
        if self._vehicle.send_pose(pose, params.time_of(pose), self._jumps(pose, params)):
            self._pose_s, self._last = now_s, pose

    def _notice_loss(self, params: AutopilotParams) -> None:
        if self._target_s is not None and time.monotonic() - self._target_s > 2 * params.timeout:
            self._target_s = None
            self._vehicle.say("landing target lost", is_warning=True)

    def _jumps(self, pose: PoseWithCovarianceStamped, params: AutopilotParams) -> bool:
        """True if a pose does not continue the last one: a relocalization."""
        last = self._last
        if last is None:
            return False
        elapsed_s = (pose.header.stamp_ns - last.header.stamp_ns) / 1e9
        sigma = math.sqrt(max(float(np.trace(pose.covariance[:3, :3])), 0.0))
        moved = float(np.linalg.norm(pose.position_xyz - last.position_xyz))
        return elapsed_s < 0 or moved > params.speed * elapsed_s + _SIGMAS * sigma

    def _news(self) -> dict[str, Any]:
        """The vehicle's state: once a second, and when it changes."""
        vehicle, now_s = self._vehicle, time.monotonic()
        state = vehicle.state
        if state == self._state and now_s - self._shown_s < _SHOWN_S:
            return {}
        has_changed, self._state, self._shown_s = state != self._state, state, now_s
        at = Header(time.time_ns())
        level = Level.ERROR if vehicle.lost else Level.OK
        if vehicle.autopilot is None:
            level = Level.STALE
        values = {"system": str(vehicle.system), "address": vehicle.address}
        if vehicle.clock.offset_ns is not None:
            values["clock_offset"] = f"{vehicle.clock.offset_ns / 1e9:.6f} s"
            values["round_trip"] = f"{vehicle.clock.round_trip_ns / 1e6:.1f} ms"
        values |= {name: str(count) for name, count in vehicle.counts.items()}
        status = DiagnosticStatus("autopilot", level, state, values)
        found: dict[str, Any] = {"diagnostics": DiagnosticArray((status,), at)}
        return found | ({"mode": Text(state, at)} if has_changed else {})
