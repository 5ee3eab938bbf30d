"""Accuracy of precision landings of a vehicle that is guided over MAVLink, as a real one is.

    python benchmarks/landmarks/landing_over_mavlink.py [--seeds 20] [--wind 6] [--denied]

Each landing is one command as a user types it, in real time: `sim quadrotor` with
`--mavlink-vehicle`, found over UDP as a PX4 by two others. The one is `--mavlink` with the whole
chain: rendered images, `tag_detector`, `landing_target`, `autopilot`, LANDING_TARGET. The other is
a ground station of this script, by pymavlink, which arms it, takes off, flies to about the pad and
changes the mode to precision landing. What is measured is where the middle of the quadrotor is from
the middle of the pad when it has disarmed, by the truth in the recording.

With `--denied` nobody has GPS, and the odometry drifts: above the field with its tags, the vehicle
flies by the poses that `landmark_navigator` sends it in ODOMETRY. How far these and its odometry
went astray is given too.
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
from contextlib import closing
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from pymavlink import mavutil

from ros_visualise.messages.recorded import content
from ros_visualise.sources.opening import open_recording

TRUTH, PAD = "/ground_truth/odom", "/ground_truth/pad"
OWN, POSE = "/odom", "/navigation/pose"
ARM, TAKE_OFF, CHANGE_MODE = 400, 22, 176
OFFBOARD, PRECISION_LAND = (6, 0), (4, 9)
LIMIT_S = 150
HEIGHT_M = 4.0


class Station:
    """A ground station: arms, takes off, flies to a place, lands precisely."""

    def __init__(self, port: int) -> None:
        self._link = mavutil.mavlink_connection(f"udpin:127.0.0.1:{port}", source_system=255)
        self._link.wait_heartbeat(timeout=60)

    def command(self, number: int, *values: float) -> None:
        """Send a command until it is accepted."""
        values = (*values, *[0.0] * (7 - len(values)))
        for _ in range(20):
            self._link.mav.command_long_send(1, 1, number, 0, *values)
            answer = self._link.recv_match(type="COMMAND_ACK", blocking=True, timeout=1)
            if answer is not None and answer.command == number and answer.result == 0:
                return
            time.sleep(0.2)
        raise RuntimeError(f"command {number} was not accepted")

    def wait(self, kind: str, condition: Any) -> Any:
        """The next message of a kind for which something holds."""
        end_s = time.monotonic() + LIMIT_S
        while time.monotonic() < end_s:
            message = self._link.recv_match(type=kind, blocking=True, timeout=1)
            if message is not None and condition(message):
                return message
        raise RuntimeError(f"no such {kind} in {LIMIT_S} s")

    def fly_to(self, north: float, east: float, down: float) -> None:
        """Fly there by set points."""
        nan = math.nan

        def near(m: Any) -> bool:
            self._link.mav.set_position_target_local_ned_send(
                0, 1, 1, 1, 0b110111111000, north, east, down, 0, 0, 0, 0, 0, 0, 0, 0
            )
            return math.dist((m.x, m.y, m.z), (north, east, down)) < 0.6

        for _ in range(10):
            near(self.wait("LOCAL_POSITION_NED", lambda m: True))
        self.command(CHANGE_MODE, 1, *OFFBOARD, nan)
        self.wait("LOCAL_POSITION_NED", near)

    def land(self) -> tuple[float, float]:
        """Land precisely; seconds until it is disarmed, by the vehicle's clock and by ours."""
        start_s, start = time.monotonic(), self.wait("ATTITUDE", lambda m: True)
        self.command(CHANGE_MODE, 1, *PRECISION_LAND)
        self.wait("HEARTBEAT", lambda m: m.get_srcComponent() == 1 and not m.base_mode & 128)
        end_s, end = time.monotonic(), self.wait("ATTITUDE", lambda m: True)
        return (end.time_boot_ms - start.time_boot_ms) / 1e3, end_s - start_s

    def close(self) -> None:
        """Leave."""
        self._link.close()


GUIDED = ["--world", "plane", "--set", "landing_target.autopilot=px4"]
DENIED = ["--world", "field", "--navigate", "--set", "mavlink_vehicle.gps=false"]
DENIED += ["--set", "quadrotor.gps=false"]


class Landing(NamedTuple):
    """One landing: metres off, its duration by the vehicle's clock and by ours; the largest errors
    of the navigator and of the odometry during the flight, metres; NaN without a navigator."""

    off_m: float
    flown_s: float
    passed_s: float
    navigator_m: float
    odometry_m: float


def fly(seed: int, wind: float, folder: Path, more: list[str]) -> Landing:
    """One landing."""
    random = np.random.default_rng(seed)
    record, ports = folder / "run.mcap", (free_port(), free_port())
    x, y = random.uniform(-4.5, -2.5), random.uniform(0.5, 2.5)
    over_x, over_y = np.array([x, y]) + random.uniform(-1.0, 1.0, 2)
    settings = {
        "pad": "true",
        "pad_x": x,
        "pad_y": y,
        "pad_heading": random.uniform(-180, 180),
        "wind": wind,
        "wind_direction": random.uniform(0, 360),
    }
    command = [sys.executable, "-m", "ros_visualise", "sim", "quadrotor"]
    command += [
        "--seed",
        str(seed),
        "--view",
        "none",
        "--record",
        f"{record}@{TRUTH},{PAD},{OWN},{POSE}",
    ]
    command += ["--overwrite", "--mavlink", f"udp://:{ports[0]}"]
    command += more
    for port in ports:
        command += ["--mavlink-vehicle", f"udpout://127.0.0.1:{port}"]
    for name, value in settings.items():
        command += ["--set", f"quadrotor.{name}={value}"]
    process = subprocess.Popen(command, stderr=(folder / "log.txt").open("w"))
    station = Station(ports[1])
    try:
        station.wait("LOCAL_POSITION_NED", lambda m: True)
        station.command(ARM, 1)
        start = station.wait("LOCAL_POSITION_NED", lambda m: True)
        station.command(TAKE_OFF, 0, 0, 0, *[math.nan] * 4)
        station.wait("LOCAL_POSITION_NED", lambda m: m.z < start.z - 2)
        station.fly_to(start.x + over_y, start.y + over_x, start.z - HEIGHT_M)
        flown_s, passed_s = station.land()
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(60)
        station.close()
    return Landing(off_pad(record), flown_s, passed_s, *astray(record))


def places(record: Path, topic: str) -> tuple[np.ndarray, np.ndarray]:
    """Stamps and positions on a topic, (N,) and (N, 3)."""
    with closing(open_recording(record)) as recording:
        found = [content(m) for name, _, m in recording.read() if name == topic]
    at = np.array([one.position_xyz for one in found]).reshape(-1, 3)
    return np.array([one.header.stamp_ns for one in found]), at


def off_pad(record: Path) -> float:
    """Metres between the middles of robot and pad at the end of a recording."""
    last = [places(record, topic)[1][-1] for topic in (TRUTH, PAD)]
    return float(np.hypot(*(last[0] - last[1])[:2]))


def astray(record: Path) -> tuple[float, float]:
    """Largest level errors of the navigator and of the odometry, metres; NaN if there are none."""
    stamps, truth = places(record, TRUTH)
    errors = []
    for topic in (POSE, OWN):
        times, at = places(record, topic)
        if not len(at):
            return math.nan, math.nan
        true = np.stack([np.interp(times, stamps, axis) for axis in truth.T], axis=1)
        off = at - true if topic == POSE else (at - at[0]) - (true - true[0])
        errors.append(float(np.hypot(off[:, 0], off[:, 1]).max()))
    return errors[0], errors[1]


def free_port() -> int:
    """A port that nobody has."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


def main() -> None:
    """Fly all landings, and tell of each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--wind", type=float, default=6.0)
    parser.add_argument("--denied", action="store_true", help="no GPS; it flies by the navigator")
    parser.add_argument("--set", action="append", default=[])
    args = parser.parse_args()
    more = DENIED if args.denied else GUIDED
    more = [*more, *(text for one in args.set for text in ("--set", one))]
    landings = []
    for seed in range(args.first, args.first + args.seeds):
        with tempfile.TemporaryDirectory() as name:
            one = fly(seed, args.wind, Path(name), more)
        speed, load = one.flown_s / one.passed_s, os.getloadavg()[0]
        print(
            f"{seed}: {one.off_m:.3f} m off, after {one.flown_s:.0f} s at {speed:.2f} of real time,"
            f" load {load:.1f}; navigator up to {one.navigator_m:.2f} m off,"
            f" odometry {one.odometry_m:.2f} m",
            flush=True,
        )
        landings.append(one)
    off = [one.off_m for one in landings]
    print(
        f"{len(off)} landings, {sum(m <= 0.2 for m in off)} within 0.2 m,"
        f" median {np.median(off):.3f} m, largest {max(off):.3f} m"
    )


if __name__ == "__main__":
    main()
