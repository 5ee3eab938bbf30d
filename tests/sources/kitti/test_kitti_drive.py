"""What a raw drive's recording holds, and how it is read."""

from collections import Counter
from contextlib import closing

import cv2
import numpy as np
import pytest
from kitti_reading import fixed_transform, messages, replace_file

from ros_visualise.data import Deferred
from ros_visualise.messages import to_message
from ros_visualise.messages.definitions import Definitions

FRAMES = 5
CAMERA = {"image_rect", "camera_info"}
TOPICS = {
    **{f"/cam{number:02d}/{what}": FRAMES for number in range(4) for what in CAMERA},
    **dict.fromkeys(("/imu/data", "/gps/fix", "/gps/vel", "/odom", "/tf"), FRAMES),
    "/velodyne_points": FRAMES,
    "/path": 1,
    "/tf_static": 1,
}


def test_topics_are_those_of_the_sensors(opened, drive_0009):
    recording = opened(drive_0009)
    topics = {name: info.messages for name, info in recording.topics.items()}
    assert {name: topics[name] for name in TOPICS} == TOPICS
    assert list(topics) == sorted(topics)
    with closing(recording.read()) as entries:
        assert Counter(entry.topic for entry in entries) == topics
    assert not recording.loss
    assert not recording.notes
    assert (recording.format, recording.compression) == ("KITTI raw", "none")


def test_whole_recording_spans_its_stamps(opened, drive_0009):
    recording = opened(drive_0009)
    with closing(recording.read()) as entries:
        stamps = [entry.stamp_ns for entry in entries]
    assert (recording.start_ns, recording.end_ns) == (stamps[0], stamps[-1])
    assert sorted(stamps) == sorted(np.concatenate(list(recording.stamps_ns().values())).tolist())
    assert recording.size == sum(
        path.stat().st_size
        for kind in ("*/data/*.png", "*/data/*.bin", "oxts/data/*.txt")
        for path in drive_0009.glob(kind)
    )


def test_every_message_is_one_of_ros_and_stamped_as_its_entry(opened, drive_0009):
    types = Definitions("ros1")
    recording = opened(drive_0009)
    with closing(recording.read()) as entries:
        for entry in entries:
            assert entry.message.header.stamp_ns == entry.stamp_ns
            info = recording.topics[entry.topic].type
            assert entry.message.type_name == info.name
            assert types.write(info.name, to_message(entry.message, types.types))


def test_latched_are_what_late_comers_need(opened, drive_0009):
    topics = opened(drive_0009).topics
    assert {name for name, info in topics.items() if info.type.qos.transient_local} == {
        "/path",
        "/tf_static",
    }


@pytest.mark.parametrize(("camera", "encoding"), [(0, "mono8"), (3, "bgr8")])
def test_images_are_those_in_the_files(opened, drive_0009, camera, encoding):
    found = messages(opened(drive_0009), f"/cam{camera:02d}/image_rect")
    flag = cv2.IMREAD_COLOR if encoding == "bgr8" else cv2.IMREAD_GRAYSCALE
    for number, image in enumerate(found):
        path = drive_0009 / f"image_{camera:02d}/data/{number:010d}.png"
        assert isinstance(image.data, Deferred)
        assert image.encoding == encoding
        assert image.header.frame_id == f"cam{camera:02d}_optical"
        assert (image.width, image.height) == (1242, 375)
        assert np.array_equal(image.pixels, cv2.imread(str(path), flag))


def test_images_are_decoded_ahead_only_while_somebody_looks(opened, drive_0009, monkeypatch):
    decoded = []
    decode = cv2.imdecode
    monkeypatch.setattr(cv2, "imdecode", lambda *a: decoded.append(1) or decode(*a))
    recording = opened(drive_0009)
    messages(recording, "/cam00/image_rect")
    assert not decoded
    for image in messages(recording, "/cam00/image_rect"):
        assert image.pixels is image.pixels
    assert len(decoded) == FRAMES


def test_clouds_are_those_in_the_files(opened, drive_0009):
    for number, cloud in enumerate(messages(opened(drive_0009), "/velodyne_points")):
        path = drive_0009 / f"velodyne_points/data/{number:010d}.bin"
        rows = np.fromfile(path, "<f4").reshape(-1, 4)
        assert cloud.points.dtype.names == ("x", "y", "z", "intensity")
        assert np.array_equal(cloud.xyz, rows[:, :3])
        assert np.array_equal(cloud.points["intensity"], rows[:, 3])
        assert cloud.is_dense
        assert cloud.header.frame_id == "velodyne"


def test_each_scan_says_when_it_began_and_ended(opened, drive_0009):
    recording = opened(drive_0009)
    clouds = messages(recording, "/velodyne_points")
    for what in ("start", "end"):
        lines = (drive_0009 / f"velodyne_points/timestamps_{what}.txt").read_text().splitlines()
        found = messages(recording, f"/velodyne_points/scan_{what}")
        assert [one.time_ns for one in found] == [
            np.datetime64(line, "ns").astype(int) for line in lines
        ]
        assert [one.header for one in found] == [cloud.header for cloud in clouds]


def test_part_is_read_without_what_is_before_and_after(opened, changeable):
    for number in (0, 1, 4):
        name = f"{number:010d}"
        replace_file(changeable / f"velodyne_points/data/{name}.bin", b"broken")
        replace_file(changeable / f"image_02/data/{name}.png", b"broken")
    recording = opened(changeable)
    clouds = recording.stamps_ns()["/velodyne_points"]
    start_ns, stop_ns = int(clouds[2]), int(clouds[4])
    with closing(recording.read(start_ns, stop_ns)) as entries:
        found = [entry for entry in entries if entry.topic == "/velodyne_points"]
    assert [entry.stamp_ns for entry in found] == clouds[2:4].tolist()
    assert not recording.loss


def test_only_topics_asked_for_are_touched(opened, changeable):
    for path in changeable.glob("velodyne_points/data/*"):
        replace_file(path, b"broken")
    recording = opened(changeable)
    with closing(recording.read(topics=["/imu/data", "/nowhere"])) as entries:
        assert [entry.topic for entry in entries] == ["/imu/data"] * FRAMES
    assert not recording.loss


def test_frames_hang_together_as_the_car_is_built(opened, drive_0009):
    """The heights over the road are those on KITTI's page of the setup."""
    recording = opened(drive_0009)
    heights = {"imu_link": 0.93, "velodyne": 1.73, "cam00_optical": 1.65, "cam03_optical": 1.65}
    for frame, height in heights.items():
        assert fixed_transform(recording, "base_link", frame)[2, 3] == pytest.approx(
            height, abs=0.03
        )
    forward = fixed_transform(recording, "velodyne", "cam02_optical")[:3, 2]
    assert forward == pytest.approx([1, 0, 0], abs=0.03)
    assert np.array_equal(fixed_transform(recording, "map", "odom"), np.eye(4))


@pytest.mark.parametrize("kept", ["image_03", "velodyne_points", "oxts"])
def test_any_sensor_alone_is_a_recording(opened, changeable, kept):
    for folder in changeable.iterdir():
        if folder.name != kept:
            folder.rename(changeable.parent / f"other_{folder.name}")
    recording = opened(changeable)
    topics = {
        "image_03": {"/cam03/image_rect", "/cam03/camera_info"},
        "velodyne_points": {name for name in TOPICS if name.startswith("/velodyne")},
        "oxts": {"/imu/data", "/gps/fix", "/gps/vel", "/odom", "/tf", "/path"},
    }
    found = {name for name in recording.topics if "/scan_" not in name}
    assert found == topics[kept] | {"/tf_static"}
    with closing(recording.read()) as entries:
        assert Counter(entry.topic for entry in entries) == {
            name: info.messages for name, info in recording.topics.items()
        }


def test_closing_ends_what_is_being_read(opened, drive_0009):
    recording = opened(drive_0009)
    with closing(recording.read()) as entries:
        next(entries)
        recording.close()
        assert list(entries) == []
