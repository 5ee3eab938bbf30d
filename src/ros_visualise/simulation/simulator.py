"""Simulation of a robot in a world: its sensors' messages in order of time."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ros_visualise.core.errors import OpenError, UsageError
from ros_visualise.data import Floats, Odometry, PoseStamped, PoseWithCovarianceStamped, Text, Twist
from ros_visualise.simulation import frames
from ros_visualise.simulation.attitude import Quat, Vector, from_yaw
from ros_visualise.simulation.camera_mount import CameraMount
from ros_visualise.simulation.description import describe
from ros_visualise.simulation.engine import load_mujoco
from ros_visualise.simulation.missions import SHAPES, Mission, read_mission
from ros_visualise.simulation.model import BuiltWorld, build_world, compile_model, standing_height
from ros_visualise.simulation.pad import Pad, PadParams, place_pad
from ros_visualise.simulation.robot import Robot
from ros_visualise.simulation.robots import ROBOTS
from ros_visualise.simulation.scenery import scenery
from ros_visualise.simulation.schedule import Schedule, SensorOutput, streams_of
from ros_visualise.simulation.sensors import Fitting, sensors_of
from ros_visualise.simulation.settings import RobotParams
from ros_visualise.simulation.wear import Wear
from ros_visualise.simulation.worlds import WORLDS

LATCHED = ("robot_description", "tf_static", "scenery")
"""Outputs published once, at the start."""

_SETTLING_S = 1.0  # before the start, so that the robot starts at rest


class Simulation:
    """One robot in one world. The physics advances while `run` is iterated.

    ``command``, ``goto``, ``add_mission`` and ``act`` may be called from any thread.

    Args:
        robot: one of `ros_visualise.simulation.robots.ROBOTS`.
        world: one of `ros_visualise.simulation.worlds.WORLDS`.
        seed: of all random errors; the same seed gives the same data.
        mission: a `Mission`, one of `SHAPES`, a YAML file's path, ``default``, or None: the robot
            stands and waits.
        settings: of the robot's class; None: the defaults.
        wants: True if an output has listeners; asked before each costly message.

    Raises:
        UsageError: no such robot or world.
        OpenError: no such mission, the pad collides with the robot, or MuJoCo is missing.
    """

    def __init__(
        self,
        robot: str,
        world: str = "field",
        seed: int = 0,
        mission: Mission | str | Path | None = None,
        settings: RobotParams | None = None,
        wants: Callable[[str], bool] = lambda output: True,
    ) -> None:
        kind, _ = ROBOTS.find(robot), WORLDS.find(world)
        self._name, self._world_name = robot, world
        self._mission = find_mission(mission, robot, world)
        self.settings = with_pad(settings or kind.params(), self._mission)
        start = build_world(world, pictures=False).start(robot)
        pad = place_pad(self.settings, start)
        wear = Wear.of(self.settings, seed)
        self.world: BuiltWorld = build_world(world, self.settings.camera, *pad, wear)
        self._model = compile_model(robot, self.world, self.settings)
        self._data = load_mujoco().MjData(self._model)
        self.pad: Pad | None = None
        if isinstance(self.settings, PadParams) and self.settings.pad:
            self.pad = Pad(self._model, self._data, self.settings)
        self.start_pose = self._set_down()
        self._robot: Robot = kind.make(self._model, self._data, self.settings, seed)
        self._step_ns: int = round(1e9 * self._model.opt.timestep)
        self._steps = 0
        self._orders: deque[Callable[[], None]] = deque()
        self._status = ""
        mount = CameraMount(self._model, self.settings, seed)
        self._fitting = Fitting(
            self._robot, self._model, self._data, self.settings, seed, mount, self.pad
        )
        self._streams = streams_of(self._fitting)
        self._schedule = Schedule(self._streams, wants)
        odom = frames.ODOM if self.settings.map_to_odom else frames.ODOM_START
        mounted = {n: place for one in sensors_of(self.settings) for n, place in one.frames.items()}
        fixed = frames.fixed_frames(self._model, mount, self.start_pose, odom, mounted)
        description = describe(self._model, fixed)
        self._latched = description, fixed, scenery(self._model, self.world.textures)
        self._delayed = self._mission if self.settings.mission_delay else None
        if self._mission is not None and self._delayed is None:
            self._robot.start(self._mission)

    @property
    def time_ns(self) -> int:
        """Simulated time since the start."""
        return self._steps * self._step_ns

    @property
    def finished(self) -> bool:
        """True after the mission has ended."""
        return self._delayed is None and self._robot.mission.finished

    @property
    def failure(self) -> str:
        """Reason of a failure of mission or robot, or empty."""
        return self._robot.mission.failure

    @property
    def lands_visually(self) -> bool:
        """True while the robot needs `see`: it searches for a landing target or lands on it."""
        return self._robot.lands_visually

    @property
    def upright(self) -> bool:
        """False after the robot has tipped over."""
        return not self._robot.tip_over.detected

    @property
    def doing(self) -> str:
        """The robot's present activity, in a few words."""
        return self._robot.doing

    @property
    def actions(self) -> tuple[str, ...]:
        """Names for `act`."""
        return (*self._robot.actions, "start_mission")

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of all outputs with these settings."""
        return (*LATCHED, "status", "tf", *(stream.output for stream in self._streams))

    def run(self) -> Generator[SensorOutput, None, None]:
        """The messages as (stamp_ns, name, message), endless; call it from one thread.

        The `LATCHED` ones come first; ``status``, the robot's activity, whenever it changes. After
        closing, another call continues from that time.
        """
        for name, message in zip(LATCHED, self._latched, strict=True):
            yield SensorOutput(0, name, message)
        step, model, data = load_mujoco().mj_step, self._model, self._data
        control, schedule, orders = self._robot.control, self._schedule, self._orders
        try:
            while True:
                while orders:
                    self._obey(orders.popleft())
                stamp_ns = self._steps * self._step_ns
                self._start_delayed(stamp_ns)
                if self.pad is not None:
                    self.pad.advance(stamp_ns / 1e9)
                control(stamp_ns / 1e9)
                step(model, data)
                self._steps += 1
                if schedule.due_ns <= stamp_ns:
                    yield from schedule.take(stamp_ns)
                    yield from self._tell_change(stamp_ns)
        finally:
            self.close()

    def _start_delayed(self, stamp_ns: int) -> None:
        """Start the mission that waits, when it is time."""
        if self._delayed is not None and stamp_ns >= self.settings.mission_delay * 1e9:
            self._robot.start(self._delayed)
            self._delayed = None

    def _tell_change(self, stamp_ns: int) -> Iterator[SensorOutput]:
        if self.doing != self._status:
            self._status = self.doing
            yield SensorOutput(stamp_ns, "status", Text(self._status))

    def command(self, twist: Twist) -> None:
        """Follow a velocity until ``command_timeout`` has passed; this ends a mission.

        Raises:
            UsageError: it is not finite.
        """
        _check_finite("a velocity", twist.linear_xyz, twist.angular_xyz)
        self._steer(lambda: self._robot.command(twist, self.time_ns / 1e9))

    def goto(self, goal: PoseStamped) -> None:
        """Go to a pose in ``map``; this ends a mission.

        A flying robot keeps its height for a goal on the ground plane, as sent by rviz's tool.

        Raises:
            UsageError: the pose is in another frame, or not finite, or the robot has tipped over.
        """
        self._check_upright()
        _check_finite("a goal", goal.position_xyz, goal.quat_xyzw)
        if goal.header.frame_id not in ("", frames.MAP):
            raise UsageError(f"goals must be in the frame map, not {goal.header.frame_id}")
        self._steer(lambda: self._robot.go_to(goal))

    def see(self, target: Odometry) -> None:
        """Process the observed pose of the landing target, in the frame of the robot's odometry.

        Its age follows from its stamp. It is ignored without a mission that lands on a target.
        """
        self._orders.append(lambda: self._robot.see(target))

    def localize(self, pose: PoseWithCovarianceStamped) -> None:
        """Process a navigator's estimate of the robot's pose, used under ``control=estimate``.

        Raises:
            UsageError: the pose is in another frame than ``map``, or not finite.
        """
        _check_finite("a pose", pose.position_xyz, pose.quat_xyzw)
        if pose.header.frame_id != frames.MAP:
            raise UsageError(f"poses must be in the frame map, not {pose.header.frame_id}")
        self._orders.append(lambda: self._robot.localize(pose, self.time_ns))

    def add_mission(self, mission: Mission | str | Path) -> None:
        """Start another mission now.

        Raises:
            OpenError: no such mission.
            UsageError: the robot has tipped over, or there is no pad to land on.
        """
        self._check_upright()
        found = find_mission(mission, self._name, self._world_name)
        if found is not None and found.land_on and self.pad is None:
            raise UsageError("no pad to land on: set pad=true")
        self._mission = found
        if found is not None:
            self._steer(lambda: self._robot.start(found))

    def act(self, action: str) -> None:
        """Do one of `actions`.

        Raises:
            UsageError: no such action, no mission to start, or the robot has tipped over.
        """
        self._check_upright()
        mission = self._mission
        if action in self._robot.actions:
            self._steer(self._robot.actions[action])
        elif action != "start_mission":
            raise UsageError(f"no such action: {action!r}; choose from {', '.join(self.actions)}")
        elif mission is None:
            raise UsageError(f"no mission for the {self._name}: give one, such as lawn_mower")
        else:
            self._steer(lambda: self._robot.start(mission))

    def close(self) -> None:
        """Free the renderer; call it from the thread that ran `run`."""
        for close in self._fitting.closing:
            close()

    def _steer(self, order: Callable[[], None]) -> None:
        """Queue an order of the user, which takes the place of a mission that waits."""

        def instead() -> None:
            self._delayed = None
            order()

        self._orders.append(instead)

    def _obey(self, order: Callable[[], None]) -> None:
        if self.upright:
            order()

    def _check_upright(self) -> None:
        if not self.upright:
            raise UsageError(f"the {self._name} has tipped over; reset it")

    def _set_down(self) -> tuple[Vector, Quat]:
        """Put the robot at its start and let it come to rest there, motors off."""
        mujoco = load_mujoco()
        x, y, yaw = self.world.start(self._name)
        position, attitude = (x, y, standing_height(self._model)), from_yaw(yaw)
        self._data.qpos[:7] = (*position, *attitude)
        mujoco.mj_step(self._model, self._data, round(_SETTLING_S / self._model.opt.timestep))
        self._data.time = 0.0
        return position, attitude


def _check_finite(what: str, *arrays: Floats) -> None:
    if not all(np.isfinite(array).all() for array in arrays):
        raise UsageError(f"{what} must consist of finite numbers")


def find_mission(mission: Mission | str | Path | None, robot: str, world: str) -> Mission | None:
    """A mission by name: one of `SHAPES` where the world has room, ``default``, or a file.

    Raises:
        OpenError: no such mission.
        UsageError: no such world.
    """
    if mission is None or isinstance(mission, Mission):
        return mission
    if mission == "default":
        return ROBOTS.find(robot).default_mission(build_world(world, pictures=False))
    declared = WORLDS.find(world)
    if mission in SHAPES:
        center, size = declared.clear_area(str(mission))
        return Mission(str(mission), size, center, laps=0)
    return read_mission(mission, declared)


def with_pad(settings: RobotParams, mission: Mission | None) -> RobotParams:
    """The settings, with a pad if the mission lands on it.

    Raises:
        OpenError: the robot does not fly.
    """
    if mission is None or not mission.land_on:
        return settings
    if not isinstance(settings, PadParams):
        raise OpenError("land_on requires a flying robot: use the quadrotor")
    changes: dict[str, Any] = {"pad": True}
    return replace(settings, **changes)
