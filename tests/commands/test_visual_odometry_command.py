"""`ros-visualise odometry`: files that other programs read, and what it refuses."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest
from visual_flight import Flight, felt, place

from ros_visualise.commands import main
from ros_visualise.commands.odometry import work
from ros_visualise.data import Header, Image, Transforms, TransformStamped
from ros_visualise.estimation.visual.focal import FocalLength
from ros_visualise.messages.recorded import TopicType
from ros_visualise.sinks import open_recorder


@pytest.fixture
def run(monkeypatch, capsys):
    """Run the command; its exit status, output and errors."""
    monkeypatch.setattr("signal.signal", lambda *_: None)

    def run(*arguments):
        status = main(["odometry", *map(str, arguments)])
        said = capsys.readouterr()
        return status, said.out, said.err

    return run


def test_a_drive_has_the_length_and_the_end_of_the_truth(recordings, run, tmp_path):
    drive, out = recordings / "kitti_vo" / "sequence_1", tmp_path / "way"
    named = [f"--out={out}.tum", f"--out={out}.kitti", f"--covariances={out}.txt"]
    options = ["--height", 1.65, "--frames", 14, "--plot", f"{out}.svg", "--json"]
    status, said, _ = run(drive, *options, *named)
    report = json.loads(said)
    truth = np.loadtxt(drive / "poses.txt")[:14].reshape(-1, 3, 4)
    poses = np.loadtxt(f"{out}.kitti").reshape(-1, 3, 4)
    way = np.linalg.norm(truth[-1, :, 3])
    assert (status, report["in_metres"], report["poses"]) == (0, True, 14)
    assert report["focal_length_px"] == pytest.approx(707.09, abs=0.01)  # of its calib.txt
    assert report["without_pose"] == {}  # the first have poses once a motion is seen
    assert np.linalg.norm(poses[-1, :, 3] - truth[-1, :, 3]) < 0.03 * way
    assert np.loadtxt(f"{out}.tum").shape == (14, 8)
    covariances = np.loadtxt(f"{out}.txt")[:, 1:].reshape(-1, 6, 6)
    assert np.linalg.eigvalsh(covariances[-1]).min() > 0
    assert np.sqrt(np.trace(covariances[-1, :3, :3])) < 0.1 * way


def test_a_stereo_pair_gives_metres(recordings, run):
    status, said, _ = run(recordings / "kitti" / "drive0009_f000-004", "--json")
    report = json.loads(said)
    assert (status, report["in_metres"]) == (0, True)
    assert report["length"] == pytest.approx(4.489, rel=0.02)  # of its odometry


def test_images_of_a_camera_at_rest_are_refused(run, tmp_path):
    noise = np.random.default_rng(0)
    picture = cv2.resize(noise.integers(0, 255, (30, 40), np.uint8), (320, 240))
    for number in range(4):
        grains = noise.normal(0, 2, picture.shape)
        seen = np.clip(picture + grains, 0, 255).astype(np.uint8)
        cv2.imwrite(str(tmp_path / f"{number}.png"), seen)
    status, _, said = run(tmp_path)
    assert status == 2
    assert "no trajectory in 4 images: waiting for motion" in said


@pytest.mark.parametrize(
    ("focal", "says"),
    [
        (FocalLength(0.8125, True), "estimated from the images as 260 px; it can be wrong"),
        (FocalLength(0.8125, False), "assumed to be 260 px, because the images do not show it"),
    ],
)
def test_the_origin_of_a_focal_length_is_stated(run, tmp_path, monkeypatch, focal, says):
    for number in range(8):
        cv2.imwrite(str(tmp_path / f"{number}.png"), Flight().image(number))
    monkeypatch.setattr(work, "find_focal_length", lambda _: focal)
    status, said, errors = run(tmp_path)
    assert status == 0
    assert f"no calibration: focal length {says}" in errors
    assert said.startswith("images:    8, 8 with a pose, ")
    assert "no pose" not in said  # the first have one since a motion was seen


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (["--out", "way.csv"], "give a name that ends in .tum or .kitti"),
        (["--plot", "way.csv"], "give a name that ends in"),
        (["--corners", 3], "give at least 50"),
        (["--scale", "/odom"], "a folder of pictures has no topics"),
    ],
)
def test_wrong_usage_is_one_line(run, tmp_path, words, why):
    cv2.imwrite(str(tmp_path / "0.png"), np.zeros((60, 80), np.uint8))
    status, said, told = run(tmp_path, *words)
    assert (status, said) == (2, "")
    assert why in told
    assert told.count("\n") == 1


@pytest.fixture
def recorded_flight(tmp_path):
    """A drawn flight: a camera, and an IMU that is turned as the ground is, at the same place."""
    flight, path = Flight(), tmp_path / "flight.bag"
    topics = {"/image_raw": "sensor_msgs/msg/Image", "/imu": "sensor_msgs/msg/Imu"}
    topics |= {"/camera_info": "sensor_msgs/msg/CameraInfo", "/tf_static": "tf2_msgs/msg/TFMessage"}
    header = Header(0, "imu")
    same = TransformStamped("camera", np.zeros(3), np.array([0, 0, 0, 1.0]), header)
    types = {name: TopicType(kind) for name, kind in topics.items()}
    with open_recorder(str(path), types) as recorder:
        recorder.write("/tf_static", Transforms((same,)), 10**7)
        for n in range(1, 260):
            stamp_ns = n * 10**7
            recorder.write("/imu", felt(flight, n / 100), stamp_ns)
            if n % 10 == 0:
                header = Header(stamp_ns, "camera")
                recorder.write("/camera_info", replace(flight.info, header=header), stamp_ns)
                image = Image(flight.image(place(n / 100)), "mono8", header)
                recorder.write("/image_raw", image, stamp_ns)
    return flight, path


def test_an_imu_in_a_recording_gives_metres(recorded_flight, run, tmp_path):
    flight, path = recorded_flight
    out = tmp_path / "way.tum"
    status, said, _ = run(path, "--imu", "/imu", "--corners", 120, "--out", out, "--json")
    report, way = json.loads(said), np.loadtxt(out)
    first, last = (flight.p(place(stamp_s)) for stamp_s in way[[0, -1], 0])
    assert (status, report["in_metres"]) == (0, True)
    true = np.linalg.norm(last - first)
    assert np.linalg.norm(way[-1, 1:4]) == pytest.approx(true, rel=0.03)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--imu", "/image_raw"], "no IMU measurements on /image_raw"),
        (["--imu", "/imu0"], "no topic /imu0"),
        (["--imu", "/imu", "--height", "2"], "omit --height and --scale"),
        (["--imu", "/imu", "--readout", "300"], "give milliseconds, at most 200"),
    ],
)
def test_wrong_use_of_an_imu_is_reported(recorded_flight, run, options, says):
    status, _, said = run(recorded_flight[1], *options)
    assert status == 2
    assert says in said
