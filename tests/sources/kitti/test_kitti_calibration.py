"""Calibration and the places of the sensors, against KITTI's formulas and against the images."""

import cv2
import numpy as np
import pytest
from kitti_reading import fixed_transform, messages

from ros_visualise.geometry import rotations, se3
from ros_visualise.sources.kitti.calibration import CalibrationFile, read_matrices, rigid


def of_date(drive):
    """All that is calibrated, by the names in the files, and T_cam0_velodyne."""
    date = drive.parent
    return read_matrices(date / "calib_cam_to_cam.txt"), rigid(
        CalibrationFile(date / "calib_velo_to_cam.txt"), needed_for=[]
    )


def in_front(xyz):
    return xyz[(xyz[:, 0] > 4) & (np.abs(xyz[:, 1]) < xyz[:, 0])]


def pixels_of(points, info):
    """By P of a CameraInfo, which ROS's own tools use for points in the camera's frame."""
    homogeneous = np.column_stack([points, np.ones(len(points))]) @ info.P.T
    return homogeneous[:, :2] / homogeneous[:, 2:]


@pytest.mark.parametrize("camera", range(4))
def test_points_land_where_the_development_kit_puts_them(opened, drive_0009, camera):
    recording = opened(drive_0009)
    xyz = in_front(messages(recording, "/velodyne_points")[0].xyz.astype(float))
    info = messages(recording, f"/cam{camera:02d}/camera_info")[0]
    T = se3.inverse(fixed_transform(recording, "velodyne", info.header.frame_id))
    numbers, T_cam0_velodyne = of_date(drive_0009)
    R_rect = se3.from_parts(numbers["R_rect_00"].reshape(3, 3), np.zeros(3))
    P_rect = numbers[f"P_rect_{camera:02d}"].reshape(3, 4)
    there = np.column_stack([xyz, np.ones(len(xyz))]) @ (P_rect @ R_rect @ T_cam0_velodyne).T
    found = pixels_of(se3.apply(T, xyz), info)
    assert np.abs(found - there[:, :2] / there[:, 2:]).max() < 0.01


def test_the_baselines_that_p_leaves_out_are_between_the_frames(opened, drive_0009):
    recording, (numbers, _) = opened(drive_0009), of_date(drive_0009)
    for left, right in (0, 1), (2, 3):
        frames = f"cam{left:02d}_optical", f"cam{right:02d}_optical"
        first, second = (fixed_transform(recording, "velodyne", frame) for frame in frames)
        T = se3.inverse(first) @ second
        fx = numbers[f"P_rect_{left:02d}"][0]
        offsets = numbers[f"P_rect_{right:02d}"][3] - numbers[f"P_rect_{left:02d}"][3]
        assert T[0, 3] == pytest.approx(-offsets / fx, abs=1e-4)
        assert 0.53 < T[0, 3] < 0.54
        assert T[:3, :3] == pytest.approx(np.eye(3), abs=1e-9)


def test_rectified_images_have_the_rectified_calibration(opened, drive_0009):
    for camera in range(4):
        recording = opened(drive_0009)
        info = messages(recording, f"/cam{camera:02d}/camera_info")[0]
        image = messages(recording, f"/cam{camera:02d}/image_rect")[0]
        P_rect = of_date(drive_0009)[0][f"P_rect_{camera:02d}"].reshape(3, 4)
        assert (info.width, info.height) == (image.width, image.height) == (1242, 375)
        assert info.header == image.header
        assert not info.D.any()
        assert np.array_equal(info.R, np.eye(3))
        assert np.array_equal(info.K, P_rect[:, :3])
        assert np.array_equal(image.camera_info.P, np.column_stack([info.K, np.zeros(3)]))


@pytest.mark.parametrize("camera", range(4))
def test_points_land_in_raw_images_through_the_raw_calibration(opened, changeable, camera):
    """By R, K and D in the CameraInfo; against the raw cameras' R_i, T_i, K_i, D_i."""
    drive = changeable.rename(changeable.with_name("2011_09_26_drive_0009_extract"))
    recording = opened(drive)
    info = messages(recording, f"/cam{camera:02d}/camera_info")[0]
    image = messages(recording, f"/cam{camera:02d}/image_raw")[0]
    assert image.camera_info.header == info.header == image.header
    assert (info.width, info.height) == (1392, 512)
    numbers, T_cam0_velodyne = of_date(drive)
    xyz = in_front(messages(recording, "/velodyne_points")[0].xyz.astype(float))
    T = fixed_transform(recording, "velodyne", info.header.frame_id)
    rectified = se3.apply(se3.inverse(T), xyz)
    of = f"{camera:02d}"
    R, K, T_i = (numbers[f"{name}_{of}"] for name in ("R", "K", "T"))
    in_cam0 = se3.apply(T_cam0_velodyne, xyz)
    there = se3.apply(se3.from_parts(R.reshape(3, 3), T_i), in_cam0)
    expected, _ = cv2.projectPoints(
        there, np.zeros(3), np.zeros(3), K.reshape(3, 3), numbers[f"D_{of}"]
    )
    turned_back, _ = cv2.Rodrigues(info.R.T)
    found, _ = cv2.projectPoints(rectified, turned_back, np.zeros(3), info.K, info.D)
    inside = ((expected > 0) & (expected < [1392, 512])).all(axis=(1, 2))
    assert inside.sum() > 1000
    assert np.abs(found - expected)[inside].max() < 1


@pytest.mark.parametrize("which", ["drive_0009", "drive_0052"])
def test_points_fit_the_images_edges_better_than_turned_by_a_degree(opened, which, request):
    """Method: J. Levinson, S. Thrun, Automatic Online Calibration of Cameras and Lasers, 2013."""
    recording = opened(request.getfixturevalue(which))
    corners = [depth_edges(cloud) for cloud in messages(recording, "/velodyne_points")]
    cameras = [name for name in recording.topics if name.endswith("image_rect")]
    views = [
        (points, nearness, image, fixed_transform(recording, "velodyne", image.header.frame_id))
        for name in cameras
        for points, image in zip(corners, messages(recording, name), strict=True)
        for nearness in [nearness_of_edges(image)]
    ]
    turns = [axis * sign for axis in np.eye(3) for sign in (1, -1)]
    straight, *turned = [fit(views, np.radians(turn)) for turn in [np.zeros(3), *turns]]
    assert straight > 1.02 * max(turned)


def depth_edges(cloud):
    """Points that are nearer by metres than their neighbours, beside them or above."""
    xyz = cloud.xyz.astype(float)
    distance = np.linalg.norm(xyz, axis=1)
    beside = np.maximum(np.roll(distance, 1), np.roll(distance, -1)) - distance
    is_edge = np.maximum(beside, np.where(xyz[:, 2] > -1.3, above(xyz, distance), 0)) > 1
    return xyz[is_edge & (xyz[:, 0] > 3) & (distance > 4) & (distance < 30)]


def above(xyz, distance):
    """How much farther the point of the same azimuth in the next higher ring is, or 0."""
    azimuth = np.arctan2(xyz[:, 1], xyz[:, 0]) % (2 * np.pi)
    ring = np.cumsum(np.concatenate([[0], np.diff(azimuth) < -np.pi]))
    farther = np.zeros(len(xyz))
    for number in range(1, ring[-1] + 1):
        here, higher = np.flatnonzero(ring == number), np.flatnonzero(ring == number - 1)
        higher = higher[np.argsort(azimuth[higher])]
        at = np.searchsorted(azimuth[higher], azimuth[here]).clip(0, len(higher) - 1)
        near = np.abs(azimuth[higher[at]] - azimuth[here]) < 0.006
        farther[here] = np.where(near, distance[higher[at]] - distance[here], 0)
    return farther


def nearness_of_edges(image):
    gray = cv2.cvtColor(image.pixels, cv2.COLOR_BGR2GRAY) if image.is_color else image.pixels
    edges = cv2.Canny(cv2.GaussianBlur(gray, (0, 0), 1), 100, 250)
    return np.exp(-cv2.distanceTransform(255 - edges, cv2.DIST_L2, 5) / 1.5)


def fit(views, rpy):
    """The mean nearness to edges of points, with the cameras turned about their own axes."""
    T_turned = se3.from_pose(np.zeros(3), rotations.from_rpy(rpy))
    found = []
    for points, nearness, image, T_velodyne_camera in views:
        seen = se3.apply(T_turned @ se3.inverse(T_velodyne_camera), points)
        at = np.rint(pixels_of(seen[seen[:, 2] > 1], image.camera_info)).astype(int)
        u, v = at[((at >= 0) & (at < [image.width, image.height])).all(axis=1)].T
        found.append(nearness[v, u].mean())
    return np.mean(found)
