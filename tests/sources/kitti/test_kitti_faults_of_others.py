"""What kitti2bag, the tool that most people take, gets wrong."""

import os
import subprocess
import sys
from contextlib import closing

import numpy as np
import pytest
from kitti_reading import fixed_transform, messages

from ros_visualise.geometry import geodesy, rotations

FIRST_SCAN_NS = 1317042504_957314930  # 2011-09-26 13:08:24.957314930 in UTC


@pytest.mark.parametrize("zone", ["America/Los_Angeles", "Asia/Kolkata", "JST-9"])
def test_stamps_are_the_same_in_every_time_zone(drive_0009, zone):
    code = (
        "import sys; from ros_visualise.sources.kitti import open_kitti;"
        "print(open_kitti(sys.argv[1]).start_ns)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(drive_0009)],
        env={**os.environ, "TZ": zone},
        capture_output=True,
        text=True,
        check=True,
    )
    assert int(done.stdout) == FIRST_SCAN_NS


def test_lever_arm_is_counted_once(opened, drive_0009):
    """The IMU's place by tf is where the satellites say that it is."""
    recording = opened(drive_0009)
    T_base_imu = fixed_transform(recording, "base_link", "imu_link")
    fixes, odometry = messages(recording, "/gps/fix"), messages(recording, "/odom")
    by_tf = [
        one.position_xyz + rotations.to_matrix(one.quat_xyzw) @ T_base_imu[:3, 3]
        for one in odometry
    ]
    geodetic = [(fix.latitude, fix.longitude, fix.altitude) for fix in fixes]
    measured = geodesy.kitti_mercator(geodetic, fixes[0].latitude)
    assert by_tf - by_tf[0] == pytest.approx(measured - measured[0], abs=1e-6)
    assert T_base_imu[:3, 3].tolist() == [0, 0, 0.93]


def test_rectified_images_do_not_get_the_raw_cameras_calibration(opened, drive_0009):
    info = messages(opened(drive_0009), "/cam02/camera_info")[0]
    assert info.K[0, 0] == 721.5377  # not 959.791, of the raw camera
    assert not info.D.any()


def test_stamps_keep_their_nanoseconds(opened, drive_0009):
    recording = opened(drive_0009)
    for part, topic in (("image_02", "/cam02/image_rect"), ("oxts", "/imu/data")):
        lines = (drive_0009 / part / "timestamps.txt").read_text().split("\n")
        expected = [int(np.datetime64(line, "ns").astype(np.int64)) for line in lines if line]
        assert [one.header.stamp_ns for one in messages(recording, topic)] == expected


def test_messages_come_in_order_of_time(opened, drive_0009):
    with closing(opened(drive_0009).read()) as entries:
        stamps = [entry.stamp_ns for entry in entries]
    assert stamps == sorted(stamps)
