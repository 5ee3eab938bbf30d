"""Commands of a person to a vehicle: take off, land, go to a place, return, hold.

A command is a sequence of messages, each sent when the one before is accepted. None is ever sent
unless the person who started the process permits it.

Source: mavlink.io, Command Protocol; PX4, Commander; ArduPilot, GCS_MAVLINK_Copter, whose modes
take them.
"""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

from ros_visualise.core.errors import UsageError
from ros_visualise.data import Floats
from ros_visualise.links.guidance import ARDUPILOT
from ros_visualise.links.mavlink import dialect
from ros_visualise.links.telemetry import Telemetry

_AGAIN_S, _TRIES = 1.0, 5
_ACCEPTED, _IN_PROGRESS = 0, 5
_ARM, _SET_MODE, _TAKE_OFF, _LAND, _RETURN, _REPOSITION = 400, 176, 22, 21, 20, 192
_CUSTOM, _CHANGE_MODE = 1.0, 1.0
_GUIDED, _LAND_MODE, _BRAKE = (4.0,), (9.0,), (17.0,)  # of ArduPilot's copters
_HOLD, _PRECISION_LAND = (4.0, 3.0), (4.0, 9.0)  # of PX4
_GLOBAL = 0
_is_permitted = False

Step = tuple[int, Sequence[float]]
"""A command's number, and its first parameters."""


def permit(allowed: bool) -> None:
    """Set if vehicles may be commanded by this process; it begins without."""
    global _is_permitted
    _is_permitted = allowed


def check_permission() -> None:
    """Raise UsageError unless vehicles may be commanded."""
    if not _is_permitted:
        raise UsageError(
            "commands to vehicles are not allowed here; start with --allow-control"
            " (ROS: allow_control:=true)"
        )


def take_off(autopilot: int, own: Telemetry, height_m: float) -> list[Step]:
    """Arm, and rise to a height above the ground."""
    if autopilot == ARDUPILOT:
        rise = (*[0.0] * 6, height_m)
        return [(_SET_MODE, (_CUSTOM, *_GUIDED)), (_ARM, (1.0,)), (_TAKE_OFF, rise)]
    altitude = math.nan if own.geodetic is None else float(own.geodetic[2]) + height_m
    return [(_ARM, (1.0,)), (_TAKE_OFF, (-1.0, 0.0, 0.0, *[math.nan] * 3, altitude))]


def land(autopilot: int, on_target: bool) -> list[Step]:
    """Land here, or on the landing target."""
    if autopilot == ARDUPILOT:  # on the target by PLND_ENABLED
        return [(_SET_MODE, (_CUSTOM, *_LAND_MODE))]
    if on_target:
        return [(_SET_MODE, (_CUSTOM, *_PRECISION_LAND))]
    return [(_LAND, (0.0, 0.0, 0.0, *[math.nan] * 4))]


def return_home(autopilot: int) -> list[Step]:
    """Fly back to where it took off, and land there."""
    return [(_RETURN, ())]


def hold(autopilot: int) -> list[Step]:
    """Stop, and hold the place."""
    return [(_SET_MODE, (_CUSTOM, *(_BRAKE if autopilot == ARDUPILOT else _HOLD)))]


def go_to(autopilot: int, own: Telemetry, goal_xyz: Floats) -> list[Step]:
    """Fly to a place in the frame of its odometry.

    Raises:
        UsageError: its own place is unknown, or not on the Earth.
    """
    place = own.on_earth(goal_xyz)
    if place is None:
        raise UsageError("the vehicle has no global position; it needs GPS to fly to a goal")
    first = [(_SET_MODE, (_CUSTOM, *_GUIDED))] if autopilot == ARDUPILOT else []
    return [*first, (_REPOSITION, (-1.0, _CHANGE_MODE, 0.0, math.nan, *place.tolist()))]


class Commander:
    """Sends the steps of one command at a time, again and again until each is answered.

    Args:
        send: sends a message.
        tell: takes a line on how a command went, and if that is a failure.

    Attributes:
        system: number of the vehicle.
    """

    def __init__(self, send: Callable[[Any], None], tell: Callable[[str, bool], None]) -> None:
        self.system = 0
        self._send, self._tell = send, tell
        self._name = ""
        self._steps: deque[Step] = deque()
        self._tries, self._sent_s = 0, 0.0
        self._at_work = threading.RLock()

    def begin(self, name: str, steps: Sequence[Step]) -> None:
        """Do this instead of what is not done yet."""
        with self._at_work:
            self._name, self._tries, self._steps = name, 0, deque(steps)
            self._send_step()

    def answer(self, ack: Any) -> None:
        """Take a COMMAND_ACK."""
        with self._at_work:
            if self._steps and ack.command == self._steps[0][0] and ack.result != _IN_PROGRESS:
                self._go_on(ack)

    def _go_on(self, ack: Any) -> None:
        if ack.result != _ACCEPTED:
            names = dialect().enums["MAV_RESULT"]
            result = names[ack.result].name if ack.result in names else str(ack.result)
            self._end(result.removeprefix("MAV_RESULT_").lower().replace("_", " "))
            return
        self._steps.popleft()
        self._tries = 0
        if self._steps:
            self._send_step()
        else:
            self._tell(f"{self._name}: accepted", False)

    def watch(self) -> None:
        """Send the present step again if it is time."""
        with self._at_work:
            if self._steps and time.monotonic() - self._sent_s > _AGAIN_S:
                self._send_step() if self._tries < _TRIES else self._end("no answer")

    def cancel(self, reason: str) -> None:
        """Forget what is not done yet."""
        with self._at_work:
            if self._steps:
                self._end(reason)

    def _end(self, reason: str) -> None:
        step = dialect().enums["MAV_CMD"][self._steps[0][0]].name
        self._steps.clear()
        self._tell(f"{self._name} failed: {step}: {reason}", True)

    def _send_step(self) -> None:
        number, given = self._steps[0]
        numbers = [*given, *[0.0] * (7 - len(given))]
        self._sent_s, confirmation = time.monotonic(), self._tries
        self._tries += 1
        if number != _REPOSITION:
            message = dialect().MAVLink_command_long_message
            self._send(message(self.system, 1, number, confirmation, *numbers))
            return
        x, y = (round(one * 1e7) for one in numbers[4:6])
        message = dialect().MAVLink_command_int_message
        self._send(message(self.system, 1, _GLOBAL, number, 0, 0, *numbers[:4], x, y, numbers[6]))
