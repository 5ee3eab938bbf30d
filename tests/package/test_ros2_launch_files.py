"""The launch files of ROS 2 start the graphs of `pipelines`, with what the nodes declare.

That they start what those of ROS 1 do, tests in ``tests/ros1`` say.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import pytest
from launched import LAUNCH, NEEDED, OPTIONS, PIPELINE_OPTIONS, PLAYER_OPTIONS, joined
from ros2_launch import Launched, Refused, begun_without, full

from ros_visualise.core.params import update
from ros_visualise.graph.pipelines import (
    alone,
    build,
    simulation_pipeline,
)
from ros_visualise.nodes import NODES, SourceType, find
from ros_visualise.running.executables import names
from ros_visualise.runtime.playing import playing_params

FILES = sorted(path.name.removesuffix(".launch.xml") for path in LAUNCH.glob("*.launch.xml"))
MAIN = [name for name in FILES if name.startswith("main_")]
SINGLE = [name for name in NODES.builtin if name in FILES]
WHAT_IS_PLAYED = {"path", "uri"}


@pytest.mark.parametrize("pipeline", ["false", "true"])
@pytest.mark.parametrize(
    ("name", "args", "source"),
    [
        ("main_video", {}, "streamer"),
        ("main_usb_cam", {}, "camera"),
        ("main_usb_cam", {"camera_driver": "usb_cam"}, None),
        ("main_rosbag", {}, None),
    ],
)
def test_graph_is_that_of_the_pipelines(name, args, source, pipeline):
    launched = Launched(name, pipeline=pipeline, **args)
    expected = build(source, "/image_raw")
    assert launched.graph() == joined(expected)


@pytest.mark.parametrize("robot", ["husky", "quadrotor"])
def test_path_follows_a_simulated_robot(robot):
    launched = Launched("main_path", bag="none", simulator=robot)
    graph, expected = launched.graph(), joined(simulation_pipeline(robot))
    assert graph[robot] == expected[robot]
    assert graph["path"]["odom"] == expected["path"]["odom"]
    assert all(node.params["use_sim_time"] for node in launched.all)


def test_robots_have_a_namespace_each():
    robots = Launched("main_robots", bag="none", second="rover", seed=4)
    assert {node.namespace for node in robots.all} == {"/uav1", "/rover"}
    seeds = {node.name: node.params["seed"] for node in robots.all if node.type == "quadrotor"}
    assert seeds == {"/uav1/quadrotor": 4, "/rover/quadrotor": 5}


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("pipeline", ["false", "true"])
def test_parameters_are_declared(name, pipeline):
    launched = Launched(name, pipeline=pipeline, bag="none", size="640x480")
    for process, node in launched.ours.items():
        given = launched.params(process)
        if node.type == "pipeline":
            inner = {n: v for n, v in given.items() if n not in PIPELINE_OPTIONS}
            for path, value in inner.items():
                check_declared(path.partition("/")[0], {path.partition("/")[2]: value})
        elif node.type in ("node", "viewer"):
            assert set(given) <= OPTIONS
        else:
            options = OPTIONS | (PLAYER_OPTIONS if node.type == "player" else set())
            check_declared(node.type, {n: v for n, v in given.items() if n not in options})


def check_declared(node, given):
    """Give a node's parameters as they are declared, and as these change them."""
    declared = find(node)
    kind = playing_params(declared) if isinstance(declared, SourceType) else declared.params
    return kind(), update(kind(), given)


@pytest.mark.parametrize("name", [name for name in SINGLE if name != "player"])
def test_the_launch_file_of_a_node_is_as_it_declares(name):
    """Its arguments have the defaults of the parameters, and its topics are those of the node."""
    launched = Launched(name)
    params = launched.params(name)
    given = {param: params[param] for param in params.keys() - OPTIONS - WHAT_IS_PLAYED}
    declared, changed = check_declared(name, given)
    assert changed == declared
    [member] = alone(find(name)).members
    node = launched.ours[name]
    topics = {full(node.namespace, topic) for topic, _ in node.remaps}
    assert topics <= {*member.inputs.values(), *member.outputs.values()}


@pytest.mark.parametrize("given", [{"input": "/there"}, {"odom": "/there"}])
def test_inputs_that_are_arguments_arrive(given):
    [argument] = given
    for name in SINGLE:
        if argument in (launched := Launched(name, **given)).arguments:
            assert "/there" in launched.graph()[name].values(), name


@pytest.mark.parametrize("node", [*NODES.builtin, "vignette"])
def test_a_node_without_a_launch_file_runs_by_its_name(node):
    launched = Launched("node", node=node, takes="image_raw", input="/there")
    assert (launched.ours[node].type, launched.ours[node].args) == ("node", node)
    assert launched.resolve(node, "/image_raw") == "/there"


@pytest.mark.parametrize(("name", "called"), [({}, "own"), ({"name": "mine"}, "mine")])
def test_a_node_of_ones_own_has_a_name_on_the_graph(name, called):
    launched = Launched("node", node="/it's mine/own.py:Own", input="/there", **name)
    assert list(launched.ours) == [called]
    assert launched.resolve(called, "/image") == "/there"


@pytest.mark.parametrize(
    ("name", "package", "args"),
    [
        *((name, "rviz2", {"rviz": "true"}) for name in MAIN),
        *((name, "rqt_gui", {"rqt": "true"}) for name in MAIN if name != "main_robots"),
        ("main_usb_cam", "usb_cam", {"camera_driver": "usb_cam"}),
    ],
)
def test_nothing_has_begun_where_a_package_is_missing(name, package, args):
    """A launch that fails leaves alone what it has started, which then runs on."""
    assert begun_without(name, package, **args) == []


@pytest.mark.parametrize("name", MAIN)
def test_unknown_view_is_refused(name):
    with pytest.raises(Refused, match="view:=doors; choose windows, web, none"):
        Launched(name, view="doors")


@pytest.mark.parametrize("name", FILES)
def test_every_argument_is_documented(name):
    for argument, (description, has_default) in Launched(name).arguments.items():
        assert description, argument
        assert has_default or argument in NEEDED, argument


@pytest.mark.parametrize("name", FILES)
def test_every_named_file_exists(name):
    launched = Launched(name, rqt="true")
    for node in launched.ours.values():
        assert node.type in names()
    for tool in ("rviz", "rqt"):
        if name in MAIN:
            assert Path(launched.nodes[tool].args.split()[1]).is_file()


@pytest.mark.parametrize("path", sorted(LAUNCH.rglob("*.launch.xml")), ids=lambda path: path.name)
def test_nothing_that_is_included_changes_what_follows(path):
    """What an include sets holds for the rest of its file, unless a group ends it."""
    tree = ElementTree.parse(path)
    groups = {id(include) for group in tree.iter("group") for include in group}
    assert all(id(include) in groups for include in tree.iter("include"))


@pytest.mark.parametrize("path", sorted(LAUNCH.rglob("*.launch.xml")), ids=lambda path: path.name)
def test_what_an_included_file_needs_is_passed_on(path):
    """ROS 2 refuses an include without it, even where the including file has it."""
    for include in ElementTree.parse(path).iter("include"):
        name = (
            include.attrib["file"].partition("/launch/")[2].replace("$(var images_by)", "streamer")
        )
        passed = {arg.attrib["name"] for arg in include}
        for arg in ElementTree.parse(LAUNCH / name).getroot().findall("arg"):
            assert "default" in arg.attrib or arg.attrib["name"] in passed, (name, arg.attrib)
