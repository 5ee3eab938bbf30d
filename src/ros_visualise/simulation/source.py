"""A simulated robot as a source of messages: played, paused and sought like a recording."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from dataclasses import replace
from typing import Any

from ros_visualise.data import Header, Image, PoseStamped, Transforms, Twist
from ros_visualise.simulation.settings import RobotParams
from ros_visualise.simulation.simulator import Simulation
from ros_visualise.simulation.streams import Output
from ros_visualise.sources.playback import Playback

_NO_MISSION = "none"
_SAID_ONCE = ("robot_description", "tf_static")


class SimulatedRobot:
    """Steps a simulation as its messages become due.

    Its time begins anew where playing goes back; then what was asked of the robot is forgotten.

    Args:
        robot: ``husky`` or ``quadrotor``.
        world, mission, seed, settings: as of `Simulation`; the mission ``none`` is none.
        playback: how it is played; while nobody looks on, it ends with the mission.

    Attributes:
        wants: whether anybody listens to that output; None: to all of them.

    Raises:
        OpenError: no such world or mission, or MuJoCo is not there.
    """

    duration_ns = None
    wants: Callable[[str], bool] | None = None

    def __init__(
        self,
        robot: str,
        world: str,
        mission: str,
        seed: int,
        settings: RobotParams,
        playback: Playback,
    ) -> None:
        self._arguments = robot, world, seed, None if mission == _NO_MISSION else mission, settings
        self._playback = playback
        self._origin_ns = playback.time_ns() if playback.has_played else 0  # set down anew
        self._skipping = False
        self._simulation = self._make()

    def messages(self) -> Iterator[tuple[str, Any]]:
        """The sensors' messages as they become due, stamped with the time of the playback."""
        for stamp_ns, output in self._playback.run(self):
            yield output.name, restamped(output.message, stamp_ns - output.stamp_ns)

    def read(self, start_ns: int) -> Generator[tuple[int, Output], None, None]:
        """(Time since the start, message), from that time on.

        What lies before is not rendered; what is said but once comes at that time.
        """
        start_ns -= self._origin_ns
        simulation = self._begin(start_ns)
        for output in simulation.run():
            self._skipping = output.stamp_ns < start_ns
            if not self._skipping or output.name in _SAID_ONCE:
                yield max(output.stamp_ns, start_ns) + self._origin_ns, output
            if self._playback.closed or (simulation.finished and not self._playback.holds):
                return

    def command(self, twist: Twist) -> None:
        """Go with that velocity."""
        self._simulation.command(twist)

    def goto(self, goal: PoseStamped) -> None:
        """Go to a pose in ``map``."""
        self._simulation.goto(goal)

    def act(self, action: str) -> None:
        """Do what `Simulation.act` knows."""
        self._simulation.act(action)

    def _begin(self, start_ns: int) -> Simulation:
        """The simulation at a time: the present one, unless its time has passed."""
        if self._simulation.time_ns > max(start_ns, 0):
            self._simulation = self._make()
        return self._simulation

    def _make(self) -> Simulation:
        return Simulation(*self._arguments, self._is_wanted)

    def _is_wanted(self, output: str) -> bool:
        return not self._skipping and (self.wants is None or self.wants(output))


def restamped(message: Any, shift_ns: int) -> Any:
    """A message with its stamps moved."""
    if isinstance(message, Transforms):
        return Transforms(tuple(restamped(one, shift_ns) for one in message.transforms))
    header = Header(message.header.stamp_ns + shift_ns, message.header.frame_id)
    if isinstance(message, Image) and message.camera_info is not None:
        return replace(
            message, header=header, camera_info=replace(message.camera_info, header=header)
        )
    return replace(message, header=header)
