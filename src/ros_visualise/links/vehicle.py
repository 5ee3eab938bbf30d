"""A vehicle at the other end of a link: heartbeats, its clock, and what passes both ways."""

from __future__ import annotations

import logging
import struct
import threading
import time
from collections import Counter, deque
from collections.abc import Callable
from typing import Any

from ros_visualise.core.errors import UsageError
from ros_visualise.data import Header, PoseWithCovarianceStamped, Text
from ros_visualise.links import guidance
from ros_visualise.links.commands import Commander, Step, check_permission
from ros_visualise.links.line import MavlinkLine, line_at
from ros_visualise.links.mavlink import dialect
from ros_visualise.links.telemetry import FROM_ANY, Answer, Telemetry
from ros_visualise.links.wires import Peer

log = logging.getLogger(__name__)

_STAMP = struct.Struct(">Q")  # microseconds since 1970
COMPONENT = 191
"""MAV_COMP_ID_ONBOARD_COMPUTER."""
_AUTOPILOT, _INVALID = 1, 8
_ONBOARD, _ACTIVE = 18, 4
_SPEAK_S = 1.0
_LOST_S = 3.0
_MOST_WARNINGS = 100
_NEEDED = {"ATTITUDE": 50.0, "LOCAL_POSITION_NED": 30.0, "GLOBAL_POSITION_INT": 5.0}
"""Messages -> their rates, Hz, if they do not come by themselves."""
_SET_INTERVAL, _MOST_ASKED = 511, 5
_KEPT = 2_000  # messages that nobody has taken
_ARMED = 128
_WARNING, _INFO = 4, 6
_MOST_TEXT = 50
_SLOW_NS = 500_000_000  # round trip of a time that is not used


class ClockOffset:
    """Offset of the vehicle's clock, by the quickest of the last round trips of TIMESYNC.

    Attributes:
        offset_ns: our time minus the vehicle's, since its start; None: unknown.
        round_trip_ns: of the round trip that it is from.
    """

    def __init__(self) -> None:
        self.offset_ns: int | None = None
        self.round_trip_ns = 0
        self._trips: deque[tuple[int, int]] = deque(maxlen=10)

    def answer(self, theirs_ns: int, sent_ns: int, now_ns: int) -> None:
        """Take the answer to a request."""
        round_trip_ns = now_ns - sent_ns
        if 0 <= round_trip_ns < _SLOW_NS and theirs_ns > 0:
            self._trips.append((round_trip_ns, (sent_ns + now_ns) // 2 - theirs_ns))
            self.round_trip_ns, self.offset_ns = min(self._trips)

    def forget(self) -> None:
        """The vehicle was started again, perhaps."""
        self._trips.clear()
        self.offset_ns = None


class Vehicle:
    """One vehicle, followed in the thread of its line.

    It is bound to the address that its heartbeats come from: until they are lost, the same system
    at another address is ignored, as it may be forged.

    Args:
        address: see `ros_visualise.links.wires`; several vehicles may share it.
        system: number of the vehicle; 0: the first that is heard, and nobody else follows.

    Attributes:
        autopilot: MAV_AUTOPILOT; None: unknown yet.
        mode: its name; empty: unknown.
        armed: if its motors may turn.
        lost: was heard, and is no longer.
        counts: damaged bytes, messages and so on.
    """

    def __init__(self, address: str, system: int) -> None:
        self._dialect = dialect()
        self.address, self.system = address, system
        self.autopilot: int | None = None
        self.mode = ""
        self.armed = self.lost = False
        self.clock = ClockOffset()
        self.counts: Counter[str] = Counter()
        self.telemetry = Telemetry()
        self._sending = threading.Lock()
        self._sender = self._dialect.MAVLink(None, system or 1, COMPONENT)
        self._peer: Peer = None
        self._answers: deque[Answer] = deque(maxlen=_KEPT)
        self._raw: deque[bytes] = deque(maxlen=_KEPT)
        self._heard_s = self._spoke_s = 0.0
        self._resets = 0
        self._heard_kinds: Counter[str] = Counter()
        self._asked = 0
        self._warned: set[str] = set()
        self._commander = Commander(self._send, self._tell)
        self._line = line_at(address)
        self._line.join(self)

    def take(self) -> list[Answer]:
        """Outputs and messages that came since."""
        found = []
        while self._answers:
            found.append(self._answers.popleft())
        return found

    def take_raw(self) -> bytes:
        """The frames that came and went since, each after its time, as in a ``.tlog`` file."""
        found = []
        while self._raw:
            found.append(self._raw.popleft())
        return b"".join(found)

    def send_target(self, target: PoseWithCovarianceStamped, stamp_ns: int | None) -> bool:
        """Send a landing target; false if this autopilot takes none, or the vehicle is away.

        ``stamp_ns`` is its time by the wall clock; None: unknown.
        """
        return self._guide(
            lambda autopilot: guidance.landing_target(target, autopilot, self.telemetry, stamp_ns)
        )

    def send_pose(
        self, pose: PoseWithCovarianceStamped, stamp_ns: int | None, jumped: bool
    ) -> bool:
        """Send a pose of the body; ``jumped``: it does not continue the one before."""
        resets = (self._resets + jumped) % 256
        is_sent = self._guide(
            lambda autopilot: guidance.body_pose(pose, autopilot, stamp_ns, resets)
        )
        self._resets = resets if is_sent else self._resets
        return is_sent

    def order(self, name: str, steps: Callable[[int], list[Step]]) -> None:
        """Command the vehicle; ``steps`` makes the steps for its autopilot.

        Raises:
            UsageError: not permitted, or the vehicle is away or takes no such commands.
        """
        check_permission()
        if self.autopilot is None or self.lost:
            raise UsageError(f"{name}: {self.state}")
        if self.autopilot not in (guidance.PX4, guidance.ARDUPILOT):
            raise UsageError(f"{name}: autopilot {self.autopilot} is neither PX4 nor ArduPilot")
        self._commander.system = self.system
        self._commander.begin(name, steps(self.autopilot))

    def say(self, text: str, is_warning: bool) -> None:
        """Show a text to the person at the ground station."""
        severity = _WARNING if is_warning else _INFO
        self._send(self._dialect.MAVLink_statustext_message(severity, text.encode()[:_MOST_TEXT]))

    @property
    def state(self) -> str:
        """Its state in a few words."""
        if self.autopilot is None:
            return f"no vehicle on {self.address}" + (self._line.error and f": {self._line.error}")
        if self.lost:
            return f"link to system {self.system} lost"
        return f"{self.mode or 'unknown mode'}, {'armed' if self.armed else 'disarmed'}"

    def close(self) -> None:
        """Follow it no more."""
        self._line.leave(self)

    def _guide(self, make: Any) -> bool:
        if self.autopilot is None or self.lost:
            return False
        if self.autopilot not in (guidance.PX4, guidance.ARDUPILOT):
            self._warn(
                f"autopilot {self.autopilot} is neither PX4 nor ArduPilot; sending it no guidance"
            )
            return False
        message = make(self.autopilot)
        if message is None:
            return False
        self._send(message)
        self.counts[message.get_type()] += 1
        return True

    def _send(self, message: Any) -> None:
        with self._sending:
            frame = message.pack(self._sender)
            self._sender.seq = (self._sender.seq + 1) % 256
            self._line.send(frame, self._peer)
        self._keep(frame)

    def hear(self, message: Any, line: MavlinkLine, peer: Peer) -> None:
        """Take a message of any system on the line."""
        system, component = message.get_srcSystem(), message.get_srcComponent()
        is_beat = message.get_type() == "HEARTBEAT" and component == _AUTOPILOT
        if is_beat and message.autopilot != _INVALID:
            self._notice(system)
        if not self.system or system != self.system or component == COMPONENT:
            return
        if peer != self._peer and not (self._is_free and is_beat):
            if not self._is_free:
                places = f"{_place(peer)}; the vehicle's address is {_place(self._peer)}"
                self._warn(f"ignoring system {system} at {places}")
            return
        self.counts["messages"] += 1
        self._heard_kinds[message.get_type()] += 1
        self._keep(message.get_msgbuf())
        if is_beat:
            self._peer = peer
            self._beat(message)
        elif message.get_type() == "TIMESYNC":
            self._synchronize(message)
        elif message.get_type() == "COMMAND_ACK" and component == _AUTOPILOT:
            self._commander.answer(message)
        elif component == _AUTOPILOT or message.get_type() in FROM_ANY:
            self._answers.extend(self.telemetry.take(message, self._stamp_ns(message)))

    def _keep(self, frame: bytes) -> None:
        self._raw.append(_STAMP.pack(_now_ns() // 1000) + frame)

    @property
    def _is_free(self) -> bool:
        """True if it may come from any address."""
        return self.autopilot is None or self.lost

    def _notice(self, system: int) -> None:
        """Follow the first vehicle that nobody else follows; name the others."""
        others = self._line.systems
        if not self.system and system not in others:
            self.system = self._sender.srcSystem = system
        elif system not in {*others, self.system}:
            self._warn(f"ignoring system {system}; already following system {self.system}")

    def _beat(self, message: Any) -> None:
        if self.lost or self.autopilot is None:
            self._asked = 0
            self._heard_kinds.clear()
            log.info("autopilot: system %d is %s", self.system, "back" if self.lost else "there")
            self.clock.forget()
        self.autopilot, self.lost = message.autopilot, False
        self._heard_s = time.monotonic()
        self.armed = bool(message.base_mode & _ARMED)
        self.mode = mode_name(message)

    def _synchronize(self, message: Any) -> None:
        now_ns = _now_ns()
        if message.tc1 == 0:
            self._send(self._dialect.MAVLink_timesync_message(now_ns, message.ts1))
        else:
            self.clock.answer(message.tc1, message.ts1, now_ns)

    def _stamp_ns(self, message: Any) -> int:
        """The time at which a message was measured, by our clock; else that of its arrival."""
        now_ns = _now_ns()
        since_us = 1000 * getattr(message, "time_boot_ms", 0) or getattr(message, "time_usec", 0)
        if self.clock.offset_ns is None or not since_us:
            return now_ns
        stamp_ns = int(since_us * 1000 + self.clock.offset_ns)
        return stamp_ns if abs(now_ns - stamp_ns) < _LOST_S * 1e9 else now_ns

    def watch(self) -> None:
        """Notice the loss of the vehicle; send heartbeats."""
        now_s = time.monotonic()
        self.counts["damaged_bytes"] = self._line.damaged
        if self.autopilot is not None and not self.lost and now_s - self._heard_s > _LOST_S:
            self.lost = True
            self._commander.cancel("link lost")
            log.warning("autopilot: no heartbeat of system %d for %g s", self.system, _LOST_S)
        if now_s - self._spoke_s >= _SPEAK_S:
            self._spoke_s = now_s
            self._commander.watch()
            beat = self._dialect.MAVLink_heartbeat_message(_ONBOARD, _INVALID, 0, 0, _ACTIVE, 3)
            self._send(beat)
            if self.autopilot is not None:
                self._send(self._dialect.MAVLink_timesync_message(0, _now_ns()))
            if self.autopilot is not None and not self.lost:
                self._ask_for_telemetry()

    def _ask_for_telemetry(self) -> None:
        """Ask for what does not come by itself, as from many ports of ArduPilot, a few times."""
        self._asked += 1
        for name, rate in _NEEDED.items() if 2 < self._asked <= 2 + _MOST_ASKED else ():
            if not self._heard_kinds[name]:
                number = getattr(self._dialect, f"MAVLINK_MSG_ID_{name}")
                rest = 1e6 / rate, *[0.0] * 5
                self._send(
                    self._dialect.MAVLink_command_long_message(
                        self.system, _AUTOPILOT, _SET_INTERVAL, 0, number, *rest
                    )
                )

    def _tell(self, text: str, is_failure: bool) -> None:
        log.log(logging.WARNING if is_failure else logging.INFO, "autopilot: %s", text)
        self._answers.append(("text", Text(text, Header(_now_ns()))))

    def _warn(self, text: str) -> None:
        """Say it once; what others can cause without end is not kept without end."""
        if text not in self._warned and len(self._warned) < _MOST_WARNINGS:
            self._warned.add(text)
            log.warning("autopilot: %s", text)


def mode_name(heartbeat: Any) -> str:
    """The vehicle's mode, as its ground stations call it; a number where it is unknown."""
    mode = heartbeat.custom_mode
    if heartbeat.autopilot == guidance.PX4:
        main, sub = mode >> 16 & 255, mode >> 24
        return _PX4_AUTO.get(sub, f"AUTO {sub}") if main == 4 else _PX4_MODES.get(main, str(mode))
    if heartbeat.autopilot == guidance.ARDUPILOT and heartbeat.type in _COPTERS:
        names = {one: enum.name for one, enum in dialect().enums["COPTER_MODE"].items()}
        return str(names.get(mode, mode)).removeprefix("COPTER_MODE_")
    return str(mode)


_COPTERS = (2, 3, 4, 13, 14, 15)
_PX4_MODES = {
    1: "MANUAL",
    2: "ALTCTL",
    3: "POSCTL",
    5: "ACRO",
    6: "OFFBOARD",
    7: "STABILIZED",
}
_PX4_AUTO = {
    2: "TAKEOFF",
    3: "LOITER",
    4: "MISSION",
    5: "RTL",
    6: "LAND",
    8: "FOLLOW ME",
    9: "PRECISION LAND",
}


def _place(peer: Peer) -> str:
    return "{}:{}".format(*peer) if peer else "no address"


def _now_ns() -> int:
    return time.time_ns()
