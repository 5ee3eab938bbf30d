"""Latency of landing targets over MAVLink: from an image to LANDING_TARGET at the vehicle.

    python benchmarks/landmarks/mavlink_latency.py [--seconds 10]

A film of a landing, 640x480 at 30 Hz, made by the simulator, is played live as a user types it:
`video --landmarks --mavlink`. The vehicle is a socket of this process, over UDP: it says that it is
a PX4 that hovers, and takes the time when a LANDING_TARGET comes less its `time_usec`, which is the
time when its image was due. The nodes of the default pipeline run beside it. Figures of the first
second are left out. Beside other work, `chrt -r 5 python ...` measures the program alone.
"""

from __future__ import annotations

import argparse
import math
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ros_visualise.graph.landmarks import tags_of_world

PX4, ARMED = 12, 0x81
SIZE, RATE_HZ, FIELD_OF_VIEW = (640, 480), 30, 80.0
MISSION = "land_on: pad\nwaypoints: [[-3.5, 1.5, 5]]\nheight: 5\nspeed: 2\n"
START_S = 7.0  # of the flight: the pad is in sight


def run(*options: str) -> list[str]:
    """A command of this program."""
    return [sys.executable, "-m", "ros_visualise", *options, "--view", "none"]


def make_film(folder: Path, seconds: float) -> Path:
    """A film of the pad from above."""
    film, mission = folder / "pad.mp4", folder / "mission.yaml"
    mission.write_text(MISSION)
    options = ["sim", "quadrotor", "--world", "plane", "--mission", str(mission), "--rate", "0"]
    options += [
        "--start",
        f"{START_S:g}",
        "--duration",
        f"{seconds:g}",
        "--record",
        f"{film}@/image_raw",
    ]
    options += ["--set", f"quadrotor.camera_rate={RATE_HZ}"]
    subprocess.run(run(*options), check=True, capture_output=True)
    return film


def calibration(folder: Path) -> Path:
    """The camera's calibration."""
    width, height = SIZE
    f = width / 2 / math.tan(math.radians(FIELD_OF_VIEW / 2))
    K = [f, 0, width / 2 - 0.5, 0, f, height / 2 - 0.5, 0, 0, 1]
    path = folder / "camera.yaml"
    path.write_text(
        f"image_width: {width}\nimage_height: {height}\ncamera_name: camera\n"
        f"camera_matrix: {{rows: 3, cols: 3, data: {K}}}\ndistortion_model: plumb_bob\n"
        "distortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}\n"
        "rectification_matrix: {rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}\n"
        f"projection_matrix: {{rows: 3, cols: 4, data: {[*K[:3], 0, *K[3:6], 0, *K[6:], 0]}}}\n"
    )
    return path


class Hovering:
    """A vehicle that hovers."""

    def __init__(self, port: int) -> None:
        self._line = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._line.settimeout(0.005)
        self._to = ("127.0.0.1", port)
        self._codec = mavlink.MAVLink(None, 1, 1)
        self._codec.robust_parsing = True
        self._begin_ns = time.monotonic_ns() - 1_000_000_000

    def fly(self, process: subprocess.Popen[bytes]) -> list[float]:
        """Latencies of targets, seconds, until the process ends."""
        found, beat_ms, told_ms = [], 0, 0
        while process.poll() is None:
            now_ms = (time.monotonic_ns() - self._begin_ns) // 1_000_000
            if now_ms - beat_ms > 500:
                beat_ms = now_ms
                self._send(
                    mavlink.MAVLink_heartbeat_message(2, PX4, ARMED, 4 << 16 | 9 << 24, 4, 3)
                )
            if now_ms - told_ms >= 20:
                told_ms = now_ms
                self._send(mavlink.MAVLink_attitude_message(now_ms, 0, 0, 0, 0, 0, 0))
                self._send(mavlink.MAVLink_local_position_ned_message(now_ms, 0, 0, -4, 0, 0, 0))
            found += self._hear()
        return found

    def _hear(self) -> list[float]:
        try:
            data = self._line.recv(65536)
        except (TimeoutError, ConnectionRefusedError):
            return []
        now_ns, found = time.time_ns(), []
        for one in self._codec.parse_buffer(data) or []:
            if one.get_type() == "TIMESYNC" and one.tc1 == 0:
                self._send(
                    mavlink.MAVLink_timesync_message(time.monotonic_ns() - self._begin_ns, one.ts1)
                )
            elif one.get_type() == "LANDING_TARGET":
                found.append(now_ns / 1e9 - one.time_usec / 1e6)
        return found

    def _send(self, message: mavlink.MAVLink_message) -> None:
        self._line.sendto(message.pack(self._codec), self._to)


def measure(folder: Path, seconds: float) -> list[float]:
    """Latencies of all targets of a film, seconds."""
    film = make_film(folder, seconds)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        port = one.getsockname()[1]
    options = ["video", str(film), "--landmarks", "--mavlink", f"udp://:{port}"]
    options += ["--node", "landing_target@tag_detector,odom=/autopilot/odom"]
    settings = {
        "streamer.camera_info_url": calibration(folder),
        "tag_detector.tags": tags_of_world("plane"),
        "autopilot.camera": "camera_optical",
        "autopilot.rate": 100,
        "landing_target.rate": 0,  # none between images
    }
    options += [text for name, value in settings.items() for text in ("--set", f"{name}={value}")]
    with (folder / "log.txt").open("wb") as log:
        process = subprocess.Popen(run(*options), stderr=log)
        try:
            found = Hovering(port).fly(process)
        finally:
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
    if not found:
        sys.exit((folder / "log.txt").read_text())
    return found[RATE_HZ:]


def main() -> None:
    """Measure, and print a line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=10.0)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        before = os.getloadavg()[0]
        found = 1e3 * np.array(measure(Path(name), args.seconds))
    p50, p95, p99 = np.percentile(found, [50, 95, 99])
    print(
        f"{len(found)} targets: p50 {p50:.1f} ms, p95 {p95:.1f} ms, p99 {p99:.1f} ms,"
        f" longest {found.max():.1f} ms; load {before:.1f} to {os.getloadavg()[0]:.1f}"
    )


if __name__ == "__main__":
    main()
