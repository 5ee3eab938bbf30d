"""Telemetry logs: written by pymavlink, read as recordings."""

import math
import struct
from io import BytesIO

import numpy as np
import pytest
from pymavlink.dialects.v10 import common as v1
from pymavlink.dialects.v20 import ardupilotmega as v2

from ros_visualise.core.errors import OpenError
from ros_visualise.geometry import rotations
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.messages.numeric_fields import numeric_fields
from ros_visualise.sources.opening import open_recording, open_source

START_US = 1_700_000_000_000_000


class Station:
    """A ground station that writes what it hears."""

    def __init__(self, dialect=v2):
        self.parts = []
        self._us = START_US
        self._dialect = dialect
        self._senders = {}

    def hear(self, name, system=1, /, **fields):
        sender = self._senders.setdefault(system, self._dialect.MAVLink(BytesIO(), system, 1))
        kind = getattr(self._dialect, f"MAVLink_{name.lower()}_message")
        self.parts.append(struct.pack(">Q", self._us) + kind(**fields).pack(sender))

    def wait(self, ms):
        self._us += 1000 * ms


def flight(dialect=v2, count=50):
    """A climbing flight to the north-east, heading east."""
    station = Station(dialect)
    heartbeat = {
        "type": 2,
        "base_mode": 0,
        "custom_mode": 0,
        "system_status": 4,
        "mavlink_version": 3,
    }
    for n in range(count):
        station.hear("heartbeat", 255, **heartbeat | {"type": 6}, autopilot=8)
        station.hear("heartbeat", 1, **heartbeat, autopilot=3)
        station.hear(
            "attitude",
            time_boot_ms=n,
            roll=0,
            pitch=0,
            yaw=math.pi / 2,
            rollspeed=0.1,
            pitchspeed=0.2,
            yawspeed=0.3,
        )
        station.hear(
            "local_position_ned", time_boot_ms=n, x=n, y=2 * n, z=-3 * n, vx=1, vy=2, vz=-3
        )
        station.hear(
            "scaled_imu",
            time_boot_ms=n,
            xacc=0,
            yacc=0,
            zacc=-1000,
            xgyro=100,
            ygyro=200,
            zgyro=300,
            xmag=0,
            ymag=0,
            zmag=0,
        )
        station.hear(
            "gps_raw_int",
            time_usec=n,
            fix_type=3,
            lat=473977000 + n,
            lon=85456000,
            alt=488120,
            eph=100,
            epv=100,
            vel=0,
            cog=0,
            satellites_visible=9,
        )
        station.hear("statustext", severity=6, text=b"climbing")
        station.wait(100)
    return station.parts


@pytest.fixture
def write(tmp_path):
    def write(data):
        path = tmp_path / "flight.tlog"
        path.write_bytes(data)
        return path

    return write


def read(recording, topic):
    return [entry.message for entry in recording.read(topics=[topic])]


GIMBALS = {
    "mount_status": {"pointing_a": -6000, "pointing_b": 0, "pointing_c": 9000},
    "mount_orientation": {"time_boot_ms": 1, "roll": 0, "pitch": -60, "yaw": 90},
    "gimbal_device_attitude_status": {
        "q": rotations.from_rpy([0, math.radians(-60), math.pi])[[3, 0, 1, 2]].tolist(),
        "flags": 0,  # its yaw is from north
    },
}


@pytest.mark.parametrize("name", GIMBALS)
def test_the_gimbal_is_on_tf(write, name):
    none = {"target_system": 0, "target_component": 0}
    more = none if name != "mount_orientation" else {}
    if name.startswith("gimbal"):
        speeds = ("angular_velocity_x", "angular_velocity_y", "angular_velocity_z")
        more = {**none, "time_boot_ms": 1, "failure_flags": 0, **dict.fromkeys(speeds, 0.0)}
    station = Station()
    station.hear(name, **GIMBALS[name], **more)
    recording = open_recording(write(b"".join([*flight()[:70], *station.parts])))
    frames = FrameTree()
    for transforms in read(recording, "/tf"):
        for one in transforms.transforms:
            frames.add(one)
    R = frames.lookup("map", "gimbal", START_US * 1000)[:3, :3]
    down = math.radians(60)  # east is forward, so south is to the right
    np.testing.assert_allclose(R[:, 0], [0, -math.cos(down), -math.sin(down)], atol=1e-3)


@pytest.mark.parametrize("dialect", [v1, v2])
def test_its_topics_are_those_of_any_flight(write, dialect):
    recording = open_source(write(b"".join(flight(dialect))))
    assert recording.format == "MAVLink telemetry log (UTC)"
    assert not recording.loss
    odometry = read(recording, "/odom")[10]
    np.testing.assert_allclose(odometry.position_xyz, [20, 10, 30])
    forward = rotations.to_matrix(odometry.quat_xyzw)[:, 0]
    np.testing.assert_allclose(forward, [1, 0, 0], atol=1e-6)
    assert odometry.header.stamp_ns == (START_US + 1_000_000) * 1000
    imu = read(recording, "/imu/data")[0]
    np.testing.assert_allclose(imu.angular_xyz, [0.1, -0.2, -0.3])
    np.testing.assert_allclose(imu.linear_xyz, [0, 0, 9.80665])
    fix = read(recording, "/gps/fix")[7]
    assert (fix.latitude, fix.altitude) == pytest.approx((47.3977007, 488.12), abs=1e-9)
    assert [one.message.text for one in read(recording, "/mavlink/statustext")] == ["climbing"] * 50
    heartbeat = read(recording, "/mavlink/heartbeat")[0]
    assert numeric_fields(heartbeat.message)["autopilot"] == 3
    assert recording.topics["/mavlink/system_255/heartbeat"].messages == 50
    assert not recording.notes


def test_a_second_vehicle_is_kept_apart(write):
    station = Station()
    position = {"time_boot_ms": 0, "x": 9, "y": 9, "z": 9, "vx": 0, "vy": 0, "vz": 0}
    for part in flight():
        station.parts.append(part)
    station.wait(5000)
    heartbeat = {"type": 2, "base_mode": 0, "custom_mode": 0, "system_status": 4}
    station.hear("heartbeat", 2, **heartbeat, mavlink_version=3, autopilot=12)
    station.hear("local_position_ned", 2, **position)
    recording = open_recording(write(b"".join(station.parts)))
    assert recording.notes == ["odometry comes from system 1; ignoring that of 2"]
    assert len(read(recording, "/odom")) == 50
    [other] = read(recording, "/mavlink/system_2/local_position_ned")
    assert other.message.x == 9


def test_every_message_can_be_described(write):
    station = Station()
    for kind in v2.mavlink_map.values():
        sizes = dict(zip(kind.ordered_fieldnames, kind.array_lengths, strict=True))
        types = dict(zip(kind.fieldnames, kind.fieldtypes, strict=True))
        fields = {
            name: b"a" if types[name] == "char" else [1] * sizes[name] if sizes[name] else 1
            for name in kind.fieldnames
        }
        station.hear(kind.msgname, **fields)
        station.wait(10)
    recording = open_recording(write(b"".join(station.parts)))
    assert not recording.loss
    names = {name for name in recording.topics if name.startswith("/mavlink/")}
    assert len(names) == len(v2.mavlink_map)
    for name in names:
        [one] = read(recording, name)
        assert one.message is not None


def test_damage_is_skipped_and_counted(write):
    parts = flight()
    broken = bytearray(parts[100])
    broken[20] ^= 1
    recording = open_recording(write(b"".join([*parts[:100], bytes(broken), *parts[101:]])))
    assert recording.loss.notes == [f"{len(broken)} damaged bytes skipped"]
    assert (
        sum(len(read(recording, name)) for name in recording.topics if "/mavlink/" in name) == 349
    )
    recording = open_recording(write(b"".join(parts)[:-5]))
    assert recording.loss.notes == [f"cut off {len(parts[-1]) - 5} bytes into its last message"]
    with pytest.raises(OpenError, match="no attitude"):
        open_recording(write(parts[0] + parts[1]))


def test_any_bytes_are_read_or_rejected(write):
    whole = np.frombuffer(b"".join(flight()), np.uint8)
    random = np.random.default_rng(0)
    for _ in range(20):
        data = whole.copy()
        places = random.integers(30, len(data), 30)
        data[places] = random.integers(0, 256, 30)
        recording = open_recording(write(data.tobytes()))
        assert sum(1 for _ in recording.read()) > 300
        recording.close()
