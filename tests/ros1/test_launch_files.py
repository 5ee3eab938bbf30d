"""The launch files describe the graphs of `pipelines`, and set what the nodes declare."""

from __future__ import annotations

import re
import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
import yaml
from launched import (
    LAUNCH,
    NEEDED,
    OPTIONS,
    PACKAGE,
    PIPELINE_OPTIONS,
    PLAYER_OPTIONS,
    LaunchedGraph,
    joined,
)

from ros_visualise.core.params import specs, update
from ros_visualise.graph.landmarks import with_tags
from ros_visualise.graph.pipelines import build, simulation_pipeline
from ros_visualise.nodes import SourceType, find, find_all
from ros_visualise.running.executables import names
from ros_visualise.runtime.playing import playing_params

FILES = sorted(path.name for path in LAUNCH.glob("*.launch"))
MAIN_IMAGES = ("main_video", "main_usb_cam", "main_rosbag")


class Launched(LaunchedGraph):
    """What roslaunch's own loader makes of a launch file."""

    def __init__(self, name: str, /, **args: Any) -> None:
        from roslaunch.config import ROSLaunchConfig
        from roslaunch.xmlloader import XmlLoader

        self.config = ROSLaunchConfig()
        argv = [f"{name}:={value}" for name, value in (NEEDED | args).items()]
        path = LAUNCH / f"{name.removesuffix('.launch')}.launch"
        XmlLoader().load(str(path), self.config, argv=argv, verbose=False)
        self.nodes = {node.name: node for node in self.config.nodes}
        self.ours = {n.name: n for n in self.config.nodes if n.package == "ros_visualise"}

    def params(self, node: str) -> dict[str, Any]:
        prefix = f"/{node}/"
        params = self.config.params.items()
        return {n.removeprefix(prefix): p.value for n, p in params if n.startswith(prefix)}

    def resolve(self, node: str, topic: str) -> str:
        from rosgraph.names import resolve_name

        remapped = {resolve_name(a, "/"): resolve_name(b, "/") for a, b in self.remaps(node)}
        return remapped.get(resolve_name(topic, "/"), topic)

    def remaps(self, node: str) -> list[list[str]]:
        remaps: list[list[str]] = self.nodes[node].remap_args
        return remaps


@pytest.mark.parametrize("pipeline", ["false", "true"])
@pytest.mark.parametrize(
    ("name", "args", "source"),
    [
        ("main_video", {}, "streamer"),
        ("main_usb_cam", {}, "camera"),
        ("main_usb_cam", {"camera_driver": "usb_cam"}, None),
    ],
)
def test_graph_is_that_of_the_pipelines(name, args, source, pipeline):
    launched = Launched(name, pipeline=pipeline, **args)
    expected = build(source, "/image_raw")
    assert launched.graph() == joined(expected)
    assert len(launched.ours) == (1 if pipeline == "true" else len(expected.members))


@pytest.mark.parametrize(
    ("name", "args", "required"),
    [
        ("main_video", {}, {"streamer"}),
        ("main_video", {"pipeline": "true"}, {"pipeline"}),
        ("main_usb_cam", {}, {"camera"}),
        ("main_usb_cam", {"camera_driver": "usb_cam"}, {"usb_cam"}),
        ("main_rosbag", {"pipeline": "true"}, {"player"}),
        ("main_path", {"bag": "none"}, {"husky"}),
        ("main_landmarks", {"source": "none"}, set()),
    ],
)
def test_a_launch_ends_with_its_source_and_with_no_other_node(name, args, required):
    launched = Launched(name, **args)
    assert {node.name for node in launched.config.nodes if node.required} == required
    for source in required & {"streamer", "player"}:
        assert launched.params(source)["stay"] is True  # a source that was played has not failed


def test_usb_cam_publishes_what_the_nodes_take():
    launched = Launched("main_usb_cam", camera_driver="usb_cam")
    assert launched.resolve("usb_cam", "/usb_cam/image_raw") == "/image_raw"
    assert launched.resolve("usb_cam", "/usb_cam/camera_info") == "/camera_info"


@pytest.mark.parametrize("pipeline", ["false", "true"])
def test_recording_plays_what_the_nodes_take(pipeline):
    launched = Launched("main_rosbag", pipeline=pipeline, image="/cam00/image_rect")
    assert launched.graph() == joined(build(None, "/image_raw"))
    given = launched.params("player")
    assert (given["path"], given["image"]) == ("/flight.bag", "/cam00/image_rect")
    assert given["wait_for"] == "image_raw"
    assert launched.config.params["/use_sim_time"].value is True


def test_path_follows_the_odometry_that_is_named():
    launched = Launched("main_path", odom="/wheels")
    assert launched.graph()["path"]["odom"] == "/wheels"
    assert launched.graph()["path"]["path out"] == "/path"
    assert launched.resolve("rviz", "/odom") == "/wheels"


@pytest.mark.parametrize("robot", ["husky", "quadrotor"])
def test_path_follows_a_simulated_robot(robot):
    launched = Launched("main_path", bag="none", simulator=robot, mission="square", seed=3)
    graph, expected = launched.graph(), joined(simulation_pipeline(robot))
    assert graph[robot] == expected[robot]
    assert graph["path"]["odom"] == expected["path"]["odom"]
    given = launched.params(robot)
    assert (given["world"], given["mission"], given["seed"]) == ("field", "square", 3)
    assert launched.config.params["/use_sim_time"].value is True
    assert launched.nodes["rviz"].args.endswith("-f map")
    assert set(launched.ours) == {robot, "path"}


@pytest.mark.parametrize("robot", ["husky", "quadrotor"])
def test_landmarks_of_a_simulated_world_are_found_with_the_sizes_of_its_tags(robot):
    launched = Launched("main_landmarks", simulator=robot, world="playpen")
    graph, expected = launched.graph(), joined(with_tags(simulation_pipeline(robot), True, None))
    assert graph[robot] == expected[robot]
    assert graph["tag_detector"] == expected["tag_detector"]
    localizer = graph["landmark_localizer"]
    assert localizer.pop("objects") == "/objects"  # of a network that one may add
    taken = {port: topic for port, topic in localizer.items() if "out" not in port}
    assert taken == {p: t for p, t in expected["landmark_localizer"].items() if "out" not in p}
    tags = Path(launched.params("tag_detector")["tags"])
    assert (tags.name, tags.is_file()) == ("playpen_tags.yaml", True)
    assert launched.nodes["rviz"].args.endswith("-f map")


@pytest.mark.parametrize(
    ("source", "node"), [("video", "streamer"), ("camera", "camera"), ("bag", "player")]
)
def test_landmarks_are_looked_for_in_other_images_too(source, node):
    launched = Launched("main_landmarks", source=source, tag_size=0.16, save_to="mine.yaml")
    assert set(launched.ours) == {node, "tag_detector", "landmark_localizer"}
    assert launched.graph()["tag_detector"]["image"] == "/image_raw"
    given = launched.params("tag_detector")
    assert (given["size"], "tags" in given) == (0.16, False)
    assert launched.params("landmark_localizer")["save_to"] == "mine.yaml"
    assert "moving" not in launched.params("landmark_localizer")


@pytest.mark.parametrize("source", ["simulator", "bag", "none"])
def test_navigation_corrects_an_odometry_by_tags(source):
    given = {"odom": "/vio", "map": "landmarks.yaml", "moving": "100"}
    launched = Launched("main_navigation", source=source, **given)
    robots = {"simulator": {"quadrotor", "pose_error"}, "bag": {"player"}, "none": set()}
    nodes = {"tag_detector", "landmark_navigator", "path", "navigation_path"}
    assert set(launched.ours) == nodes | robots[source]
    assert launched.resolve("landmark_navigator", "/odometry") == "/vio"
    assert launched.resolve("landmark_navigator", "/detections") == "/detections"
    assert launched.params("landmark_navigator")["map"] == "landmarks.yaml"
    assert launched.params("landmark_navigator")["mode"] == "extend"
    assert launched.params("landmark_navigator")["moving"] == "100"
    assert launched.resolve("navigation_path", "/pose_cov") == "/navigation/pose"
    assert launched.resolve("navigation_path", "/fix") == "/navigation/no_fix"
    assert ("/robot_description" in launched.config.params) == (source == "bag")
    if source == "simulator":
        assert launched.resolve("pose_error", "/pose") == "/navigation/pose"
        assert launched.resolve("pose_error", "/truth") == "/ground_truth/odom"


def test_nothing_is_simulated_where_there_is_a_robot():
    bag = Launched("main_path", bag="/a.bag")
    live = Launched("main_path", bag="none", simulator="none")
    assert set(bag.ours) == {"player", "path"}
    assert set(live.ours) == {"path"}
    for launched in (bag, live):
        assert launched.graph()["path"]["odom"] == "/husky_velocity_controller/odom"
        assert launched.nodes["rviz"].args.endswith("-f odom")


@pytest.mark.parametrize(
    ("simulator", "words"), [("gazebo", "husky_gazebo"), ("unicorn", "unicorn")]
)
def test_what_cannot_be_simulated_is_said(simulator, words):
    from roslaunch.core import RLException
    from roslaunch.xmlloader import XmlParseException
    from rospkg import ResourceNotFound

    with pytest.raises((RLException, XmlParseException, ResourceNotFound), match=words):
        Launched("main_path", bag="none", simulator=simulator)


@pytest.mark.parametrize(
    "name", ["fps_control", "filters", "edge_detector", "landmark_detector", "path"]
)
def test_input_of_one_node_is_an_argument(name):
    argument = "odom" if name == "path" else "input"
    launched = Launched(name, **{argument: "/elsewhere"})
    assert next(iter(launched.graph()[name].values())) == "/elsewhere"


@pytest.mark.parametrize("file", FILES)
def test_parameters_are_declared_and_change_no_default(file):
    every = {"camera_info_url": "calibration.yaml", "size": "640x480"}
    for pipeline in ("false", "true"):
        launched = Launched(file, pipeline=pipeline, **every)
        for name, node in launched.ours.items():
            given = launched.params(name)
            if node.type == "pipeline":
                inner = {n: v for n, v in given.items() if n not in PIPELINE_OPTIONS}
                for path in inner:
                    inner_node, _, param = path.partition("/")
                    check_declared(inner_node, {param: inner[path]})
            elif node.type in ("node", "viewer"):
                assert set(given) <= OPTIONS
            elif node.type == "player":
                of_node = {n: v for n, v in given.items() if n not in OPTIONS | PLAYER_OPTIONS}
                check_declared(name, of_node)
            else:
                check_declared(node.type, {n: v for n, v in given.items() if n not in OPTIONS})


def check_declared(node: str, given: Mapping[str, Any]) -> None:
    """Each is declared; those that name nothing of the user's are as declared.

    Who else tells a frame is of a launch file's own.
    """
    declared = find(node)
    is_source = isinstance(declared, SourceType)
    defaults = (playing_params(declared) if is_source else declared.params)()
    changed = update(defaults, given)
    named = {"path", "uri", "camera_info_url", "size", "mission", "tags", "class_prefix"}
    named.add("map_to_odom")
    for spec in specs(defaults):
        if spec.name not in named:
            assert getattr(changed, spec.name) == getattr(defaults, spec.name), spec.name


@pytest.mark.parametrize("file", FILES)
def test_every_argument_is_documented(file):
    from roslaunch.arg_dump import get_args

    for name, (doc, default) in get_args([str(LAUNCH / file)]).items():
        assert doc, name
        assert default or name in NEEDED, f"{name} is listed as required"


def test_main_files_pass_on_every_argument_of_the_nodes():
    """What is set in a main launch file arrives at the process that it is meant for."""
    args = {"fps": 12, "rate": 0.5, "loop": "true", "start": 3, "size": "64x48"}
    args |= {"image_transport": "compressed", "duration": 2}
    separate = Launched("main_video", **args)
    assert separate.params("fps_control")["fps"] == 12
    assert separate.params("edge_detector")["image_transport"] == "compressed"
    streamer = separate.params("streamer")
    together = Launched("main_video", pipeline="true", **args).params("pipeline")
    for name in ("path", "rate", "loop", "size"):
        assert together[f"streamer/{name}"] == streamer[name]
    assert (together["start"], together["duration"]) == (streamer["start"], streamer["duration"])
    assert streamer["start"] == 3
    assert together["fps_control/fps"] == 12
    assert together["image_transport"] == "compressed"


@pytest.mark.parametrize("name", MAIN_IMAGES)
def test_view(name):
    windows = Launched(name)
    looked_at = [node for node in windows.ours if node != "player"]
    places = [windows.params(node)["window"] for node in looked_at]
    assert {windows.params(node)["view"] for node in looked_at} == {"windows"}
    assert len(set(places)) == len(places)
    web = Launched(name, view="web", port=8099)
    assert {web.params(node).get("view", "none") for node in web.ours} == {"none"}
    assert web.params("viewer")["port"] == 8099
    in_one = Launched(name, view="web", port=8099, pipeline="true")
    assert in_one.params("pipeline")["view"] == "web"
    assert in_one.params("pipeline")["port"] == 8099
    assert set(in_one.ours) <= {"pipeline", "player"}


@pytest.mark.parametrize(
    "name", [*MAIN_IMAGES, "main_path", "main_robots", "main_landmarks", "main_navigation"]
)
def test_unknown_view_is_refused(name):
    from roslaunch.core import RLException
    from roslaunch.xmlloader import XmlParseException

    with pytest.raises((RLException, XmlParseException)) as refused:
        Launched(name, view="doors")
    assert "view:=doors; choose windows, web or none" in str(refused.value)
    assert "eval" not in str(refused.value)


@pytest.mark.parametrize(("pipeline", "prefix"), [("false", ""), ("true", "/pipeline")])
def test_parameter_file_wins(tmp_path, pipeline, prefix):
    file = tmp_path / "mine.yaml"
    file.write_text("filters: {gray: false, blur: median}\nfps_control: {fps: 7}\n")
    params = Launched("main_video", params=file, pipeline=pipeline).config.params
    assert params[f"{prefix}/filters/gray"].value is False
    assert params[f"{prefix}/filters/blur"].value == "median"
    assert params[f"{prefix}/fps_control/fps"].value == 7


@pytest.mark.parametrize("file", FILES)
def test_every_named_file_exists(file):
    launched = Launched(file, rqt="true")
    for node in launched.ours.values():
        assert node.type in names()
    for name in ("rviz", "rqt"):
        if file.startswith("main_"):
            words = shlex.split(launched.nodes[name].args)
            assert Path(words[1]).is_file()


@pytest.mark.parametrize("name", [*MAIN_IMAGES, "main_path", "main_landmarks", "main_navigation"])
def test_optional_tools_are_optional(name):
    started = {node.package for node in Launched(name).config.nodes}
    assert started <= {"ros_visualise", "rviz", "tf2_ros"}
    bare = Launched(name, rviz="false", view="none")
    assert {node.package for node in bare.config.nodes} == {"ros_visualise"}
    assert "rqt_gui" in {node.package for node in Launched(name, rqt="true").config.nodes}


@pytest.mark.parametrize(
    ("config", "outside"),
    [
        ("video", set()),
        ("bag", {"velodyne_points", "scan"}),
        ("path", set()),
        ("robot", {"goal"}),
        ("landmarks", {"goal"}),
        ("navigation", {"goal", "initialpose", "navigation/path"}),
    ],
)
def test_rviz_shows_topics_of_the_graph(config, outside):
    navigate = config == "navigation"
    text = (PACKAGE / "config" / f"{config}.rviz").read_text()
    shown = set(re.findall(r"Topic: (\S+)", text))
    published = {
        name.removeprefix("/")
        for name in with_tags(simulation_pipeline("husky"), True, "" if navigate else None).topics
    }
    assert shown
    assert shown <= published | outside


def test_diagnostics_of_every_node_have_a_place():
    analyzers = yaml.safe_load((PACKAGE / "config" / "diagnostics.yaml").read_text())["analyzers"]
    regexes = [analyzer["regex"] for analyzer in analyzers.values()]
    for name in (found.name for found in find_all()):
        for node in (f"/{name}", f"/uav1/{name}", f"/pipeline/{name}"):
            assert sum(bool(re.match(regex, node)) for regex in regexes) == 1, node


def test_no_path_of_anybody():
    for path in [*LAUNCH.rglob("*.launch"), *(PACKAGE / "config").rglob("*.rviz")]:
        assert not re.search(r"/home/|/root/|/Users/", path.read_text()), path


@pytest.mark.parametrize("name", ["main_video", "main_usb_cam", "main_rosbag", "main_path"])
def test_the_page_of_a_main_launch_file_records_where_it_is_told(name: str) -> None:
    options = {"allow_origin": "https://robot.example.org", "record_dir": "/recordings"}
    found = Launched(name, view="web", token="false", **options).params("viewer")
    assert found.items() >= {"token": False, **options}.items()
    assert Launched(name, view="web").params("viewer")["token"] is True
