"""``info`` agrees with ROS's own ``rosbag info`` on every real bag."""

import shutil
import subprocess

import pytest
import rosbag
import yaml

from ros_visualise.sources import info

NAMES = [
    "evo_ROS_example",
    "evo_tf_example",
    "foxglove_example",
    "foxglove_example-lz4",
    "robot_localization_test1",
]


@pytest.fixture(scope="module", params=NAMES)
def path(recordings, request):
    return recordings / "bags" / f"{request.param}.bag"


@pytest.fixture(scope="module")
def theirs(path):
    tool = shutil.which("rosbag")
    assert tool, "rosbag is not installed here: apt install python3-rosbag rosbag"
    command = [tool, "info", "--yaml", "--freq", str(path)]
    return yaml.safe_load(subprocess.check_output(command, text=True, timeout=60))


@pytest.fixture(scope="module")
def ours(path):
    return info(path)


def named(topic):
    """Ours always begin with a slash; one of the bags leaves it out."""
    return "/" + topic.lstrip("/")


def test_the_bag(ours, theirs):
    assert ours["path"] == theirs["path"]
    assert ours["format"] == f"rosbag {theirs['version']}"
    assert ours["size"] == theirs["size"]
    assert ours["messages"] == theirs["messages"]
    assert ours["compression"] == theirs["compression"]
    assert not any(ours["lost"].values())


def test_its_times(path, ours, theirs):
    """Where chunks overlap, ROS takes the end of the chunk that was written last for the bag's."""
    with rosbag.Bag(str(path)) as bag:
        ends = [chunk.end_time.to_sec() for chunk in bag._chunks]
    assert ends[-1] == pytest.approx(theirs["end"], abs=1e-5)
    assert ours["start"] == pytest.approx(theirs["start"], abs=1e-5)
    assert ours["end"] == pytest.approx(max(ends), abs=1e-5)
    assert ours["duration"] == pytest.approx(max(ends) - theirs["start"], abs=1e-5)
    if path.stem != "evo_ROS_example":
        assert ours["duration"] == pytest.approx(theirs["duration"], abs=1e-5)


def test_its_types(ours, theirs):
    expected = {kind["type"].replace("/", "/msg/"): kind["md5"] for kind in theirs["types"]}
    assert ours["types"] == expected


def test_its_topics(ours, theirs):
    expected = {named(topic["topic"]): topic for topic in theirs["topics"]}
    assert list(ours["topics"]) == sorted(expected)
    for name, topic in ours["topics"].items():
        found = expected[name]
        assert topic["type"] == found["type"].replace("/", "/msg/")
        assert topic["messages"] == found["messages"]
        assert topic["connections"] == found.get("connections", 1)
        if topic["hz"] is None:
            assert "frequency" not in found
        else:  # ROS's times are floating-point seconds, good to a quarter of a microsecond
            assert topic["hz"] == pytest.approx(found["frequency"], rel=2e-3)
