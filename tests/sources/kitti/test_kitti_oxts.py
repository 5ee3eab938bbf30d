"""What the OXTS measured: the path, attitude, velocities and positions."""

import numpy as np
import pytest
from kitti_reading import messages

from ros_visualise.geometry import geodesy, rotations


def error_after_alignment(path, truth):
    """RMS of what is left when one is moved and turned onto the other, metres (Umeyama 1991)."""
    path, truth = path - path.mean(axis=0), truth - truth.mean(axis=0)
    U, _, Vt = np.linalg.svd(truth.T @ path)
    mirror = np.diag([1, 1, np.sign(np.linalg.det(U @ Vt))])
    return np.sqrt(((path @ (U @ mirror @ Vt).T - truth) ** 2).sum(axis=1).mean())


def test_path_is_that_of_the_benchmark(opened, drive_0016, recordings):
    (path,) = messages(opened(drive_0016), "/path")
    truth = np.loadtxt(recordings / "trajectory/kitti_odom_gt/04.txt").reshape(-1, 3, 4)[:, :, 3]
    assert error_after_alignment(path.positions_xyz[: len(truth)], truth) < 0.05


def test_path_and_tf_are_those_of_odom(opened, drive_0016):
    recording = opened(drive_0016)
    odometry = messages(recording, "/odom")
    (path,) = messages(recording, "/path")
    sent = [one.transforms[0] for one in messages(recording, "/tf")]
    for poses in (path.positions_xyz, [one.translation_xyz for one in sent]):
        assert np.array_equal(poses, [one.position_xyz for one in odometry])
    for quats in (path.quats_xyzw, [one.quat_xyzw for one in sent]):
        assert np.array_equal(quats, [one.quat_xyzw for one in odometry])
    assert path.stamps_ns.tolist() == [one.header.stamp_ns for one in odometry]
    assert {(one.header.frame_id, one.child_frame_id) for one in sent} == {("odom", "base_link")}
    assert path.header.frame_id == "odom"
    assert not odometry[0].position_xyz.any()


def test_odometry_goes_where_its_velocity_says(opened, drive_0016):
    """Between samples a tenth of a second apart: the velocity is that of base_link, in its axes."""
    odometry = messages(opened(drive_0016), "/odom")
    strayed, turned = [], []
    for before, here, after in zip(odometry, odometry[1:], odometry[2:], strict=False):
        seconds = (after.header.stamp_ns - before.header.stamp_ns) / 1e9
        moved = rotations.to_matrix(here.quat_xyzw).T @ (after.position_xyz - before.position_xyz)
        strayed.append(moved / seconds - here.linear_xyz)
        turn = rotations.multiply(rotations.inverse(before.quat_xyzw), after.quat_xyzw)
        turned.append(rotations.to_rpy(turn) / seconds - here.angular_xyz)
    assert np.abs(np.median(strayed, axis=0)).max() < 0.1  # of 14 m/s
    assert np.sqrt(np.mean(np.square(turned), axis=0)).max() < 0.02


def test_fix_is_the_place_on_the_earth_that_the_pose_is_drawn_from(opened, drive_0016):
    recording = opened(drive_0016)
    fixes, odometry = messages(recording, "/gps/fix"), messages(recording, "/odom")
    first, last = fixes[0], fixes[-1]
    plane = geodesy.LocalPlane(first.latitude, first.longitude, first.altitude)
    enu = plane.to_enu([last.latitude, last.longitude, last.altitude])
    assert enu[:2] == pytest.approx(odometry[-1].position_xyz[:2], rel=0.005)
    assert (last.status, last.covariance_type) == (2, 1)  # RTK, approximated
    assert last.header.frame_id == "imu_link"


def test_imu_is_as_rep_145_has_it(opened, drive_0009):
    numbers = [float(n) for n in (drive_0009 / "oxts/data/0000000002.txt").read_text().split()]
    imu = messages(opened(drive_0009), "/imu/data")[2]
    assert imu.linear_xyz.tolist() == numbers[11:14]
    assert imu.angular_xyz.tolist() == numbers[17:20]
    assert rotations.to_rpy(imu.quat_xyzw) == pytest.approx(numbers[3:6])
    up = rotations.to_matrix(imu.quat_xyzw) @ imu.linear_xyz
    assert up[2] == pytest.approx(9.8, abs=0.5)
    assert imu.header.frame_id == "imu_link"
    for covariance in (imu.orientation_covariance, imu.angular_covariance, imu.linear_covariance):
        assert not covariance.any()


def test_velocity_is_east_north_up(opened, drive_0009):
    numbers = [float(n) for n in (drive_0009 / "oxts/data/0000000002.txt").read_text().split()]
    recording = opened(drive_0009)
    velocity = messages(recording, "/gps/vel")[2]
    vn, ve, _, _, vu = numbers[6:11]
    assert velocity.linear_xyz.tolist() == [ve, vn, vu]
    assert velocity.header.frame_id == "odom"
    fix = messages(recording, "/gps/fix")[2]
    assert fix.covariance[0, 0] == pytest.approx(numbers[23] ** 2)
    odometry = messages(recording, "/odom")[2]
    assert odometry.twist_covariance[0, 0] == pytest.approx(numbers[24] ** 2, rel=0.01)


def test_no_fix_is_said(opened, changeable):
    path = changeable / "oxts/data/0000000001.txt"
    numbers = path.read_text().split()
    path.unlink()
    path.write_text(" ".join([*numbers[:25], "2", *numbers[26:]]))  # navstat: initialising
    assert [fix.status for fix in messages(opened(changeable), "/gps/fix")] == [0, -1, 0, 0, 0]
