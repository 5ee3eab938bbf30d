"""PX4's logs: what `ulog2csv` reads from them, in the axes and units of ROS."""

import csv
import math
import subprocess
import sys

import numpy as np
import pytest
from pyulog import ULog

from ros_visualise.core.errors import OpenError
from ros_visualise.data import Imu, NavSatFix, Odometry, Path, Transforms
from ros_visualise.geometry import rotations
from ros_visualise.messages.numeric_fields import numeric_fields
from ros_visualise.sources.logs.px4 import open_ulog
from ros_visualise.sources.logs.tables import find_strays
from ros_visualise.sources.opening import open_recording


@pytest.fixture(scope="module")
def real(recordings):
    """A CUBEORANGE on the ground: its positions are not valid."""
    return recordings / "trajectory" / "px4_ulog" / "sample_log_small.ulg"


@pytest.fixture(scope="module")
def tables(real, tmp_path_factory):
    """Topic of PX4's -> rows as `ulog2csv` writes them."""
    folder = tmp_path_factory.mktemp("csv")
    ulog2csv = [sys.executable, "-c", "from pyulog.ulog2csv import main; main()"]
    subprocess.run([*ulog2csv, real, "-o", folder], check=True, capture_output=True, timeout=60)
    found = {}
    for path in folder.iterdir():
        with path.open() as file:
            name = path.stem.removeprefix("sample_log_small_")
            found[name] = [{k: float(v) for k, v in row.items()} for row in csv.DictReader(file)]
    return found


def read(recording, topic):
    assert recording.topics[topic].messages == len(recording.stamps_ns()[topic])
    return [entry.message for entry in recording.read(topics=[topic])]


def test_what_it_holds(real):
    recording = open_recording(real)
    assert recording.format == "PX4 ULog (UTC)"
    counts = {name: info.messages for name, info in recording.topics.items()}
    logged = {name for name in counts if name.startswith("/px4/")}
    assert {name: counts[name] for name in counts.keys() - logged} == {
        "/gps/fix": 32,
        "/imu/data": 1298,
    }
    assert len(logged) == 70
    assert not recording.loss
    [note] = recording.notes
    assert note.startswith("636 of 636 positions are not valid")


def test_fixes(real, tables):
    rows = tables["vehicle_gps_position_0"]
    fixes = read(open_ulog(real), "/gps/fix")
    assert len(fixes) == len(rows) == 32
    for fix, row in zip(fixes, rows, strict=True):
        assert isinstance(fix, NavSatFix)
        assert fix.latitude == pytest.approx(row["lat"] / 1e7, abs=1e-12)
        assert fix.longitude == pytest.approx(row["lon"] / 1e7, abs=1e-12)
        assert fix.altitude == pytest.approx(row["alt_ellipsoid"] / 1e3)
        assert fix.covariance[0, 0] == pytest.approx(row["eph"] ** 2, rel=1e-5)
        assert fix.covariance[2, 2] == pytest.approx(row["epv"] ** 2, rel=1e-5)
        assert fix.status == 0
        # The receiver's own UTC, but for its changing latency.
        assert fix.header.stamp_ns / 1e9 == pytest.approx(row["time_utc_usec"] / 1e6, abs=0.02)


def test_imu(real, tables):
    rows, attitudes = tables["sensor_combined_0"], tables["vehicle_attitude_0"]
    messages = read(open_ulog(real), "/imu/data")
    assert len(messages) == len(rows) == len(attitudes) == 1298
    for imu, row, attitude in zip(messages, rows, attitudes, strict=True):
        assert isinstance(imu, Imu)
        x, y, z = (row[f"accelerometer_m_s2[{axis}]"] for axis in range(3))
        np.testing.assert_allclose(imu.linear_xyz, [x, -y, -z], atol=1e-5)
        x, y, z = (row[f"gyro_rad[{axis}]"] for axis in range(3))
        np.testing.assert_allclose(imu.angular_xyz, [x, -y, -z], atol=1e-6)
        assert row["timestamp"] == attitude["timestamp"]
        # Forward in the world: north and east by PX4, east and north by ROS.
        w, x, y, z = (attitude[f"q[{axis}]"] for axis in range(4))
        north, east = 1 - 2 * (y * y + z * z), 2 * (x * y + w * z)
        forward = rotations.to_matrix(imu.quat_xyzw)[:, 0]
        np.testing.assert_allclose(forward[:2], [east, north], atol=1e-5)
    rest = np.mean([imu.linear_xyz for imu in messages], axis=0)
    np.testing.assert_allclose(rest, [0, 0, 9.8], atol=0.3)


def test_every_topic_is_there_as_it_was_logged(real, tables):
    recording = open_ulog(real)
    for topic, table, fields in (
        ("sensor_gyro_1", "sensor_gyro_1", ["x", "temperature", "device_id"]),
        ("battery_status", "battery_status_0", ["voltage_v", "warning"]),
        ("vehicle_attitude", "vehicle_attitude_0", ["q[0]", "q[3]", "timestamp"]),
    ):
        messages = read(recording, f"/px4/{topic}")
        assert len(messages) == len(tables[table])
        for one, row in zip(messages, tables[table], strict=True):
            found = numeric_fields(one.message)
            assert [found[name] for name in fields] == pytest.approx([row[n] for n in fields])
    inputs = [numeric_fields(one.message) for one in read(recording, "/px4/input_rc")]
    assert [one["values[17]"] for one in inputs] == [
        float(row["values[17]"]) for row in tables["input_rc_0"]
    ]
    name = recording.topics["/px4/vehicle_attitude"].type.name
    assert name == "px4_msgs/msg/VehicleAttitude"
    [triplet] = read(recording, "/px4/position_setpoint_triplet")
    row = tables["position_setpoint_triplet_0"][0]
    assert triplet.message.current.timestamp == row["current.timestamp"]
    assert (recording.end_ns - recording.start_ns) / 1e9 == pytest.approx(6.5, abs=0.1)


def test_stamps_keep_the_vehicles_intervals(real, tables):
    stamps_ns = open_ulog(real).stamps_ns()["/imu/data"]
    times_us = [int(row["timestamp"]) for row in tables["sensor_combined_0"]]
    np.testing.assert_array_equal(np.diff(stamps_ns), np.diff(times_us) * 1000)


@pytest.fixture
def flight(real, tmp_path):
    """The real log with positions of one's own: write it once they are set."""
    log = ULog(str(real))
    local = log.get_dataset("vehicle_local_position").data
    local["xy_valid"][:] = local["v_xy_valid"][:] = 1
    count = len(local["x"])
    local["x"][:], local["y"][:] = np.arange(count), 2 * np.arange(count)
    local["z"][:] = -3 * np.arange(count)
    local["vx"][:], local["vy"][:], local["vz"][:] = 4, 0, -1

    def write():
        log.write_ulog(str(tmp_path / "flight.ulg"))
        return open_ulog(tmp_path / "flight.ulg")

    return log, local, write


def level(log, heading):
    """Set every attitude: level, and turned by an angle from north to east, radians."""
    attitude = log.get_dataset("vehicle_attitude").data
    for axis, value in enumerate((math.cos(heading / 2), 0, 0, math.sin(heading / 2))):
        attitude[f"q[{axis}]"][:] = value


@pytest.mark.parametrize(
    ("heading", "yaw", "linear"),
    [(0, 90, [4, 0, 1]), (90, 0, [0, 4, 1]), (180, -90, [-4, 0, 1]), (30, 60, [3.4641, 2, 1])],
)
def test_positions_go_from_ned_to_enu(flight, heading, yaw, linear):
    """Flying north at 4 m/s and climbing, whatever the heading."""
    log, _, write = flight
    level(log, math.radians(heading))
    recording = write()
    odometry = read(recording, "/odom")
    assert len(odometry) == 636
    for number, one in enumerate(odometry):
        assert isinstance(one, Odometry)
        assert (one.header.frame_id, one.child_frame_id) == ("map", "base_link")
        np.testing.assert_allclose(one.position_xyz, [2 * number, number, 3 * number])
        np.testing.assert_allclose(one.linear_xyz, linear, atol=1e-4)
        roll, pitch, found = np.degrees(rotations.to_rpy(one.quat_xyzw))
        np.testing.assert_allclose([roll, pitch, found], [0, 0, yaw], atol=1e-4)
    transforms = read(recording, "/tf")
    assert all(isinstance(one, Transforms) for one in transforms)
    last = transforms[-1].transforms[0]
    assert (last.header.frame_id, last.child_frame_id) == ("map", "base_link")
    np.testing.assert_array_equal(last.translation_xyz, odometry[-1].position_xyz)
    [path] = read(recording, "/path")
    assert isinstance(path, Path)
    np.testing.assert_array_equal(path.positions_xyz, [one.position_xyz for one in odometry])


def test_what_is_flagged_not_valid_is_left_out(flight):
    _, local, write = flight
    local["xy_valid"][:100] = 0
    local["z_valid"][200:210] = 0
    local["x"][300] = math.nan
    local["v_xy_valid"][:] = 0
    recording = write()
    odometry = read(recording, "/odom")
    assert len(odometry) == 636 - 111
    assert recording.notes == ["111 of 636 positions are not valid (xy_valid, z_valid); skipped"]
    assert not any(one.linear_xyz.any() for one in odometry)


def test_without_gps_time_stamps_count_from_the_start(flight):
    log, _, write = flight
    log.get_dataset("vehicle_gps_position").data["time_utc_usec"][:] = 0
    recording = write()
    assert recording.format == "PX4 ULog (time since start)"
    assert recording.start_ns == 20_321_827_000


def test_a_lost_fix_is_none(flight):
    log, _, write = flight
    gps = log.get_dataset("vehicle_gps_position").data
    gps["fix_type"][:4] = [0, 1, 4, 6]
    statuses = [fix.status for fix in read(write(), "/gps/fix")]
    assert statuses == [-1, -1, 0, 2] + 28 * [0]


def test_a_log_that_is_cut_is_read_to_there(real, tmp_path):
    data = real.read_bytes()
    cut = tmp_path / "cut.ulg"
    cut.write_bytes(data[: len(data) // 2 + 1])
    recording = open_recording(cut)
    [note] = recording.loss.notes
    assert note.startswith("cut off")
    assert 100 < len(read(recording, "/imu/data")) < 1298


@pytest.mark.parametrize("seed", range(4))
def test_a_damaged_log_gives_what_is_left(real, tmp_path, seed, capsys):
    data = bytearray(real.read_bytes())
    random = np.random.default_rng(seed)
    start = int(random.integers(200_000, 700_000))
    data[start : start + 3000] = random.bytes(3000)
    (tmp_path / "damaged.ulg").write_bytes(data)
    recording = open_recording(tmp_path / "damaged.ulg")
    assert recording.loss.notes
    assert len(read(recording, "/imu/data")) > 300
    assert capsys.readouterr().out == ""


def test_what_is_no_log_is_said(real, tmp_path):
    for name, data in {"a.ulg": b"ULog\x01\x125", "b.ulg": real.read_bytes()[:60_000]}.items():
        (tmp_path / name).write_bytes(data)
        with pytest.raises(OpenError, match=name):
            open_ulog(tmp_path / name)


@pytest.mark.parametrize("bit", [40, 33, 27, 63])
@pytest.mark.parametrize("number", [0, 1, 300, 635])
def test_a_sample_with_a_wrong_time_is_left_out_and_counted(flight, bit, number):
    _, local, write = flight
    local["timestamp"][number] ^= np.uint64(1 << bit)
    recording = write()
    assert len(read(recording, "/odom")) == 635
    assert (recording.end_ns - recording.start_ns) / 1e9 == pytest.approx(6.5, abs=0.1)
    assert recording.loss.messages == 1
    assert recording.loss.notes == ["1 sample skipped: implausible timestamps"]


def test_a_wrong_time_within_the_flight_is_found_by_those_before_and_after_it():
    times_us = {"a": np.arange(0, 600_000_000, 100_000, np.uint64)}
    times_us["a"][1000] += np.uint64(200_000_000)
    times_us["a"][5000] -= np.uint64(100_000_000)
    assert np.flatnonzero(find_strays(times_us)["a"]).tolist() == [1000, 5000]


@pytest.mark.parametrize("gap_s", [3, 5000])
def test_a_gap_in_a_log_and_a_little_disorder_are_no_wrong_times(gap_s):
    times_us = np.arange(0, 60_000_000, 5000, np.uint64)
    times_us[6000:] += np.uint64(gap_s * 1_000_000)
    times_us[[100, 101]] = times_us[[101, 100]]
    slow_us = times_us[::4000]
    found = find_strays({"fast": times_us, "slow": slow_us, "none": times_us[:0]})
    assert not any(mask.any() for mask in found.values())


@pytest.mark.parametrize("count", [0, 1, 2, 5])
def test_of_few_samples_none_is_wrong(count):
    times_us = np.arange(count, dtype=np.uint64) * np.uint64(3_600_000_000)
    assert not find_strays({"a": times_us})["a"].any()
