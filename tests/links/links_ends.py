"""Vehicles of our own for the tests: pymavlink at the other end of a link."""

import math
import socket
import threading
import time

from pymavlink.dialects.v20 import ardupilotmega as v2

ARDUPILOT, PX4 = 3, 12
OFFSET_NS = 40_000_000_000  # the vehicle was started so long before the time 0 of its clock


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


class FakeVehicle:
    """Sends telemetry to a port over UDP, answers TIMESYNC, and keeps what it is sent."""

    def __init__(self, port, autopilot=PX4, system=1, garbage=b""):
        self.autopilot, self.system = autopilot, system
        self.heard = []
        self.is_quiet = False
        self._garbage = garbage
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.settimeout(0.02)
        self._to = ("127.0.0.1", port)
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
        self._socket.sendto(message.pack(self._mav), self._to)

    def close(self):
        self._stop.set()
        self._thread.join()
        self._socket.close()

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
            ms = self._now_ns() // 1_000_000
            self.send(v2.MAVLink_attitude_message(ms, 0, 0, math.pi / 2, 0.1, 0.2, 0.3))
            self.send(v2.MAVLink_local_position_ned_message(ms, 20, 10, -5, 1, 2, -3))
            if self._garbage:
                self._socket.sendto(self._garbage, self._to)

    def _listen(self):
        try:
            data = self._socket.recv(65536)
        except (TimeoutError, ConnectionRefusedError):
            return
        for one in self._mav.parse_buffer(data) or []:
            self.heard.append(one)
            if one.get_type() == "TIMESYNC" and one.tc1 == 0:
                self.send(v2.MAVLink_timesync_message(self._now_ns(), one.ts1))
