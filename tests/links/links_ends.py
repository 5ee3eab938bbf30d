"""Vehicles of our own for the tests: pymavlink at the other end of a link."""

import math
import socket
import threading
import time
from contextlib import suppress

import numpy as np
import ports
from pymavlink.dialects.v20 import ardupilotmega as v2
from waiting import wait_for

from ros_visualise.data import Header, Odometry
from ros_visualise.geometry import rotations
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.links.px4 import RATES

ARDUPILOT, PX4 = 3, 12
OFFSET_NS = 40_000_000_000  # the vehicle was started so long before the time 0 of its clock


def free_port():
    return ports.free_port(socket.SOCK_DGRAM)


def udp_line(port):
    line = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    line.bind(("127.0.0.1", 0))
    line.connect(("127.0.0.1", port))
    line.settimeout(0.02)
    return line


class FakeVehicle:
    """Sends telemetry to a port over UDP, or to another line, answers TIMESYNC, and keeps what it
    is sent.

    ``line`` has `recv`, `send` and `close`; it raises TimeoutError without news.
    """

    def __init__(self, port=0, autopilot=PX4, system=1, garbage=b"", line=None):
        self.autopilot, self.system = autopilot, system
        self.heard = []
        self.is_quiet = self.is_mute = False  # mute: only heartbeats and answers
        self.results = {}  # command -> result, None: no answer; others are accepted
        self._garbage = garbage
        self._line = line or udp_line(port)
        self._mav = v2.MAVLink(None, system, 1)
        self._mav.robust_parsing = True
        self._started_ns = time.monotonic_ns()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def of(self, kind):
        """The messages of a kind that it was sent."""
        return [one for one in list(self.heard) if one.get_type() == kind]

    def send(self, message):
        with suppress(ConnectionError):  # nobody listens there, or no longer
            self._line.send(message.pack(self._mav))

    def close(self):
        self._stop.set()
        self._thread.join()
        self._line.close()

    def _now_ns(self):
        return time.monotonic_ns() - self._started_ns + OFFSET_NS

    def _run(self):
        beat_s = 0.0
        while not self._stop.is_set():
            self._listen()
            if self.is_quiet:
                continue
            if time.monotonic() > beat_s:
                beat_s = time.monotonic() + 0.5
                mode = 4 << 16 | 9 << 24 if self.autopilot == PX4 else 5
                self.send(v2.MAVLink_heartbeat_message(2, self.autopilot, 128, mode, 4, 3))
            if self.is_mute:
                continue
            ms = self._now_ns() // 1_000_000
            self.send(v2.MAVLink_attitude_message(ms, 0, 0, math.pi / 2, 0.1, 0.2, 0.3))
            self.send(v2.MAVLink_local_position_ned_message(ms, 20, 10, -5, 1, 2, -3))
            if self._garbage:
                self._line.send(self._garbage)

    def _listen(self):
        try:
            data = self._line.recv(65536)
        except (TimeoutError, ConnectionError):
            return
        for one in self._mav.parse_buffer(data) or []:
            self.heard.append(one)
            if one.get_type() == "TIMESYNC" and one.tc1 == 0:
                self.send(v2.MAVLink_timesync_message(self._now_ns(), one.ts1))
            if one.get_type() in ("COMMAND_LONG", "COMMAND_INT"):
                result = self.results.get(one.command, 0)
                if result is not None:
                    self.send(v2.MAVLink_command_ack_message(one.command, result))


class Flyer:
    """A body that follows velocities above flat ground, and the node that flies it."""

    def __init__(self, node, params, start=(0.0, 0.0, 0.0)):
        self.node, self.params = node, params
        self.at, self.velocity, self.yaw = np.array(start), np.zeros(3), 0.0
        self.modes = []
        self.drift = np.zeros(3)  # of its odometry
        self._frames, self._stamp_ns = FrameTree(), 0
        self._twist = None

    @property
    def ned(self):
        """North, east, down of its start; its odometry's x points east."""
        return np.array([self.at[1], self.at[0], -self.at[2]])

    def fly(self, seconds, until=lambda: False):
        """Let so much time pass; True as soon as something holds."""
        for _ in range(round(seconds / 0.02)):
            self._step()
            if until():
                return True
        return False

    def _step(self):
        self._stamp_ns += 20_000_000
        wanted, turn = np.zeros(3), 0.0
        if self._twist is not None:
            c, s = math.cos(self.yaw), math.sin(self.yaw)
            x, y, z = self._twist.linear_xyz
            wanted, turn = np.array([c * x - s * y, s * x + c * y, z]), self._twist.angular_xyz[2]
        self.velocity += 0.1 * (wanted - self.velocity)
        self.yaw += 0.02 * turn
        self.at += 0.02 * self.velocity
        if self.at[2] <= 0:
            self.at[2], self.velocity = 0.0, np.maximum(self.velocity * [0, 0, 1], 0)
        quat = rotations.from_rpy([0, 0, self.yaw])
        linear = rotations.to_matrix(quat).T @ self.velocity
        header = Header(self._stamp_ns, "odom")
        odom = Odometry(
            self.at + self.drift, quat, linear, child_frame_id="base_link", header=header
        )
        answer = self.node.step(self.params, odom=odom, frames=self._frames) or {}
        self._twist = answer.get("cmd_vel")
        if "mode" in answer:
            self.modes.append(answer["mode"].text)


class Station:
    """A ground station by pymavlink, which a vehicle sends to."""

    def __init__(self):
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.settimeout(0.02)
        self.port = self._socket.getsockname()[1]
        self._mav = v2.MAVLink(None, 255, 190)
        self._mav.robust_parsing = True
        self.heard, self._peer = [], None

    def send(self, message):
        if isinstance(message, bytes):
            self._socket.sendto(message, self._peer)
        else:
            self._socket.sendto(message.pack(self._mav), self._peer)

    def wait(self, kind, condition=lambda m: True):
        """The next message of a kind for which something holds."""

        def look():
            with suppress(TimeoutError):
                data, self._peer = self._socket.recvfrom(65536)
                found = self._mav.parse_buffer(data) or []
                self.heard += found
                return next((m for m in found if m.get_type() == kind and condition(m)), None)

        return wait_for(look, kind, sleep=lambda _: None)  # it waits for a datagram

    def command(self, number, *values):
        """The result of a command."""
        values = (*values, *[0.0] * (7 - len(values)))
        self.send(v2.MAVLink_command_long_message(1, 1, number, 0, *values))
        return self.wait("COMMAND_ACK", lambda m: m.command == number).result

    def hush(self):
        """Ask for no telemetry."""
        for name in RATES:
            number = getattr(v2, f"MAVLINK_MSG_ID_{name}")
            assert self.command(511, number, -1) == 0

    def catch_up(self):
        """Wait until all that was sent is handled."""
        self.command(510)

    def set_point(self, position=None, velocity=None, yaw=None, frame=1):
        mask = (0 if position else 7) | (0 if velocity else 56) | 448 | 2048
        mask |= 0 if yaw is not None else 1024
        both = *(position or (0, 0, 0)), *(velocity or (0, 0, 0))
        message = v2.MAVLink_set_position_target_local_ned_message
        self.send(message(0, 1, 1, frame, mask, *both, 0, 0, 0, yaw or 0, 0))
        self.catch_up()

    def target(self, position, frame=1):
        still = [1.0, 0.0, 0.0, 0.0]
        message = v2.MAVLink_landing_target_message
        self.send(message(0, 0, frame, 0, 0, 0, 0, 0, *position, still, 2, 1))
        self.catch_up()

    def texts(self):
        return [one.text for one in self.heard if one.get_type() == "STATUSTEXT"]

    def close(self):
        self._socket.close()
