"""A launch file of ROS 2 starts what that of ROS 1 starts, with the same arguments."""

from __future__ import annotations

from typing import Any

import pytest
import ros2_launch
from launched import LAUNCH, NEEDED, effective
from ros2_launch import full

FILES = sorted(path.stem for path in LAUNCH.glob("*.launch"))
OTHER_NAMES = {"rviz": "rviz2", "usb_cam_node": "usb_cam_node_exe"}
GIVEN: dict[str, list[dict[str, Any]]] = {
    "main_video": [
        {"pipeline": "true", "view": "web", "port": 8099, "size": "64x48"},
        {"view": "web", "rqt": "true", "rviz": "false", "fps": 12, "image_transport": "compressed"},
        {"camera_info_url": "/a b.yaml", "loop": "true", "duration": 2, "rate": 0},
    ],
    "main_rosbag": [
        {"pipeline": "true", "image": "/cam00/image_rect", "topics": "/imu /tf"},
        {"bag": "/it's mine.bag", "view": "none", "frame": "odom", "clock": "false"},
    ],
    "main_usb_cam": [
        {"pipeline": "true", "device": "test", "size": "64x48"},
        {"camera_driver": "usb_cam", "view": "web"},
    ],
    "main_path": [
        {"bag": "none"},
        {"bag": "none", "simulator": "quadrotor", "mission": "square", "seed": 3, "view": "web"},
        {"bag": "none", "simulator": "none", "odom": "/wheels"},
        {"bag": "/it's mine.bag", "topics": "/odom", "frame": "world"},
    ],
    "main_robots": [{"bag": "none"}, {"bag": "none", "view": "web", "second": "rover", "seed": 4}],
    "main_landmarks": [
        {"source": "simulator", "world": "playpen", "objects": "true", "model": "/own.onnx"},
        {"source": "video", "tag_size": 0.16, "view": "web", "fixed_frame": "odom"},
        {"source": "camera", "tags": "/tags.yaml", "map": "/map.yaml", "rqt": "true"},
        {"source": "bag", "view": "none", "start": 3},
        {"source": "none"},
    ],
    "main_navigation": [
        {"source": "simulator", "seed": 3},
        {"source": "bag", "odom": "/vio", "map": "/it's mine.yaml", "view": "none"},
        {"source": "none", "mode": "frozen", "map": "/map.yaml", "tags": "/tags.yaml"},
    ],
    "pipeline": [
        {"source": "streamer", "nodes": "filters", "rate": 0.5},
        {"source": "camera", "device": "test", "camera_info_url": "/a.yaml"},
        {"source": "landscape", "size": "64x48"},
    ],
    "simulator": [{"robot": "quadrotor", "tf_prefix": "uav1", "clock": "false"}],
    "node": [{"node": "vignette", "takes": "image_raw", "input": "/there"}, {"name": "mine"}],
    "landmark_detector": [{"model": "/own.onnx", "names": "/names.txt"}],
}
ROBOTS = {"simulator": "robot: husky, quadrotor or none (one that is already running)"}
"""What there is of Gazebo differs: ROS 2's is started by packages of its own."""


def started_by_ros1(name: str, args: dict[str, Any]) -> dict[str, Any]:
    from test_launch_files import Launched

    launched = Launched(name, **args)
    is_simulated = "/use_sim_time" in launched.config.params
    started: dict[str, Any] = {}
    for node in launched.config.nodes:
        namespace = node.namespace.rstrip("/")
        full_name = f"{namespace}/{node.name}"
        is_ours = node.package == "ros_visualise"  # others have other parameters on ROS 2
        given = launched.params(full_name.removeprefix("/"))
        started[full_name] = {
            "runs": (OTHER_NAMES.get(node.package, node.package), _type(node.type)),
            "params": effective(given) if is_ours else {},
            "remaps": {full(namespace, a): full(namespace, b) for a, b in node.remap_args},
            "is simulated": is_simulated,
        }
    return started


def started_by_ros2(name: str, args: dict[str, Any]) -> dict[str, Any]:
    launched = ros2_launch.Launched(name, **args)
    started: dict[str, Any] = {}
    for node in launched.all:
        launched.nodes = {node.name: node}
        started[node.name] = {
            "runs": (node.package, node.type),
            "params": launched.params(node.name) if node.package == "ros_visualise" else {},
            "remaps": {full(node.namespace, a): full(node.namespace, b) for a, b in node.remaps},
            "is simulated": node.params.get("use_sim_time", False),
        }
    return started


def _type(executable: str) -> str:
    return OTHER_NAMES.get(executable, executable)


CASES = [(name, args) for name in FILES for args in [{}, *GIVEN.get(name, [])]]


@pytest.mark.parametrize(("name", "args"), CASES)
def test_both_start_the_same(name: str, args: dict[str, Any]) -> None:
    ros1, ros2 = started_by_ros1(name, args), started_by_ros2(name, args)
    assert ros2.keys() == ros1.keys()
    for node, expected in ros1.items():
        if node == "/usb_cam":  # its topics are relative to the namespace there, not to the node
            expected["remaps"] = {}
        assert ros2[node] == expected, node


@pytest.mark.parametrize("name", FILES)
def test_both_have_the_same_arguments(name: str) -> None:
    from roslaunch.arg_dump import get_args

    ros1 = get_args([str(LAUNCH / f"{name}.launch")])
    ros2 = ros2_launch.Launched(name, bag="none").arguments
    expected = {
        arg: (doc, arg not in NEEDED or default is not None) for arg, (doc, default) in ros1.items()
    }
    if name == "main_path":
        expected["simulator"] = (ROBOTS["simulator"], True)
    assert ros2 == expected


def test_none_is_left_out() -> None:
    assert (
        sorted(path.name.removesuffix(".launch.xml") for path in LAUNCH.glob("*.launch.xml"))
        == FILES
    )
