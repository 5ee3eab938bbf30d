"""A simulated vehicle at its end of links, which answers as PX4 does.

Ground stations, MAVSDK and companion computers find it, read its telemetry and parameters, command
it, and send it set points and landing targets. It takes no missions, and has no files.

Source: mavlink.io, the microservices and common messages; PX4 1.15, `MavlinkReceiver`, `Commander`.
"""

from __future__ import annotations

import math
import struct
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np

from ros_visualise.data import Floats, Imu, NavSatFix, Odometry, Twist
from ros_visualise.links.guidance import PX4
from ros_visualise.links.line import MavlinkLine, line_at
from ros_visualise.links.mavlink import dialect
from ros_visualise.links.px4_modes import (
    PARAMETERS,
    NedCommand,
    NedSetPoint,
    NedState,
    Px4Mode,
    Px4Modes,
)
from ros_visualise.links.px4_telemetry import OwnTelemetry
from ros_visualise.links.px4_vision import VisionAid, VisionPose
from ros_visualise.links.wires import Peer

RATES = {
    "SYS_STATUS": 1.0,
    "ATTITUDE": 50.0,
    "ATTITUDE_QUATERNION": 10.0,
    "LOCAL_POSITION_NED": 30.0,
    "ODOMETRY": 30.0,
    "GLOBAL_POSITION_INT": 10.0,
    "GPS_RAW_INT": 2.0,
    "HIGHRES_IMU": 50.0,
    "VFR_HUD": 4.0,
    "BATTERY_STATUS": 0.5,
    "EXTENDED_SYS_STATE": 2.0,
    "HOME_POSITION": 0.5,
}
"""Messages -> their rates, Hz, unless SET_MESSAGE_INTERVAL changes them."""

_QUADROTOR, _COMPONENT = 2, 1
_CUSTOM_ARMED, _CUSTOM = 0x81, 0x01  # base mode
_STANDBY, _ACTIVE = 3, 4
_ACCEPTED, _DENIED, _UNSUPPORTED = 0, 2, 3
_ON_GROUND, _IN_AIR, _TAKEOFF, _LANDING = range(1, 5)
_REAL32, _INT32 = 9, 6
_CAPABILITIES = 4 | 8 | 16 | 128 | 256 | 8192  # integers, bytewise parameters, set points, v2
_VERSION = 0x010F00FF  # 1.15.0
_SENSORS = 0x2F  # gyroscope, accelerometer, magnetometer, pressure, GPS
_PREARM = 0x10000000
_VOLTS_MV = 16_200
_WARNING = 4
_UNSUPPORTED_MISSION = 3
_LOCAL_NED, _BODY_NED = 1, 8
_RELATIVE = (3, 6, 10, 11)  # frames with heights above home or the ground
_ANYWHERE = 2**31 - 1  # of COMMAND_INT: not given
_SHORTEST_S = 0.005
_PAUSED_NS = 100_000_000  # longer without odometry, its clock stands still

Answers = Iterable[Any]


class Px4Vehicle:
    """A vehicle that is found on links; `measure` drives it.

    Args:
        addresses: see `ros_visualise.links.wires`.
        system: its number.
        has_gps: else it begins with EKF2_GPS_CTRL=0, and navigates by the poses that it is sent.

    Raises:
        OpenError: an address cannot be opened, or pymavlink is missing.
        UsageError: not an address.
    """

    def __init__(self, addresses: Sequence[str], system: int, has_gps: bool = True) -> None:
        self._dialect = dialect()
        self.system = system
        self._at_work = threading.RLock()
        self._sender = self._dialect.MAVLink(None, system, _COMPONENT)
        self._parameters = dict(PARAMETERS)
        if not has_gps:
            self._parameters["EKF2_GPS_CTRL"] = 0
        self._periods_s = {name: 1 / rate for name, rate in RATES.items()}
        self._measured_ns = self._beat_ns = 0
        self._said: set[str] = set()
        self.restart()
        self._lines: list[MavlinkLine] = []
        for address in addresses:
            self._lines.append(line_at(address))
            self._lines[-1].join(self)

    def restart(self) -> None:
        """Begin as if it were switched on: disarmed, where it is."""
        with self._at_work:
            self._own = OwnTelemetry()
            self._modes = Px4Modes(self._parameters, self.say)
            self._vision = VisionAid(self._parameters, self.say)
            self._due_s = dict.fromkeys(RATES, 0.0)

    def close(self) -> None:
        """Leave all links."""
        for line in self._lines:
            line.leave(self)

    @property
    def state(self) -> str:
        """Its mode, and if it is armed."""
        mode = self._modes.mode.name.lower().replace("_", " ")
        return f"{mode}, {'armed' if self._modes.armed else 'disarmed'}"

    def sense(self, message: Imu | NavSatFix) -> None:
        """Take a measurement of a sensor."""
        with self._at_work:
            self._own.sense(message)

    def measure(self, odometry: Odometry, yaw: float) -> Twist | None:
        """Take its odometry and send telemetry; the velocity to fly at, None while disarmed.

        The velocity is in level axes that turn with the heading: forward, left, up.

        Args:
            odometry: in a frame with z up.
            yaw: heading of that frame's x axis, from east to north, radians.
        """
        with self._at_work:
            own = self._own
            own.measure(odometry, yaw)
            if not self._has_gps:
                self._navigate_by_vision()
            self._measured_ns = time.monotonic_ns()
            command = self._modes.step(NedState(own.time_s, own.position, own.velocity, own.rpy[2]))
            own.home = self._modes.home
            for name, due_s in self._due_s.items():
                late_s = own.time_s - due_s
                if late_s >= 0 and math.isfinite(self._periods_s[name]):
                    period_s = self._periods_s[name]
                    self._due_s[name] = due_s + period_s if late_s < period_s else own.time_s
                    self._send(*self._named(name))
            return None if command is None else self._twist(command)

    @property
    def _has_gps(self) -> bool:
        return bool(self._parameters["EKF2_GPS_CTRL"])

    @property
    def _is_placed(self) -> bool:
        """True if it knows its position."""
        return self._own.is_known and (self._has_gps or self._vision.is_valid)

    def _navigate_by_vision(self) -> None:
        """Correct its odometry by the poses that it was sent; descend once they are too old."""
        own, vision = self._own, self._vision
        own.forget_earth()
        if vision.follow(own.time_s, own.position, own.rpy[2]):
            self._modes.lose_position()
        own.correct(vision.yaw, vision.turned, vision.shift)
        own.variances, own.resets = vision.variances, vision.resets

    def _see(self, m: Any) -> None:
        """Take a pose of ODOMETRY or VISION_POSITION_ESTIMATE."""
        if self._has_gps:
            return
        covariance, yaw = getattr(m, "pose_covariance", None), getattr(m, "yaw", 0.0)
        if covariance is None:
            covariance = m.covariance
        elif m.frame_id != _LOCAL_NED:
            self._say_once(f"odometry: frame {m.frame_id} unsupported")
            return
        else:
            w, x, y, z = m.q
            yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        stamp_us = getattr(m, "time_usec", getattr(m, "usec", 0))
        position = np.array([m.x, m.y, m.z])
        pose = VisionPose(position, yaw, np.array(covariance), m.reset_counter, stamp_us)
        vision = self._vision
        before, heading = vision.here, vision.yaw
        if vision.fuse(pose):
            self._modes.shift(vision.here - before, vision.yaw - heading)

    def _twist(self, command: NedCommand) -> Twist:
        c, s = math.cos(self._own.rpy[2]), math.sin(self._own.rpy[2])
        north, east, down = command.velocity.tolist()
        linear = np.array([c * north + s * east, s * north - c * east, -down])
        return Twist(linear, np.array([0.0, 0.0, -command.turn]), self._own.odometry.header)

    def say(self, text: str) -> None:
        """Show a text at ground stations."""
        self._send(self._dialect.MAVLink_statustext_message(_WARNING, text.encode()[:50]))

    def watch(self) -> None:
        """Send heartbeats."""
        now_ns = time.monotonic_ns()
        with self._at_work:
            if now_ns - self._beat_ns < 1e9:
                return
            self._beat_ns = now_ns
            main, sub = self._modes.mode.value
            is_armed = self._modes.armed or not self._modes.landed
            base, state = (_CUSTOM_ARMED, _ACTIVE) if is_armed else (_CUSTOM, _STANDBY)
            beat = self._dialect.MAVLink_heartbeat_message
            self._send(beat(_QUADROTOR, PX4, base, main << 16 | sub << 24, state, 3))

    def hear(self, message: Any, line: MavlinkLine, peer: Peer) -> None:
        """Answer a message."""
        handle = _HANDLERS.get(message.get_type())
        system = getattr(message, "target_system", 0)
        component = getattr(message, "target_component", 0)
        if handle is None or system not in (0, self.system) or component not in (0, _COMPONENT):
            return
        needs_estimate = message.get_type() in _BY_ESTIMATE
        with self._at_work:
            if self._own.is_known or not needs_estimate:
                self._send(*(handle(self, message) or ()), line=line, peer=peer)

    def _send(self, *messages: Any, line: MavlinkLine | None = None, peer: Peer = None) -> None:
        with self._at_work:
            for message in messages:
                frame = message.pack(self._sender)
                self._sender.seq = (self._sender.seq + 1) % 256
                for one in self._lines if line is None else (line,):
                    one.send(frame, peer)

    def _named(self, name: str) -> list[Any]:
        """The message of that name, if there is one now."""
        make = _OWN.get(name)
        found = self._own.message(name) if make is None else make(self)
        return [] if found is None else [found]

    def _status(self) -> Any:
        healthy = _SENSORS | (_PREARM if self._own.is_known else 0)
        return self._dialect.MAVLink_sys_status_message(
            _SENSORS | _PREARM, _SENSORS | _PREARM, healthy, 0, _VOLTS_MV, -1, 100, *[0] * 6
        )

    def _extended(self) -> Any:
        modes = {
            Px4Mode.TAKEOFF: _TAKEOFF,
            Px4Mode.LAND: _LANDING,
            Px4Mode.PRECISION_LAND: _LANDING,
        }
        flying = modes.get(self._modes.mode, _IN_AIR)
        return self._dialect.MAVLink_extended_sys_state_message(
            0, _ON_GROUND if self._modes.landed else flying
        )

    def _about(self) -> Any:
        none = [0] * 8
        return self._dialect.MAVLink_autopilot_version_message(
            _CAPABILITIES, _VERSION, 0, 0, 0, none, none, none, 0, 0, self.system
        )

    # microservices

    def _hear_beat(self, m: Any) -> None:
        self._modes.heard(self._own.time_s)

    def _synchronize(self, m: Any) -> Answers:
        if m.tc1 == 0:
            since_ns = min(time.monotonic_ns() - self._measured_ns, _PAUSED_NS)
            yield self._dialect.MAVLink_timesync_message(
                round(self._own.time_s * 1e9) + since_ns, m.ts1
            )

    def _list_parameters(self, m: Any) -> Answers:
        return map(self._parameter, sorted(self._parameters))

    def _read_parameter(self, m: Any) -> Answers:
        names = sorted(self._parameters)
        name = names[m.param_index] if 0 <= m.param_index < len(names) else m.param_id
        return [self._parameter(name)] if name in names else []

    def _set_parameter(self, m: Any) -> Answers:
        if m.param_id not in self._parameters:
            return []
        value = m.param_value
        if isinstance(self._parameters[m.param_id], int):
            value = struct.unpack("<i", struct.pack("<f", value))[0]
        if math.isfinite(value) and value >= 0:
            self._parameters[m.param_id] = value
        return [self._parameter(m.param_id)]

    def _parameter(self, name: str) -> Any:
        value, names = self._parameters[name], sorted(self._parameters)
        kind = _REAL32
        if isinstance(value, int):
            kind, value = _INT32, struct.unpack("<f", struct.pack("<i", value))[0]
        return self._dialect.MAVLink_param_value_message(
            name.encode(), value, kind, len(names), names.index(name)
        )

    def _list_mission(self, m: Any) -> Answers:
        """No items."""
        yield self._dialect.MAVLink_mission_count_message(
            m.get_srcSystem(), m.get_srcComponent(), 0, m.mission_type
        )

    def _refuse_mission(self, m: Any) -> Answers:
        result = 0 if m.get_type() == "MISSION_CLEAR_ALL" else _UNSUPPORTED_MISSION
        yield self._dialect.MAVLink_mission_ack_message(
            m.get_srcSystem(), m.get_srcComponent(), result, m.mission_type
        )

    # set points and targets

    def _follow_local(self, m: Any) -> None:
        if m.coordinate_frame == _BODY_NED:
            c, s = math.cos(self._own.rpy[2]), math.sin(self._own.rpy[2])
            along = [c * m.vx - s * m.vy, s * m.vx + c * m.vy, m.vz]
            self._follow(m, [math.nan] * 3, along)
        elif m.coordinate_frame == _LOCAL_NED:
            self._follow(m, [m.x, m.y, m.z], [m.vx, m.vy, m.vz])
        else:
            self._say_once(f"set point: frame {m.coordinate_frame} unsupported")

    def _follow_global(self, m: Any) -> None:
        place = self._place(m.lat_int * 1e-7, m.lon_int * 1e-7, m.alt, m.coordinate_frame)
        if place is not None:
            self._follow(m, place.tolist(), [m.vx, m.vy, m.vz])

    def _follow(self, m: Any, position: list[float], velocity: list[float]) -> None:
        """Take a set point; bits of the mask say which of its numbers are not given."""
        numbers = np.array([*position, *velocity, m.yaw, m.yaw_rate])
        numbers[[bool(m.type_mask & bit) for bit in (1, 2, 4, 8, 16, 32, 1024, 2048)]] = math.nan
        if not np.isinf(numbers).any() and not np.isnan(numbers[:6]).all():
            yaw, yaw_rate = numbers[6:].tolist()
            set_point = NedSetPoint(numbers[:3], numbers[3:6], yaw, yaw_rate)
            self._modes.set_point(self._own.time_s, set_point)

    def _take_target(self, m: Any) -> None:
        place = np.array([m.x, m.y, m.z])
        if not m.position_valid or m.frame != _LOCAL_NED:
            self._say_once(f"landing target: frame {m.frame} unsupported")
        elif np.isfinite(place).all():
            self._modes.target(self._own.time_s, place)

    @property
    def _here(self) -> tuple[float, float]:
        """Latitude and longitude, degrees."""
        latitude, longitude, _ = self._own.place(self._own.position)
        return latitude * 1e-7, longitude * 1e-7

    def _place(self, latitude: float, longitude: float, height: float, frame: int) -> Floats | None:
        """A place on the Earth as north, east, down; its height above sea or home by the frame."""
        if math.isinf(height):
            return None
        if frame in _RELATIVE:
            height += self._own.place(self._own.home)[2] / 1e3
        return self._own.ned(latitude, longitude, height)

    def _say_once(self, text: str) -> None:
        if text not in self._said:  # at most as many as there are frames
            self._said.add(text)
            self.say(text)

    # commands: each gives the reason for which it is denied, or empty

    def _obey(self, m: Any) -> Answers:
        is_int = m.get_type() == "COMMAND_INT"
        place = (m.x, m.y, m.z) if is_int else (m.param5, m.param6, m.param7)
        if is_int:
            level = [math.nan if one == _ANYWHERE else one * 1e-7 for one in place[:2]]
            place = *level, m.z
        numbers = [m.param1, m.param2, m.param3, m.param4, *place]
        command, result, reason = _COMMANDS.get(m.command), _UNSUPPORTED, ""
        if m.command in _FLYING and not self._may_fly(m.command):
            result, reason = _DENIED, "no position estimate"
        elif command is not None:
            reason = command(self, numbers, m.frame if is_int else 0)
            result = _DENIED if reason else _ACCEPTED
        if reason and m.command in _FLYING:
            self.say(f"Command {m.command} denied: {reason}")
        yield self._dialect.MAVLink_command_ack_message(
            m.command,
            result,
            target_system=m.get_srcSystem(),
            target_component=m.get_srcComponent(),
        )
        name = self._asked_for(m.command, numbers) if result == _ACCEPTED else ""
        yield from self._named(name)

    def _may_fly(self, command: int) -> bool:
        """False if a command needs a position that is unknown; it can always descend."""
        return self._is_placed or (self._own.is_known and command == _LAND)

    def _asked_for(self, command: int, numbers: list[float]) -> str:
        """Message that a command asks for, besides its acknowledgement."""
        fixed = {410: "HOME_POSITION", 520: "AUTOPILOT_VERSION"}
        return self._name_of(numbers[0]) if command == 512 else fixed.get(command, "")

    def _name_of(self, number: float) -> str:
        kind = self._dialect.mavlink_map.get(int(number)) if math.isfinite(number) else None
        return kind.msgname if kind is not None else ""

    def _arm(self, p: list[float], frame: int) -> str:
        if p[0] not in (0, 1):
            return "give 1 to arm, 0 to disarm"
        return self._modes.arm() if p[0] == 1 else self._modes.disarm()

    def _take_off(self, p: list[float], frame: int) -> str:
        if math.isnan(p[6]):
            return self._modes.enter(Px4Mode.TAKEOFF)
        place = self._place(*self._here, p[6], frame)
        return "invalid position" if place is None else self._modes.take_off(-float(place[2]))

    def _go_to(self, p: list[float], frame: int) -> str:
        level = self._here if np.isnan(p[4:6]).any() else (p[4], p[5])
        place = self._place(*level, p[6], frame)
        yaw = p[3] if math.isfinite(p[3]) else math.nan
        return "invalid position" if place is None else self._modes.go_to(place, yaw)

    def _change_mode(self, p: list[float], frame: int) -> str:
        return self._enter(int(p[1]), int(p[2])) if np.isfinite(p[1:3]).all() else "no such mode"

    def _set_mode(self, m: Any) -> None:
        self._enter(m.custom_mode >> 16 & 255, m.custom_mode >> 24)

    def _enter(self, main: int, sub: int) -> str:
        try:
            mode = Px4Mode((main, sub if main == Px4Mode.HOLD.value[0] else 0))
        except ValueError:
            return "no such mode"
        return self._modes.enter(mode)

    def _change_speed(self, p: list[float], frame: int) -> str:
        if not 0 < p[1] <= 20:
            return "invalid speed"
        self._parameters["MPC_XY_CRUISE"] = p[1]
        return ""

    def _set_interval(self, p: list[float], frame: int) -> str:
        name = self._name_of(p[0])
        if name not in self._periods_s or math.isnan(p[1]):
            return "no such message"
        period_s = max(p[1] * 1e-6, _SHORTEST_S) if p[1] else 1 / RATES[name]
        self._periods_s[name] = math.inf if p[1] < 0 else period_s
        return ""

    def _give_message(self, p: list[float], frame: int) -> str:
        return "" if self._named(self._name_of(p[0])) else "no such message"

    def _nothing(self, p: list[float], frame: int) -> str:
        return ""


def _entering(mode: Px4Mode) -> Callable[[Px4Vehicle, list[float], int], str]:
    return lambda vehicle, p, frame: vehicle._modes.enter(mode)


_OWN: dict[str, Callable[[Px4Vehicle], Any]] = {
    "SYS_STATUS": Px4Vehicle._status,
    "EXTENDED_SYS_STATE": Px4Vehicle._extended,
    "AUTOPILOT_VERSION": Px4Vehicle._about,
}
_COMMANDS: dict[int, Callable[[Px4Vehicle, list[float], int], str]] = {
    20: _entering(Px4Mode.RETURN),
    21: _entering(Px4Mode.LAND),
    22: Px4Vehicle._take_off,
    176: Px4Vehicle._change_mode,
    178: Px4Vehicle._change_speed,
    192: Px4Vehicle._go_to,
    400: Px4Vehicle._arm,
    410: Px4Vehicle._nothing,
    511: Px4Vehicle._set_interval,
    512: Px4Vehicle._give_message,
    520: Px4Vehicle._nothing,
}
"""MAV_CMD -> its method."""
_LAND = 21
_FLYING = (20, _LAND, 22, 176, 192, 400)
"""Commands that are denied without a position estimate."""
_HANDLERS: dict[str, Callable[[Px4Vehicle, Any], Answers | None]] = {
    "HEARTBEAT": Px4Vehicle._hear_beat,
    "TIMESYNC": Px4Vehicle._synchronize,
    "PARAM_REQUEST_LIST": Px4Vehicle._list_parameters,
    "PARAM_REQUEST_READ": Px4Vehicle._read_parameter,
    "PARAM_SET": Px4Vehicle._set_parameter,
    "MISSION_REQUEST_LIST": Px4Vehicle._list_mission,
    "MISSION_COUNT": Px4Vehicle._refuse_mission,
    "MISSION_CLEAR_ALL": Px4Vehicle._refuse_mission,
    "SET_MODE": Px4Vehicle._set_mode,
    "COMMAND_LONG": Px4Vehicle._obey,
    "COMMAND_INT": Px4Vehicle._obey,
    "SET_POSITION_TARGET_LOCAL_NED": Px4Vehicle._follow_local,
    "SET_POSITION_TARGET_GLOBAL_INT": Px4Vehicle._follow_global,
    "LANDING_TARGET": Px4Vehicle._take_target,
    "ODOMETRY": Px4Vehicle._see,
    "VISION_POSITION_ESTIMATE": Px4Vehicle._see,
}
_BY_ESTIMATE = (
    *("HEARTBEAT", "TIMESYNC", "LANDING_TARGET", "ODOMETRY", "VISION_POSITION_ESTIMATE"),
    *("SET_POSITION_TARGET_LOCAL_NED", "SET_POSITION_TARGET_GLOBAL_INT"),
)
"""Messages that are ignored without a position estimate."""
