"""`ros-visualise landmarks --map` of two cameras on a rig; the pictures share no code with it."""

import json

import camera_pictures as pictures
import cv2
import numpy as np
import pytest
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from ros_visualise.commands import main
from ros_visualise.core.yaml_files import load_yaml

WALL = {0: (0, 0), 3: (0.45, 0.3), 5: (0.5, -0.35), 8: (1, 0.05), 11: (1.45, 0.35), 20: (2.5, -0.1)}
"""Where tags hang on a wall, metres to the right and up; only the right camera sees the last."""
BASELINE = np.array([0.3, 0.02, -0.05])
"""The right camera in the axes of the left one."""
FRAMES, IMAGE = "tf2_msgs/msg/TFMessage", "sensor_msgs/msg/Image"
INFO = "sensor_msgs/msg/CameraInfo"
CAMERA = pictures.Camera(D=(-0.1, 0.01, 0.0, 0.0, 0.0), noise=(0.7, 1.0), blur=(0.5, 0.6))


def turned(vector):
    return cv2.Rodrigues(np.asarray(vector, float))[0]


RIGHT = turned([0.05, 0.2, -0.03])
"""R_left_right."""


@pytest.fixture(scope="module")
def pairs():
    """Pictures by the left and the right camera, moving along the wall."""
    random = np.random.default_rng(7)
    found = []
    for number in range(8):
        tilt = turned(0.1 * random.standard_normal(3))
        R = np.diag([1.0, -1, -1]) @ tilt  # of the left camera on the wall
        at = np.array([0.16 * number, 0.1 * np.sin(number), 1.9 + 0.25 * np.cos(2 * number)])
        left, shown = seen_from(R, at, random)
        right, _ = seen_from(R @ RIGHT, at + R @ BASELINE, random)
        assert 20 not in shown
        found.append({"left": left, "right": right})
    return found


def seen_from(R, at, random):
    """The picture of all tags that are whole in it, and their ids."""
    gray, shown = np.full((pictures.HEIGHT, pictures.WIDTH), 110, np.uint8), []
    for id, (x, y) in WALL.items():
        pose = pictures.Pose(R.T, R.T @ (np.array([x, y, 0.0]) - at), np.zeros(3))
        corners = pictures.corners_of(CAMERA, pose)
        low, high = corners.min(axis=0) - 14, corners.max(axis=0) + 14
        if (low > 0).all() and (high < gray.shape[::-1]).all():
            part = np.s_[int(low[1]) : int(high[1]), int(low[0]) : int(high[0])]
            gray[part] = pictures.take(CAMERA, pose, id, random)[part]
            shown.append(id)
    return gray, shown


@pytest.fixture
def mapped(pairs, tmp_path, monkeypatch, capsys):
    """What is said of the right camera, and how far tags are from where they hang."""
    monkeypatch.setattr("signal.signal", lambda *_: None)

    def mapped(on_tf=None):
        bag, out = tmp_path / "rig.bag", tmp_path / "map.yaml"
        write(bag, pairs, on_tf)
        options = ["--size", "0.2", "--map", str(out), "--json"]
        assert main(["landmarks", str(bag), *options]) == 0
        [right] = json.loads(capsys.readouterr().out)["smoothing"]["cameras"]
        assert right["name"] == "/right/image_raw"
        return right, off_m(load_yaml(out)["landmarks"])

    return mapped


def write(path, pairs, on_tf):
    """A bag of images with calibrations; ``on_tf``: R_left_right, None: no tf."""
    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", FRAMES))

    def make(name, *values):
        package = "std" if name == "Header" else "sensor" if "I" in name else "geometry"
        return store.types[f"{package}_msgs/msg/{name}"](*values)

    def header(stamp_ns, side):
        stamp = store.types["builtin_interfaces/msg/Time"](*divmod(stamp_ns, 10**9))
        return make("Header", 0, stamp, f"{side}_optical")

    with Writer(path) as bag:
        topics = {}

        def put(topic, name, stamp_ns, message):
            if topic not in topics:
                topics[topic] = bag.add_connection(topic, name, typestore=store)
            bag.write(topics[topic], stamp_ns, store.serialize_ros1(message, name))

        if on_tf is not None:
            w = cv2.Rodrigues(on_tf)[0].ravel()
            angle = np.linalg.norm(w)
            quat = make("Quaternion", *(w / angle * np.sin(angle / 2)), np.cos(angle / 2))
            moved = make("Transform", make("Vector3", *BASELINE), quat)
            head = header(10**12, "left")
            static = make("TransformStamped", head, "right_optical", moved)
            put("/tf_static", FRAMES, 10**12, store.types[FRAMES]([static]))
        for number, pair in enumerate(pairs):
            stamp_ns = 10**12 + number * 10**9
            for side, gray in pair.items():
                head, (height, width) = header(stamp_ns, side), gray.shape
                K, R, P = CAMERA.matrix.ravel(), np.eye(3).ravel(), np.zeros(12)
                roi = make("RegionOfInterest", 0, 0, 0, 0, False)
                lens = "plumb_bob", np.array(CAMERA.D), K, R, P
                info = make("CameraInfo", head, height, width, *lens, 0, 0, roi)
                put(f"/{side}/camera_info", INFO, stamp_ns, info)
                image = make("Image", head, height, width, "mono8", 0, width, gray.ravel())
                put(f"/{side}/image_raw", IMAGE, stamp_ns, image)


def off_m(landmarks):
    """By how much tags are elsewhere, seen from the tag that the map begins with."""
    places = {int(one["name"].rpartition("_")[2]): one["pose"]["position"] for one in landmarks}
    assert set(places) == set(WALL)
    here = np.array([places[id] for id in WALL])
    there = np.array([[*at, 0.0] for at in WALL.values()])
    first = int(np.linalg.norm(here, axis=1).argmin())
    return np.linalg.norm(here - here[first] - there + there[first], axis=1).max()


def test_two_cameras_without_tf_make_one_map_and_tell_how_they_are_mounted(mapped):
    right, off = mapped()
    assert right["estimated"]
    assert off < 0.01
    shift = np.abs(np.array(right["position"]) - BASELINE)
    assert (shift < 4 * np.array(right["sigma_m"])).all()
    assert shift.max() < 0.01
    x, y, z, w = right["orientation"]
    axis = np.array([x, y, z]) / np.linalg.norm([x, y, z])
    found = turned(2 * np.arctan2(np.linalg.norm([x, y, z]), w) * axis)
    assert np.rad2deg(np.linalg.norm(cv2.Rodrigues(found @ RIGHT.T)[0])) < 0.3


def test_a_transform_between_cameras_that_is_turned_by_a_degree_is_estimated(mapped):
    right, off = mapped(on_tf=RIGHT @ turned([0, np.deg2rad(-1.0), 0]))
    assert not right["estimated"]
    np.testing.assert_allclose(right["turn_degrees"], [0, 1.0, 0], atol=0.25)
    assert off < 0.01
