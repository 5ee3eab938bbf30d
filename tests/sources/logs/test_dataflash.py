"""ArduPilot's logs: what pymavlink's reader finds in them, in the axes and units of ROS."""

import math
import struct

import numpy as np
import pytest
from pymavlink.DFReader import DFReader_binary

from ros_visualise.core.errors import OpenError
from ros_visualise.geometry import rotations
from ros_visualise.messages.numeric_fields import numeric_fields
from ros_visualise.sources.logs.dataflash import DataFlash
from ros_visualise.sources.opening import open_recording, open_source

TYPES = {
    "FMT": (128, "BBnNZ", "Type,Length,Name,Format,Columns"),
    "FMTU": (129, "QBNN", "TimeUS,FmtType,UnitIds,MultIds"),
    "MSG": (130, "QZ", "TimeUS,Message"),
    "ATT": (131, "Qccccc", "TimeUS,DesRoll,Roll,DesPitch,Pitch,Yaw"),
    "XKF1": (132, "QBffffff", "TimeUS,C,VN,VE,VD,PN,PE,PD"),
    "IMU": (133, "QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ"),
    "GPS": (134, "QBBIHLLe", "TimeUS,I,Status,GMS,GWk,Lat,Lng,Alt"),
    "GPA": (135, "QBCC", "TimeUS,I,HAcc,VAcc"),
    "ISBD": (136, "Qag", "TimeUS,x,half"),
    "PARM": (137, "QNf", "TimeUS,Name,Value"),
    "MNT": (138, "QBfff", "TimeUS,I,Roll,Pitch,YawB"),
}
CODES = {"n": "4s", "N": "16s", "Z": "64s", "c": "h", "C": "H", "e": "i", "E": "I", "L": "i"}
CODES |= {"a": "32h", "g": "e", "M": "B"}
START_US = 1_000_000
UTC_S = 315_964_800 + 2300 * 604_800 + 100_000 - 18  # of week 2300, at 100,000 s


def message(name, *values):
    number, letters, _ = TYPES[name]
    codes = "<" + "".join(CODES.get(one, one) for one in letters)
    return b"\xa3\x95" + bytes([number]) + struct.pack(codes, *values)


def described(name):
    number, letters, fields = TYPES[name]
    size = len(
        message(
            name,
            *[
                b"" if one in "nNZ" else 0
                for one in letters
                for _ in range(32 if one == "a" else 1)
            ],
        )
    )
    return message("FMT", number, size, name.encode(), letters.encode(), fields.encode())


def flight(count=50):
    """A climbing flight to the north-east, heading east, in messages."""
    parts = [described(name) for name in TYPES]
    for name, units in (("IMU", b"s#"), ("XKF1", b"s#"), ("GPS", b"s#")):
        parts.append(message("FMTU", 0, TYPES[name][0], units, b"F-"))
    parts.append(message("PARM", START_US, b"PLND_TYPE", 1.0))
    for n in range(count):
        us = START_US + 100_000 * n
        parts += [
            message("ATT", us, 0, 1000, 0, -500, 9000),
            message("XKF1", us, 0, 1, 2, -3, n, 2 * n, -3 * n),
            message("XKF1", us, 1, 9, 9, 9, 9, 9, 9),
            message("IMU", us, 0, 0.1, 0.2, 0.3, 1, 2, -9.8),
            message("IMU", us, 1, 0.5, 0.5, 0.5, 5, 5, 5),
            message("GPS", us, 0, 3, 100_000_000 + 100 * n, 2300, 473977000 + n, 85456000, 48812),
            message("GPA", us, 0, 150, 250),
            message("MSG", us, b"climbing"),
            message("ISBD", us, *range(32), 0.5),
        ]
    return parts


@pytest.fixture
def write(tmp_path):
    def write(data):
        path = tmp_path / "flight.bin"
        path.write_bytes(data)
        return path

    return write


def read(recording, topic):
    return [entry.message for entry in recording.read(topics=[topic])]


def test_every_message_is_as_pymavlink_reads_it(write):
    path = write(b"".join(flight()))
    theirs = DFReader_binary(str(path))
    rows = {}
    while (one := theirs.recv_msg()) is not None:
        rows.setdefault(one.get_type(), []).append(one.to_dict())
    theirs.data_map.close()
    theirs.filehandle.close()
    ours = DataFlash(path.read_bytes()).tables()
    assert rows.keys() - {"FMT"} == {name.removesuffix("_1") for name in ours}
    for name, table in ours.items():
        number = int(name.endswith("_1"))
        field = next((one for one in ("I", "C") if one in table.raw), "")
        same = [one for one in rows[table.name] if one.get(field, number) == number]
        assert len(same) == len(table), name
        for label, values in table.raw.items():
            if label in ("TimeUS", "Lat", "VN", "Value", "HAcc", "half", "Alt", "Yaw"):
                np.testing.assert_allclose(values, [one[label] for one in same], rtol=1e-6)
    assert {*(bytes(one).decode() for one in ours["MSG"].raw["Message"])} == {"climbing"}


def test_the_mount_of_the_camera_is_on_tf(write):
    aimed = message("MNT", START_US + 10, 0, 0.0, -90.0, 30.0)
    transforms = read(open_recording(write(b"".join([*flight(), aimed]))), "/tf")
    assert len(transforms) == 51
    ((gimbal,),) = [
        one.transforms for one in transforms if one.transforms[0].child_frame_id == "gimbal"
    ]
    pitched = math.radians(5)  # the vehicle's nose is down; the mount looks straight down
    forward = rotations.to_matrix(gimbal.quat_xyzw)[:, 0]
    down = [
        math.sin(pitched),
        -math.cos(pitched) * math.sin(math.radians(10)),
        -math.cos(pitched) * math.cos(math.radians(10)),
    ]
    np.testing.assert_allclose(forward, down, atol=1e-3)


def test_its_topics_are_those_of_any_flight(write):
    recording = open_source(write(b"".join(flight())))
    assert recording.format == "ArduPilot DataFlash (UTC)"
    assert not recording.loss
    odometry = read(recording, "/odom")[10]
    np.testing.assert_allclose(odometry.position_xyz, [20, 10, 30])
    forward = rotations.to_matrix(odometry.quat_xyzw)[:, 0]
    np.testing.assert_allclose(
        forward, [math.cos(math.radians(5)), 0, -math.sin(math.radians(5))], atol=1e-9
    )
    np.testing.assert_allclose(
        rotations.to_matrix(odometry.quat_xyzw) @ odometry.linear_xyz, [2, 1, 3], atol=1e-6
    )
    assert odometry.header.stamp_ns == (UTC_S * 10 + 10) * 10**8
    imu = read(recording, "/imu/data")[0]
    np.testing.assert_allclose(imu.angular_xyz, [0.1, -0.2, -0.3], rtol=1e-6)
    np.testing.assert_allclose(imu.linear_xyz, [1, -2, 9.8], rtol=1e-6)
    fix = read(recording, "/gps/fix")[7]
    assert (fix.latitude, fix.altitude) == pytest.approx((47.3977007, 488.12), abs=1e-9)
    np.testing.assert_allclose(np.diag(fix.covariance), [1.5**2, 1.5**2, 2.5**2])
    logged = read(recording, "/ardupilot/imu_1")
    assert numeric_fields(logged[3].message)["AccX"] == 5
    assert [one.message.Message for one in read(recording, "/ardupilot/msg")] == ["climbing"] * 50
    [parameter] = read(recording, "/ardupilot/parm")
    assert (parameter.message.Name, parameter.message.Value) == ("PLND_TYPE", 1)
    assert numeric_fields(read(recording, "/ardupilot/isbd")[0].message)["x[31]"] == 31


def test_damage_is_skipped_and_counted(write):
    parts = flight()
    whole = b"".join(parts)
    broken = b"".join([*parts[:100], b"not a message", *parts[101:]])
    recording = open_recording(write(broken))
    assert recording.loss.notes == [f"{len(parts[99]) + 13} damaged bytes skipped"]
    logged = [one for name, one in recording.topics.items() if name.startswith("/ardupilot/")]
    assert sum(one.messages for one in logged) == len(parts) - len(TYPES) - 2
    recording = open_recording(write(whole[:-5]))
    assert recording.loss.notes == [f"cut off {len(parts[-1]) - 5} bytes into its last message"]
    with pytest.raises(OpenError, match="no attitude"):
        open_recording(write(whole[:89]))


def test_any_bytes_are_read_or_rejected(write):
    whole = np.frombuffer(b"".join(flight()), np.uint8)
    random = np.random.default_rng(0)
    for _ in range(40):
        data = whole.copy()
        places = random.integers(89, len(data), 30)
        data[places] = random.integers(0, 256, 30)
        try:
            recording = open_recording(write(data.tobytes()))
        except OpenError:
            continue
        assert sum(1 for _ in recording.read()) > 100
        recording.close()
