"""The layout of the odometry benchmark, made from a raw drive."""

from contextlib import closing

import numpy as np
import pytest
from kitti_reading import fixed_transform, messages

from ros_visualise.core.errors import OpenError
from ros_visualise.geometry import se3
from ros_visualise.sources.kitti import is_kitti, open_kitti
from ros_visualise.sources.kitti.calibration import read_matrices

TIMES = [0.0, 0.1037, 0.2074, 0.3111, 0.4148]


@pytest.fixture
def sequence(drive_0009, recordings, tmp_path):
    """Sequence 04 of a benchmark, with drive 0009's images and scans."""
    folder = tmp_path / "dataset/sequences/04"
    for number in range(4):
        link(drive_0009 / f"image_{number:02d}/data", folder / f"image_{number}")
    link(drive_0009 / "velodyne_points/data", folder / "velodyne")
    (folder / "times.txt").write_text("".join(f"{time:e}\n" for time in TIMES))
    cam_to_cam = read_matrices(drive_0009.parent / "calib_cam_to_cam.txt")
    velo_to_cam = read_matrices(drive_0009.parent / "calib_velo_to_cam.txt")
    R_rect = cam_to_cam["R_rect_00"].reshape(3, 3)
    Tr = R_rect @ np.column_stack([velo_to_cam["R"].reshape(3, 3), velo_to_cam["T"]])
    rows = {f"P{n}": cam_to_cam[f"P_rect_{n:02d}"] for n in range(4)} | {"Tr": Tr.ravel()}
    calib = [f"{name}: {' '.join(f'{v:.12e}' for v in row)}\n" for name, row in rows.items()]
    (folder / "calib.txt").write_text("".join(calib))
    truth = (recordings / "trajectory/kitti_odom_gt/04.txt").read_text().splitlines()[:5]
    poses = tmp_path / "dataset/poses/04.txt"
    poses.parent.mkdir()
    poses.write_text("\n".join(truth))
    return folder


def link(source, target):
    target.mkdir(parents=True)
    for path in source.iterdir():
        (target / f"{int(path.stem):06d}{path.suffix}").symlink_to(path)


def test_sequence_is_found_from_above(opened, sequence):
    for path in (sequence, *sequence.parents[:2]):
        assert is_kitti(path)
        assert opened(path).path == sequence
    (sequence.parent / "05").symlink_to(sequence)
    with pytest.raises(OpenError, match=r"holds .*04, .*05; choose"):
        open_kitti(sequence.parents[1])


def test_times_are_kept(opened, sequence):
    recording = opened(sequence)
    expected = [round(time * 1e9) for time in TIMES]
    for topic, stamps in recording.stamps_ns().items():
        if topic not in ("/tf_static", "/path"):
            assert stamps.tolist() == expected
    with closing(recording.read()) as entries:
        stamps = [entry.stamp_ns for entry in entries]
    assert stamps == sorted(stamps)
    assert recording.format == "KITTI odometry"
    assert not recording.notes
    assert not recording.loss


def test_images_and_places_are_those_of_the_raw_drive(opened, sequence, drive_0009):
    ours, raw = opened(sequence), opened(drive_0009)
    for camera in range(4):
        topic, frame = f"/cam{camera:02d}", f"cam{camera:02d}_optical"
        image, its = (messages(one, f"{topic}/image_rect")[1] for one in (ours, raw))
        assert np.array_equal(image.pixels, its.pixels)
        info, its = (messages(one, f"{topic}/camera_info")[1] for one in (ours, raw))
        assert np.array_equal(info.P, its.P)
        assert (info.width, info.height) == (its.width, its.height)
        placed, there = (fixed_transform(one, "velodyne", frame) for one in (ours, raw))
        assert placed == pytest.approx(there, abs=1e-6)


def test_truth_is_the_way_of_camera_0(opened, sequence):
    """By /tf, camera 0 moves from its first place as the benchmark says."""
    recording = opened(sequence)
    T_base_cam0 = fixed_transform(recording, "base_link", "cam00_optical")
    truth = np.loadtxt(sequence.parents[1] / "poses/04.txt").reshape(-1, 3, 4)
    poses = [one.transforms[0] for one in messages(recording, "/tf")]
    T_odom_base = [se3.from_pose(one.translation_xyz, one.quat_xyzw) for one in poses]
    T_odom_first = T_odom_base[0] @ T_base_cam0
    for T, expected in zip(T_odom_base, truth, strict=True):
        moved = se3.inverse(T_odom_first) @ T @ T_base_cam0
        assert moved[:3] == pytest.approx(expected, abs=1e-5)
    assert T_odom_base[0] == pytest.approx(np.eye(4), abs=1e-5)
    assert T_odom_base[-1][:3, 3] == pytest.approx([5.2, 0, 0], abs=0.3)  # ahead, on the road


def test_truth_has_its_velocity(opened, sequence):
    odometry = messages(opened(sequence), "/odom")
    (path,) = messages(opened(sequence), "/path")
    assert np.array_equal(path.positions_xyz, [one.position_xyz for one in odometry])
    way = np.linalg.norm(np.diff(path.positions_xyz, axis=0), axis=1) / 0.1037
    assert odometry[2].linear_xyz[0] == pytest.approx(way[1:3].mean(), rel=0.01)
    assert np.abs(odometry[2].angular_xyz).max() < 0.05


def test_parts_of_a_sequence_will_do(opened, sequence):
    for path in sequence.iterdir():
        if path.name not in ("image_0", "times.txt", "calib.txt"):
            path.rename(sequence.parents[2] / path.name)
    (sequence.parents[1] / "poses/04.txt").unlink()
    (sequence / "image_0/000002.png").unlink()
    recording = opened(sequence)
    assert set(recording.topics) == {"/cam00/image_rect", "/cam00/camera_info", "/tf_static"}
    assert len(messages(recording, "/cam00/image_rect")) == 4
    assert recording.loss.notes == ["image_0: 1 of 5 frames are missing"]


def test_without_scanner_the_cameras_look_ahead_over_the_road(opened, sequence):
    """Of the download of gray images, whose calib.txt has no Tr."""
    lines = (sequence / "calib.txt").read_text().splitlines()
    (sequence / "calib.txt").write_text("\n".join(lines[:4]))
    recording = opened(sequence)
    T = fixed_transform(recording, "base_link", "cam01_optical")
    assert T[:3, 2].tolist() == pytest.approx([1, 0, 0])
    assert T[:3, 3] == pytest.approx([0, -0.537, 1.65], abs=0.01)
    assert "no Tr" in recording.notes[0]


def test_damaged_calibration_is_said(opened, sequence):
    path = sequence / "calib.txt"
    whole = path.read_bytes()
    for cut in (whole.index(b"Tr:") + 2, len(whole) - 2):
        path.write_bytes(whole[:cut])
        (note,) = opened(sequence).loss.notes
        said = "Tr is missing or damaged; skipped: base_link -> velodyne"
        assert note == f"calib.txt: {said}"
    path.write_bytes(whole.replace(b"P2:", b"P9:"))
    recording = opened(sequence)
    (note,) = recording.loss.notes
    said = "P2 is missing or damaged; skipped: /cam02/camera_info, cam02_optical"
    assert note == f"calib.txt: {said}"
    assert recording.loss.messages == 5


@pytest.mark.parametrize(("kept", "lost"), [(0, 5), (13, 4), (63, 1)])
def test_times_that_are_cut_off_are_said(opened, sequence, kept, lost):
    path = sequence / "times.txt"
    path.write_bytes(path.read_bytes()[:kept])
    recording = opened(sequence)
    (note,) = recording.loss.notes
    assert note.startswith(f"times.txt: {lost} of 5 times are missing or damaged; frames")
    assert len(messages(recording, "/cam00/image_rect")) == 5


def test_poses_of_the_whole_for_a_part_are_no_loss(opened, sequence, recordings):
    """Of a sequence of which somebody kept a few frames and their times."""
    whole = (recordings / "trajectory/kitti_odom_gt/04.txt").read_bytes()
    (sequence.parents[1] / "poses/04.txt").write_bytes(whole)
    recording = opened(sequence)
    assert len(recording.stamps_ns()["/odom"]) == 271
    assert not recording.loss
    assert recording.notes[0].startswith(
        "poses: more than the 5 times of times.txt; frames without a time"
    )


@pytest.mark.parametrize("kept", [0, 1, 3])
def test_poses_that_are_cut_off_are_said(opened, sequence, kept):
    path = sequence.parents[1] / "poses/04.txt"
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[:kept], lines[kept][:-1]]) if kept else "")
    recording = opened(sequence)
    assert "/odom" not in recording.topics if not kept else True
    assert len(messages(recording, "/odom")) == kept
    (note,) = recording.loss.notes
    said = f"{5 - kept} of 5 poses are missing or damaged"
    said += "; their messages on /odom and /tf skipped"
    assert note == f"../../poses/04.txt: {said}"


def test_damaged_poses_are_left_out(opened, sequence):
    path = sequence.parents[1] / "poses/04.txt"
    lines = path.read_text().splitlines()
    lines[1:3] = ["nan " * 12, "1 2 3"]
    path.write_text("\n".join(lines))
    recording = opened(sequence)
    expected = [round(TIMES[number] * 1e9) for number in (0, 3, 4)]
    assert recording.stamps_ns()["/odom"].tolist() == expected
    assert recording.loss.messages == 4  # of /odom and /tf
    (note,) = recording.loss.notes
    assert note.startswith("../../poses/04.txt: 2 of 5 poses are missing or damaged")
