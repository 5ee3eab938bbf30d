"""A simulated robot as a source of messages, which can be paused and seeked like a recording."""

from __future__ import annotations

import logging
from collections.abc import Callable, Generator, Iterator, Mapping
from types import MappingProxyType
from typing import Any, TypeVar

from ros_visualise.core.declarations import action
from ros_visualise.core.errors import RosVisualiseError
from ros_visualise.data import (
    MarkerArray,
    PoseStamped,
    PoseWithCovarianceStamped,
    Text,
    Transforms,
    Twist,
)
from ros_visualise.messages.restamped import restamped
from ros_visualise.simulation.delivery import longest_delay_s
from ros_visualise.simulation.estimated_state import ControlPose
from ros_visualise.simulation.frames import prefixed
from ros_visualise.simulation.schedule import SensorOutput
from ros_visualise.simulation.sensors import equipped, outputs_of, sensors_of
from ros_visualise.simulation.settings import RobotParams, ScenarioParams
from ros_visualise.simulation.simulator import LATCHED, Simulation
from ros_visualise.sources.declarations import source
from ros_visualise.sources.playback import Playback

T = TypeVar("T")

log = logging.getLogger(__name__)

TARGET, ESTIMATE = "landing_target_odom", "estimate"
INPUTS = {"cmd_vel": Twist, "goal": PoseStamped, ESTIMATE: PoseWithCovarianceStamped}
OUTPUTS = {
    "tf": Transforms,
    "tf_static": Transforms,
    "robot_description": Text,
    "scenery": MarkerArray,
    "status": Text,
}
"""Outputs of every robot beside its sensors."""
HELD = (*LATCHED, "status")
"""Outputs whose last message is valid until the next."""

_NO_MISSION = "none"
_REST_NS = 3_000_000_000  # between missions
_FRAME = "image"  # the output to step by

Batch = tuple[SensorOutput, ...]
"""Messages published together."""


def simulated(
    name: str,
    params: type,
    velocity_axes: tuple[str, ...],
    inputs: Mapping[str, type] = MappingProxyType({}),
) -> Callable[[T], T]:
    """Declare the decorated class as the source that simulates a robot.

    Args:
        params: its world and mission, and the robot's settings; those of standard sensors are
            added. Its outputs are those of its sensors.
        velocity_axes: see `SourceType`.
        inputs: beside a velocity and a goal.
    """
    whole: type = equipped(params)
    return source(
        name,
        params=whole,
        inputs={**INPUTS, **inputs},
        outputs={**outputs_of(whole), **OUTPUTS},
        latched=HELD,
        makes_time=True,
        velocity_axes=velocity_axes,
    )


class SimulatedRobot:
    """Steps a simulation as its messages become due.

    To go back in time, it is simulated again from the start, without the commands of that time.

    Args:
        robot: one of `ros_visualise.simulation.robots.ROBOTS`.
        scenario: its world, mission and seed.
        settings: of the robot's class.
        playback: without viewers, it ends with the mission.

    Raises:
        OpenError: no such world or mission, or MuJoCo is missing.
    """

    duration_ns = None

    def __init__(
        self, robot: str, scenario: ScenarioParams, settings: RobotParams, playback: Playback
    ) -> None:
        mission = None if scenario.mission == _NO_MISSION else scenario.mission
        self._arguments = robot, scenario.world, scenario.seed, mission, settings
        self._tf_prefix, self._repeats = scenario.tf_prefix, scenario.repeat
        self._over_ns: int | None = None
        self._playback = playback
        self._origin_ns = playback.time_ns() if playback.has_played else 0  # after a restart
        period_s = 1 / min(settings.camera_rate, settings.lidar_rate)
        delay_s = longest_delay_s(sensors_of(settings), settings)
        self._look_back_ns = round(1e9 * (period_s + delay_s))
        self._sees = settings.camera
        self._needs_estimate = settings.control is ControlPose.ESTIMATE
        self._is_awaited: Callable[[str], bool] = lambda output: True
        self._timeout_ns = round(settings.command_timeout * 1e9)
        self._commanded: tuple[float, ...] | None = None
        self._commanded_ns = self._shift_ns = 0
        self._failure = ""
        self._ended: tuple[float, ...] | None = None
        self._sought_ns = 0
        self._simulation = self._make()

    def messages(self) -> Iterator[tuple[str, Any]]:
        """The sensors' messages as they become due, stamped with the time of the playback."""
        for stamp_ns, batch in self._playback.run(self, self._is_frame):
            for output in batch:
                self._shift_ns = stamp_ns - batch[-1].time_ns
                shift_ns = stamp_ns if output.name in HELD else self._shift_ns
                message = restamped(output.message, shift_ns)
                yield output.name, prefixed(message, self._tf_prefix)

    def read(self, start_ns: int) -> Generator[tuple[int, Batch], None, None]:
        """(Time since the start, messages), from a time on.

        The first batch holds the last message of each output until then, the image last.

        Raises:
            RosVisualiseError: the mission failed without viewers.
        """
        start_ns -= self._origin_ns
        simulation, self._over_ns = self._begin(start_ns), None
        shown: dict[str, SensorOutput] = {}
        for output in simulation.run():
            if output.time_ns <= start_ns:
                shown[output.name] = output
            else:
                yield from self._show(shown)
                yield output.time_ns + self._origin_ns, (output,)
            self._tell(simulation.failure)
            self._begin_again(simulation)
            if self._playback.closed or self._is_over():
                break
        yield from self._show(shown)
        if simulation.failure and self._is_over():
            raise RosVisualiseError(simulation.failure)

    def _is_over(self) -> bool:
        """True if the mission is over and there are no viewers."""
        return self._simulation.finished and not self._playback.holds

    def _begin_again(self, simulation: Simulation) -> None:
        """Restart a finished mission after a rest; reset a robot that has tipped over."""
        if not (self._repeats and simulation.finished):
            self._over_ns = None
        elif self._over_ns is None:
            self._over_ns = simulation.time_ns
        elif simulation.time_ns - self._over_ns > _REST_NS:
            self._over_ns = None
            simulation.act("start_mission") if simulation.upright else self.reset()

    def _tell(self, failure: str) -> None:
        """Log a failure once; if it ends the run, the error reports it."""
        if failure != self._failure and not self._is_over():
            self._failure = failure
            if failure:
                log.warning("%s", failure)

    def _show(self, shown: dict[str, SensorOutput]) -> Iterator[tuple[int, Batch]]:
        """Yield the messages that were held back."""
        batch = sorted(shown.values(), key=lambda output: (output.name == _FRAME, output.time_ns))
        shown.clear()
        if batch:
            yield batch[-1].time_ns + self._origin_ns, tuple(batch)

    def set_demand(self, is_wanted: Callable[[str], bool]) -> None:
        """Render and scan only outputs with listeners."""
        self._is_awaited = is_wanted

    def receive(self, port: str, message: Any) -> None:
        """Process a velocity (``cmd_vel``), a goal, or an estimated pose of target or robot.

        An action or a goal overrides the present velocity. If the same velocity keeps arriving, it
        is ignored until it changes or pauses.
        """
        if port == TARGET:
            self._simulation.see(restamped(message, -self._shift_ns))
        elif port == ESTIMATE:
            self._simulation.localize(restamped(message, -self._shift_ns))
        elif port != "cmd_vel":
            self._ended = self._commanded
            self._simulation.goto(message)
        elif not self._has_ended(message):
            self._simulation.command(message)

    def awaits(self, port: str) -> bool:
        """True for the landing target while it lands on one, and for the pose it steers by."""
        if port == ESTIMATE:
            return self._needs_estimate
        return port == TARGET and self._simulation.lands_visually

    def close(self) -> None:
        """Nothing to do: the renderer is freed with the messages."""

    def act(self, name: str) -> None:
        """Do an action of `Simulation.act`."""
        self._ended = self._commanded
        self._simulation.act(name)

    @action("stop the robot and abort its goal or mission")
    def stop(self) -> None:
        """Stop the robot."""
        self.act("stop")

    @action("start the mission from its beginning")
    def start_mission(self) -> None:
        """Start the mission."""
        self.act("start_mission")

    @action("put the robot back at its start and restart odometry and mission; time continues")
    def reset(self) -> None:
        """Put the robot back at its start."""
        self._playback.restart()

    def _has_ended(self, twist: Twist) -> bool:
        asked, time_ns = (*twist.linear_xyz, *twist.angular_xyz), self._simulation.time_ns
        if asked != self._ended or time_ns - self._commanded_ns > self._timeout_ns:
            self._ended = None
        self._commanded, self._commanded_ns = asked, time_ns
        return self._ended is not None

    def _begin(self, start_ns: int) -> Simulation:
        """The simulation to read from a time on: the current one, unless it is past that time."""
        self._sought_ns = start_ns
        if self._simulation.time_ns > max(start_ns, 0):
            self._simulation = self._make()
        return self._simulation

    def _make(self) -> Simulation:
        return Simulation(*self._arguments, self._is_wanted)

    def _is_wanted(self, output: str) -> bool:
        """True if a costly message is needed: while seeking, only near the requested time."""
        on_the_way = self._simulation.time_ns <= self._sought_ns - self._look_back_ns
        return not on_the_way and self._is_awaited(output)

    def _is_frame(self, batch: Batch) -> bool:
        return batch[-1].name == _FRAME or not (self._sees and self._is_awaited(_FRAME))
